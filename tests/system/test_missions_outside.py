# SPDX-FileCopyrightText: 2026 SRFS contributors
# SPDX-License-Identifier: Apache-2.0
"""Missions of their own build, pass their tests and fly with an installed SRFS, without its sources (examples/mission_*)."""

import shutil
import subprocess
import unittest
from pathlib import Path

from support import BIN, DEADLINE_S, ROOT, SystemTest, hurried_lane

from srfs.flight import mission

BUILD_DEADLINE_S = 1800


class MissionOutside(mission.Mission):
    """Its simulator is its own, all other programs are the installed ones."""

    def __init__(self, var, deployment, installed, own):
        super().__init__(var, deployment, installed, print)
        self.own = own

    def program(self, name):
        return str(self.own / name) if name == "hw_sim" else super().program(name)


class OutsideTest(SystemTest):
    def do(self, *command):
        done = subprocess.run([str(c) for c in command], stdin=subprocess.DEVNULL, capture_output=True, text=True, timeout=BUILD_DEADLINE_S)
        self.assertEqual(done.returncode, 0, f"{command}\n{done.stdout[-4000:]}\n{done.stderr[-4000:]}")
        return done.stdout

    def setUp(self):
        super().setUp()
        self.prefix, self.source, self.build = (self.folder / name for name in ("srfs", "source", "build"))

    def installed(self, name):
        """Installs SRFS, and copies the example."""
        self.do("cmake", "--install", Path(BIN).parent, "--prefix", self.prefix, "--strip")
        shutil.copytree(ROOT / "examples" / name, self.source)  # what links show, too

    def built(self, name):
        """Builds and tests the example with the installed SRFS. Returns its flight."""
        prefix, source, build = self.prefix, self.source, self.build
        self.do("cmake", "-S", source, "-B", build, "-G", "Ninja", f"-DCMAKE_PREFIX_PATH={prefix}", "-DCMAKE_BUILD_TYPE=Release")
        self.do("cmake", "--build", build)
        self.do("ctest", "--test-dir", build, "--no-tests=error", "--output-on-failure")
        self.assertNotIn(str(ROOT), (build / "build.ninja").read_text().replace(str(source), ""))
        return MissionOutside(self.var, build / "share" / name / "sim.yaml", prefix / "bin", build / "bin")


class MissionMinimalTest(OutsideTest):
    def test_it_builds_passes_its_tests_and_flies_with_an_installed_srfs(self):
        self.installed("mission_minimal")
        with self.built("mission_minimal") as flight:
            ground = flight.ground()
            field = ground.housekeeping("payload_magnetometer", DEADLINE_S, matches=lambda f: f["range"] == "coarse")
            self.assertGreater(field["fields"]["magnitude_t"], 1e-5)
            self.assertTrue(ground.command("tc magnetometer.set_range range=fine")["success"])
            self.assertIsNotNone(ground.housekeeping("payload_magnetometer", DEADLINE_S, matches=lambda f: f["range"] == "fine"))
            self.assertIsNotNone(ground.housekeeping("payload_magnetometer_work", DEADLINE_S, matches=lambda f: f["state"] == "active"))

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
        generator = self.folder / "srfs/share/srfs/generator/mission_xtce.py"
        self.do("/usr/bin/python3", "-B", generator, "--dictionary", self.folder / "build/share/mission_minimal", "--out", out)
        self.assertIn("payload_dosimeter", out.read_text())


