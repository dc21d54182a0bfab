# SPDX-FileCopyrightText: 2026 SRFS contributors
# SPDX-License-Identifier: Apache-2.0
"""What `./run test` runs: unit tests under sanitizers alone, but for those marked RELEASE; all system tests."""

import re
import unittest
from pathlib import Path

ROOT = Path(__file__).resolve().parents[3]
FOLDERS = ("examples", "ground", "hw_sim", "lib", "mission", "nodes", "programs", "tests")
RELEASE = re.compile(r"srfs_add_unit_test\(\w+\s+RELEASE\s+SOURCES([^)]*?)\sDEPS")
DOES_LESS = re.compile(r"testing_support::(slow|sanitized)\b")


def files(pattern):
    return (f for folder in FOLDERS for f in (ROOT / folder).rglob(pattern))


def of_the_release_build():
    for lists in files("CMakeLists.txt"):
        for sources in RELEASE.findall(lists.read_text(encoding="utf-8")):
            yield from (lists.parent / source for source in sources.split())


class ReleaseTestsTest(unittest.TestCase):
    def test_what_does_less_under_sanitizers_runs_in_the_release_build_too(self):
        release = set(of_the_release_build())
        unit_tests = [f for f in files("test_*.cpp") if not f.is_relative_to(ROOT / "tests/node")]
        does_less = {f for f in unit_tests if DOES_LESS.search(f.read_text(encoding="utf-8"))}
        self.assertGreater(len(does_less), 8)
        self.assertEqual(does_less - release, set())


class SystemTestsTest(unittest.TestCase):
    def test_each_system_test_is_run(self):
        folder = ROOT / "tests/system"
        registered = (folder / "CMakeLists.txt").read_text(encoding="utf-8")
        tests = [f.stem for f in folder.glob("test_*.py") if re.search(r"^    def test_", f.read_text(encoding="utf-8"), re.MULTILINE)]
        self.assertGreater(len(tests), 60)
        self.assertEqual([name for name in tests if not re.search(rf"\b{name}\b", registered)], [])
