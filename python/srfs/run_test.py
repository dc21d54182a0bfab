# SPDX-FileCopyrightText: 2026 SRFS contributors
# SPDX-License-Identifier: Apache-2.0
"""Runs one class of system tests: python3 -m srfs.run_test MODULE.CLASS, in the folder of the module. Each test runs once; a failure counts.

The suite runs in real time here. A witness process that only sleeps (python/srfs/flight/lateness.py) reports how late the machine was meanwhile.
"""

import sys
import unittest

from srfs.flight.lateness import Lateness, describe_lateness


class TellingResult(unittest.TextTestResult):
    """Prints each failure at once: the logs that a test prints at its end are long, and a reader may keep only the beginning."""

    def addError(self, test, err):
        super().addError(test, err)
        self._tell(self.errors)

    def addFailure(self, test, err):
        super().addFailure(test, err)
        self._tell(self.failures)

    def addSubTest(self, test, subtest, err):
        super().addSubTest(test, subtest, err)
        if err is not None:
            self._tell(self.failures if issubclass(err[0], test.failureException) else self.errors)

    def _tell(self, told):
        self.stream.writeln(told[-1][1].rstrip()[-4000:])
        self.stream.flush()


def run(name):
    """Runs the class once. Returns (passed, report of the witness)."""
    suite = unittest.defaultTestLoader.loadTestsFromName(name)
    with Lateness() as witness:
        result = unittest.TextTestRunner(verbosity=2, resultclass=TellingResult).run(suite)
    return result.wasSuccessful() and result.testsRun > 0, witness.end()


def main(name, run=run):
    passed, seen = run(name)
    print(f"witness: {describe_lateness(seen)}", file=sys.stderr)
    return 0 if passed else 1


if __name__ == "__main__":
    sys.exit(main(sys.argv[1]))
