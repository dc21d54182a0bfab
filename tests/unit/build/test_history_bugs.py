# SPDX-FileCopyrightText: 2026 SRFS contributors
# SPDX-License-Identifier: Apache-2.0
"""The bugs of the project's history that python/srfs/history_bugs.py puts back still fit the sources."""

import re
import subprocess
import unittest

from srfs import ROOT, history_bugs


def git(*arguments):
    return subprocess.run(["git", *arguments], cwd=ROOT, capture_output=True, text=True, check=False)


class HistoryBugs(unittest.TestCase):
    def test_all_of_them_apply_together(self):
        done = git("apply", "--check", *(f"{history_bugs.FOLDER}/{bug.name}.patch" for bug in history_bugs.bugs()))
        self.assertEqual(done.stderr, "")
        self.assertGreaterEqual(len(history_bugs.bugs()), 10)

    def test_each_wakes_by_its_own_name_alone(self):
        for bug in history_bugs.bugs():
            text = (ROOT / history_bugs.FOLDER / f"{bug.name}.patch").read_text()
            added = "".join(re.findall(r"^\+(?!\+\+)(.*)$", text, re.M))
            self.assertEqual(set(re.findall(r'history_bug::is_on\("(.*?)"\)', added)), {bug.name})

    def test_each_names_the_commit_that_mended_it(self):
        subjects = set(git("log", "--format=%s").stdout.splitlines())
        if len(subjects) < 100:
            self.skipTest("the history is not here")
        for bug in history_bugs.bugs():
            self.assertTrue(bug.mended_by in subjects, f"{bug.name}: no commit is called {bug.mended_by}")

    def test_the_violation_and_its_faults_are_read_from_what_the_program_prints(self):
        self.assertEqual(history_bugs.violation_in("seed 1 VIOLATION\n\nVIOLATION of L6: a packet\nseed 1"), "L6: a packet")
        self.assertEqual(history_bugs.violation_in("seed 1 ok"), "")


if __name__ == "__main__":
    unittest.main()
