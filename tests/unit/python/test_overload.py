# SPDX-FileCopyrightText: 2026 SRFS contributors
# SPDX-License-Identifier: Apache-2.0
"""What the overload campaign runs beside a load: python/srfs/campaign/overload.py."""

import sys
import unittest

from srfs.campaign.overload import failures_of, run_for


class Asked:
    """As StopSignals, when the end was asked for already."""

    asked = True

    def wait(self, seconds):
        return True


class NotAsked:
    asked = False

    def wait(self, seconds):
        return False


class RunForTest(unittest.TestCase):
    def test_a_command_that_ends_gives_its_code_and_what_it_said(self):
        command = [sys.executable, "-c", "import sys; print('hello'); sys.exit(3)"]
        self.assertEqual(run_for(command, 600, NotAsked()), (3, "hello\n", False))

    def test_a_command_ends_when_the_end_of_the_campaign_is_asked_for(self):
        forever = [sys.executable, "-c", "import signal; signal.pause()"]
        code, _, ended = run_for(forever, 600, Asked())
        self.assertTrue(ended)
        self.assertNotEqual(code, 0)

    def test_a_command_ends_when_its_time_is_over(self):
        forever = [sys.executable, "-c", "import signal; signal.pause()"]
        self.assertTrue(run_for(forever, 0, NotAsked())[2])


class FailuresTest(unittest.TestCase):
    def test_they_are_those_of_the_last_line_or_what_it_said(self):
        self.assertEqual(failures_of('begin\n{"failures": ["a"]}\n'), ["a"])
        self.assertEqual(failures_of("Traceback\nKeyError: 1\n"), ["Traceback\nKeyError: 1"])
        self.assertEqual(failures_of(""), [""])


if __name__ == "__main__":
    unittest.main()
