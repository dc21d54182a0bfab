# SPDX-FileCopyrightText: 2026 SRFS contributors
# SPDX-License-Identifier: Apache-2.0
"""A mission of its own builds, passes its tests and flies with an installed SRFS, without its sources (examples/mission_minimal)."""

import shutil
import subprocess
import unittest
from pathlib import Path

from support import BIN, DEADLINE_S, ROOT, SystemTest

from srfs.flight import mission

BUILD_DEADLINE_S = 1800


class MissionOutside(mission.Mission):
    """Its simulator is its own, all other programs are the installed ones."""

    def __init__(self, var, deployment, installed, own):
        super().__init__(var, deployment, installed, print)
        self.own = own

    def program(self, name):
        return str(self.own / name) if name == "hw_sim" else super().program(name)


class MissionMinimalTest(SystemTest):
    def do(self, *command):
        done = subprocess.run([str(c) for c in command], stdin=subprocess.DEVNULL, capture_output=True, text=True, timeout=BUILD_DEADLINE_S)
        self.assertEqual(done.returncode, 0, f"{command}\n{done.stdout[-4000:]}\n{done.stderr[-4000:]}")
        return done.stdout

    def test_it_builds_passes_its_tests_and_flies_with_an_installed_srfs(self):
        prefix, source, build = self.folder / "srfs", self.folder / "source", self.folder / "build"
        self.do("cmake", "--install", Path(BIN).parent, "--prefix", prefix, "--strip")
        shutil.copytree(ROOT / "examples/mission_minimal", source)

        self.do("cmake", "-S", source, "-B", build, "-G", "Ninja", f"-DCMAKE_PREFIX_PATH={prefix}", "-DCMAKE_BUILD_TYPE=Release")
        self.do("cmake", "--build", build)
        self.do("ctest", "--test-dir", build, "--no-tests=error", "--output-on-failure")
        self.assertNotIn(str(ROOT), (build / "build.ninja").read_text().replace(str(source), ""))

        deployment = build / "share/mission_minimal/sim.yaml"
        with MissionOutside(self.var, deployment, prefix / "bin", build / "bin") as flight:
            ground = flight.ground()
            field = ground.housekeeping("payload_magnetometer", DEADLINE_S, matches=lambda f: f["range"] == "coarse")
            self.assertGreater(field["fields"]["magnitude_t"], 1e-5)
            self.assertTrue(ground.command("tc magnetometer.set_range range=fine")["success"])
            self.assertIsNotNone(ground.housekeeping("payload_magnetometer", DEADLINE_S, matches=lambda f: f["range"] == "fine"))

            self.assertIsNotNone(ground.housekeeping("can_switcher", DEADLINE_S, matches=lambda f: f["grants.payload_dosimeter"] > 0))
            beacon = ground.wait_for(lambda m: m.get("type") == "beacon", DEADLINE_S)
            self.assertIn("node_state.payload_magnetometer", beacon["fields"])
            self.assertIsNone(beacon["fields"]["battery_voltage_v"], "no source")

            flight.control({"peripheral": "dosimeter", "fault": "storm"})
            self.assertIsNotNone(ground.wait_for(lambda m: m.get("event") == "dosimeter.storm", DEADLINE_S))
            self.assertEqual(flight.control({"query": "executed"})["executed"]["magnetometer"]["count"], 1)

            refused = ground.command("tc image.capture task=1")
            self.assertEqual(refused.get("name"), "unknown_node", refused)

        out = self.folder / "minimal.xml"
        self.do("/usr/bin/python3", "-B", prefix / "share/srfs/generator/mission_xtce.py", "--dictionary", deployment.parent, "--out", out)
        self.assertIn("payload_dosimeter", out.read_text())


if __name__ == "__main__":
    unittest.main()
