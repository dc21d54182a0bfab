# SPDX-FileCopyrightText: 2026 SRFS contributors
# SPDX-License-Identifier: Apache-2.0
"""An invalid deployment file: the message names the file, the key and the expected value; exit code 2."""

import re
import subprocess
import unittest

import yaml
from support import BIN, PROGRAM, SystemTest

from srfs import ROOT

MISTAKES = [
    # (what, text of sim.yaml, its replacement, what the message names)
    ("an unknown key", "dds: { domain: auto,", "dds: { domian: 1, domain: auto,", "domian"),
    ("a wrong type", "tick_period_ms: 100", "tick_period_ms: soon", "tick_period_ms"),
    ("a value out of its range", "baud: 921600", "baud: -1", "baud"),
    ("an unknown parameter", "parameters: { initial_mode: nominal }", "parameters: { initial_mood: nominal }", "initial_mood"),
    ("a slot without its time", "{ payload: payload_eps, allotted_ms: 60,", "{ payload: payload_eps,", "allotted_ms"),
    ("a missing device", '  can: "sim:run/can_hub.sock"\n', "", "can"),
    ("a device of an unknown kind", '"sim:run/can_hub.sock"', '"pigeon:loft"', "devices.can"),
    ("an unknown key of the simulation", "simulation: ", "simulation_x: ", "simulation_x"),
    ("a wrong type in the simulation", "time_acceleration: 60", "time_acceleration: fast", "time_acceleration"),
]


class VersionTest(unittest.TestCase):
    def test_every_program_says_its_version(self):
        version = re.search(r"project\(srfs[^)]*VERSION ([0-9.]+)", (ROOT / "CMakeLists.txt").read_text()).group(1)
        nodes = [f"{node['executable']}" for node in yaml.safe_load((ROOT / "launch_config/sim.yaml").read_text())["nodes"]]
        for program in ["srfs", "srfs-ground", "hw_sim", "srfs-detect", "srfs-product", "srfs-lane", *nodes]:
            with self.subTest(program):
                run = subprocess.run([BIN / program, "--version"], stdin=subprocess.DEVNULL, capture_output=True, text=True, timeout=30)
                self.assertEqual((run.returncode, run.stdout.strip()), (0, version), run.stderr)


class ConfigurationTest(SystemTest):
    def start(self, deployment):
        return subprocess.run(
            [*PROGRAM, "srfs.sim", "--bin", str(BIN), "--var", str(self.var), "--deployment", str(deployment)],
            stdin=subprocess.DEVNULL, capture_output=True, text=True, timeout=90,
        )  # fmt: skip

    def test_each_mistake_is_named(self):
        for what, old, new, named in MISTAKES:
            with self.subTest(what):
                result = self.start(self.deployment((old, new)))
                said = result.stdout + result.stderr
                self.assertEqual(result.returncode, 2, said)
                self.assertIn("changed.yaml", said)
                self.assertIn(named, said)
                self.assertIn("expected", said)
                self.assert_nothing_left(self.var)

    def test_a_deployment_that_does_not_exist_is_refused_with_the_known_names(self):
        result = self.start("moon")
        self.assertEqual(result.returncode, 2)
        self.assertIn("no deployment 'moon'", result.stderr)
        self.assertIn("sim_open", result.stderr)

    def test_no_yaml_at_all(self):
        broken = self.folder / "changed.yaml"
        broken.write_text("nodes: [ {")
        result = self.start(broken)
        self.assertEqual(result.returncode, 2)
        self.assertIn("changed.yaml", result.stdout + result.stderr)


if __name__ == "__main__":
    unittest.main()
