# SPDX-FileCopyrightText: 2026 SRFS contributors
# SPDX-License-Identifier: Apache-2.0
"""python/srfs/flight/deployments.py: files that extend others, as lib/base/test/test_config.cpp has it for the flight software."""

import pathlib
import tempfile
import unittest

from srfs.flight import deployments


class DeploymentsTest(unittest.TestCase):
    def setUp(self):
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        self.folder = pathlib.Path(folder.name)

    def file(self, name, text):
        path = self.folder / f"{name}.yaml"
        path.write_text(text)
        return path

    def test_mappings_are_merged_and_other_values_replaced(self):
        self.file("a", "x: 1\nm: {b: 1, d: {e: 1, f: 2}}\nlist: [1, 2, 3]\n")
        self.file("b", "extends: a\nm: {c: 3, d: {f: 4}}\nlist: [9]\n")
        file = self.file("c", "extends: b\nx: 7\n")
        self.assertEqual(deployments.read(file), {"x": 7, "m": {"b": 1, "c": 3, "d": {"e": 1, "f": 4}}, "list": [9]})

    def test_null_removes_a_key_of_the_other_file(self):
        self.file("a", "m: {b: 1, c: 2}\nring: {p: 1}\n")
        self.assertEqual(deployments.read(self.file("b", "extends: a\nm: {b: null}\nring: null\n")), {"m": {"c": 2}})

    def test_a_loop_or_a_missing_file_is_refused_by_name(self):
        self.file("a", "extends: b\n")
        with self.assertRaisesRegex(ValueError, "a.yaml: 'extends': b"):
            deployments.read(self.file("b", "extends: a\n"))
        with self.assertRaisesRegex(FileNotFoundError, "nothing.yaml"):
            deployments.read(self.file("c", "extends: nothing\n"))

    def test_a_copy_brings_what_it_extends_and_changes_the_first_file_that_has_the_text(self):
        self.file("a", "x: 1\ny: 1\n")
        upper = self.file("b", "extends: a\nx: 2\n")
        (self.folder / "copies").mkdir()
        copy = deployments.copy(upper, self.folder / "copies/changed.yaml", [("x: ", "x: 2"), ("y: 1", "y: 5")])
        self.assertEqual(deployments.read(copy), {"x": 22, "y": 5})
        with self.assertRaisesRegex(ValueError, "z: 1"):
            deployments.copy(upper, copy, [("z: 1", "")])


if __name__ == "__main__":
    unittest.main()
