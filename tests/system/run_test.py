"""Runs one class of system tests: run_test.py MODULE.CLASS. A failure on a machine that had no time for the suite is no verdict yet.

The suite flies in real time here. Where the machine's host takes its CPUs away (a virtual one in CI), nodes are rightly fenced and slots
rightly fail. A witness that only sleeps (tools/demo/lateness.py) tells that apart: when it woke late while a class failed, the class runs
once more, which is said; a second failure counts, as does any on a machine that had time.
"""

import sys
import unittest

import support  # noqa: F401  (the path to the next one)
from lateness import Lateness, describe_lateness, had_time

REPEATED = "repeated for the machine's lateness"  # ./run test looks for it


class TellingResult(unittest.TextTestResult):
    """Says at once what went wrong: the logs that a test prints at its end are long, and what reads them may keep only the beginning."""

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
    """(passed, what the witness saw) of one run of the class."""
    suite = unittest.defaultTestLoader.loadTestsFromName(name)
    with Lateness() as witness:
        result = unittest.TextTestRunner(verbosity=2, resultclass=TellingResult).run(suite)
    return result.wasSuccessful() and result.testsRun > 0, witness.end()


def main(name, run=run):
    passed, seen = run(name)
    print(f"witness: {describe_lateness(seen)}", file=sys.stderr)
    if passed or had_time(seen):
        return 0 if passed else 1
    print(f"{REPEATED}: {name}: {describe_lateness(seen)}", file=sys.stderr)
    passed, seen = run(name)
    print(f"witness: {describe_lateness(seen)}", file=sys.stderr)
    return 0 if passed else 1


if __name__ == "__main__":
    sys.exit(main(sys.argv[1]))
