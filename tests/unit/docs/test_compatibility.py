# SPDX-FileCopyrightText: 2026 SRFS contributors
# SPDX-License-Identifier: Apache-2.0
"""What docs/reference/compatibility.md promises is all that missions are built with: the files of `srfs new`, tutorials and example missions."""

import fnmatch
import re
import unittest

from srfs import ROOT

PAGE = (ROOT / "docs/reference/compatibility.md").read_text()
HEADERS = re.findall(r"`([a-z_]+/[a-z_/*]+[.]hpp)`", PAGE)
FUNCTIONS = re.findall(r"`(srfs_[a-z_]+)`", PAGE)
PLACES = (ROOT / "lib", ROOT, ROOT / "msgs/generator")
USERS = [
    *(ROOT / "programs/srfs/templates").rglob("*.in"),
    *(ROOT / "docs/tutorial").glob("*.md"),
    *(file for name in ("image_motion", "mission_*", "tick_counter") for folder in (ROOT / "examples").glob(name)
      for file in folder.rglob("*") if file.suffix in (".cpp", ".hpp", ".txt")),
]  # fmt: skip


class Promises(unittest.TestCase):
    def missing(self, pattern, promised):
        used = {(word, str(file.relative_to(ROOT))) for file in USERS for word in re.findall(pattern, file.read_text(), re.M)}
        self.assertGreater(len({word for word, _ in used}), 2)
        return sorted((word, file) for word, file in used if not any(fnmatch.fnmatchcase(word, each) for each in promised))

    def test_every_header_that_a_mission_includes_is_promised(self):
        self.assertEqual(self.missing(r'#include ["<]((?:base|suite|nodes|hw_sim|image|msgs|mission|wire|hw|ros|update)/[^">]+)[">]', HEADERS), [])

    def test_every_function_that_a_mission_calls_in_cmake_is_promised(self):
        self.assertEqual(self.missing(r"^\s*(srfs_[a-z_]+)\(", FUNCTIONS), [])

    def test_every_promised_header_is_there(self):
        for header in HEADERS:
            self.assertTrue(header.startswith("mission/") or any(list(place.glob(header)) for place in PLACES), header)


if __name__ == "__main__":
    unittest.main()