class ChangedInFlightTest(OutsideTest):
    """What is changed and added while a mission of its own flies."""

    def test_a_payload_is_compiled_on_board_and_a_node_with_a_guarded_parameter_joins(self):
        self.installed("mission_minimal")
        self.do(self.prefix / "bin/srfs", "new", "node", "ticker", "--in", self.source)
        self.edit("ticker/dictionary.yaml", "name: report_every,", "name: report_every, guarded: true,")
        with hurried_lane(self.var), self.built("mission_minimal") as flight:
            self.do(self.prefix / "bin/srfs", "node", "add", self.source / "ticker", "--program", self.build / "bin/ticker_node",
                    "--deployment", flight.deployment, "--var", self.var)  # fmt: skip
            ground = flight.ground()  # it reads the fragments that are there
            self.edit("payload_magnetometer/magnetometer_profile.cpp", "= std::hypot(field[0], field[1], field[2])", "= 2")
            self.install(ground, flight, "payload_magnetometer")
            self.assertIsNotNone(ground.housekeeping("payload_magnetometer", DEADLINE_S, matches=lambda f: f["magnitude_t"] == 2))
            self.assertIsNotNone(ground.housekeeping("payload_magnetometer_work", DEADLINE_S, matches=lambda f: f["state"] == "active"))

            self.assertIsNotNone(ground.housekeeping("ticker", DEADLINE_S, matches=lambda f: f["ticks"] > 0))
            since = ground.position()
            self.complete(ground, "tc parameters.set parameter=ticker.report_every value=7")
            trial = self.wait_for_event(ground, "parameter.on_trial", since)
            self.assertEqual((trial["source"], trial["fields"]["content"]), ("ticker", "report_every=7"), trial)

    def edit(self, file, old, new):
        text = (self.source / file).read_text()
        self.assertEqual(text.count(old), 1, file)
        (self.source / file).write_text(text.replace(old, new))

    def install(self, ground, flight, node):
        """A package of the node's sources, as the ground sends it up."""
        sources, package = self.folder / "sources", flight.var / "files" / f"{node}.pkg"
        shutil.copytree(self.source / node, sources, ignore=shutil.ignore_patterns("test", "*_model.*", "*.yaml", "CMakeLists.txt"))
        package.parent.mkdir(exist_ok=True)
        self.do(self.prefix / "bin/srfs-ground", "package", "make", "--node", node, "--kind", "replace", "--counter", 1, "--sources", sources, "--option=-O0",
                "--key", flight.var / "ground/package_test.seed", "-o", package)  # fmt: skip
        since = ground.position()
        self.complete(ground, f"tc package.install file={package.name}")
        ends = ("update.installed", "update.failed", "update.refused")
        end = ground.wait_for(lambda m: m["type"] == "event" and m["event"] in ends, BUILD_DEADLINE_S, since)
        self.assertEqual(end and end["event"], "update.installed", end)


class MissionTwoBusesTest(OutsideTest):
    def test_two_buses_are_shared_by_their_payloads_and_do_not_disturb_each_other(self):
        self.installed("mission_two_buses")
        with self.built("mission_two_buses") as flight:
            ground = flight.ground()
            for structure in ("payload_eps", "payload_thermal", "payload_adcs", "payload_magnetometer", "payload_dosimeter"):
                self.assertIsNotNone(ground.housekeeping(structure, DEADLINE_S), structure)
            self.assertTrue(ground.command("tc magnetometer.set_range range=fine")["success"])
            self.assertTrue(ground.command("tc eps.switch_load load=2 state=on")["success"])

            platform = ground.housekeeping("can_switcher", DEADLINE_S, matches=lambda f: f["grants.payload_adcs"] > 0)["fields"]
            self.assertEqual(platform["grants.payload_dosimeter"], 0, "it has no slot there")
            science = ground.housekeeping("science_switcher", DEADLINE_S, matches=lambda f: f["grants.payload_dosimeter"] > 0)["fields"]
            self.assertEqual(science["grants.payload_eps"], 0)
            self.assertIsNotNone(ground.housekeeping("science_bus", DEADLINE_S, matches=lambda f: f["frames"] > 0))
            self.assertIsNotNone(ground.housekeeping("science_switcher_work", DEADLINE_S, matches=lambda f: f["state"] == "active"))

            self.assert_only(flight.var / "log/can.log", {0x11, 0x12, 0x13})
            self.assert_only(flight.var / "log/can_science.log", {0x11, 0x42})

            # A jammed bus stops its own payloads and no others.
            flight.control({"can_science": {"babble": {"id": 0}}})
            failures = ground.housekeeping("science_switcher", DEADLINE_S, matches=lambda f: f["failures.payload_magnetometer"] > 2)
            self.assertIsNotNone(failures)
            before = ground.housekeeping("can_switcher", DEADLINE_S)["fields"]
            after = ground.housekeeping("can_switcher", DEADLINE_S, matches=lambda f: f["grants.payload_eps"] > before["grants.payload_eps"] + 10)
            self.assertEqual(after["fields"]["failures.payload_eps"], before["failures.payload_eps"])
            flight.control({"can_science": {}})
            cycle = after["fields"]["cycle"]
            self.assertIsNotNone(ground.housekeeping("payload_magnetometer", DEADLINE_S, matches=lambda f: f["cycle"] > cycle + 50))

    def assert_only(self, log, addresses):
        """The log of a bus has frames to these peripherals, and to no others."""
        seen = set()
        for line in log.read_text().splitlines():
            frame = line.split()[-1].split("#")[0]
            if len(frame) == 8 and frame.startswith("18DA") and frame.endswith("01"):
                seen.add(int(frame[4:6], 16))
        self.assertEqual(seen, addresses, log)


if __name__ == "__main__":
    unittest.main()
