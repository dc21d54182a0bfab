# SPDX-FileCopyrightText: 2026 SRFS contributors
# SPDX-License-Identifier: Apache-2.0
"""What the reader of the dictionary refuses, and what a program gets of it that is not in a struct (msgs/generator)."""

import subprocess
import tempfile
import unittest
from pathlib import Path

import mission_dictionary

from srfs import ROOT

GENERATOR = ROOT / "msgs/generator/mission_structures.py"
FRAGMENT = """
subsystem: probe
apids: [{ name: probe, apid: 70, node: probe, description: "A node" }]
structures:
  - { name: probe_work, kind: housekeeping, id: 1170, node: probe, interval_ms: 10000, description: "Work thread",
      fields: [{ structure: work_thread, as: work }] }
parameters:
  - { name: limit, id: 7001, node: probe, type: u16, range: [1, 9], guarded: true, description: "A limit" }
  - { name: other, id: 7002, node: probe, type: u16, range: [1, 9], description: "Another one" }
"""


class DictionaryTest(unittest.TestCase):
    def setUp(self):
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        self.folder = Path(folder.name)

    def write(self, name, text):
        file = self.folder / name
        file.write_text(text)
        return file

    def mission(self, more):
        self.write("mission.yaml", f'subsystem: mission\nspacecraft: {{ name: PROBE, id: 0x2F }}\npayloads: [payload_probe]\ninclude: []\n'
                   'apids: [{ name: payload_probe, apid: 20, node: payload_probe, description: "A payload" }]\n' + more)  # fmt: skip
        return mission_dictionary.Dictionary(self.folder)

    def test_a_mission_guards_parameters_of_its_own_nodes_and_no_other(self):
        entry = 'parameters: [{{ name: limit, id: 7001, node: {}, type: u16, range: [1, 9], guarded: true, description: "A limit" }}]\n'
        own = self.mission(entry.format("payload_probe"))
        self.assertIn(("payload_probe", True), [(p["node"], p.get("guarded")) for p in own.parameters])
        with self.assertRaisesRegex(mission_dictionary.DictionaryError, "the program of can_switcher is SRFS' own"):
            self.mission(entry.format("can_switcher"))

    def test_the_tables_of_a_fragment_are_those_of_its_node(self):
        out = self.folder / "probe_structures.hpp"
        subprocess.run(["/usr/bin/python3", "-B", GENERATOR, "--dictionary", ROOT / "mission", "--fragment", self.write("dictionary.yaml", FRAGMENT),
                        "--out", out], check=True, capture_output=True, timeout=60)  # fmt: skip
        text = out.read_text()
        self.assertIn('std::array<GuardedParameter, 1> fragment_guarded_parameters{{\n    GuardedParameter{"probe", "limit"},\n}};', text)
        self.assertIn('std::array<WorkThreadStructure, 1> fragment_work_threads{{\n    WorkThreadStructure{"probe", 70, 1170},\n}};', text)


if __name__ == "__main__":
    unittest.main()
