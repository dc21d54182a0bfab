# SPDX-FileCopyrightText: 2026 SRFS contributors
# SPDX-License-Identifier: Apache-2.0
"""Versions of a node's program: stored, used, put on probation and rolled back, with and without a ring that watches them."""

import json
import os
import re
import signal
import time
import unittest

from support import BIN, DEADLINE_S, ToolTest

from srfs.flight.processes import wait_until

NODES = """
nodes:
  - { name: faulty, executable: faulty_node, parameters: { configure_ms: 20 } }
  - { name: second, executable: faulty_node, parameters: { configure_ms: 20 } }
"""
GOOD = f'exec {BIN}/faulty_node "$@"'


class VersionsTest(ToolTest):
    ring = ""

    def setUp(self):
        super().setUp()
        self.file = self.folder / "t.yaml"
        self.file.write_text(f"deployment: t\n{self.ring}{NODES}")
        self.var.mkdir()
        self.addCleanup(lambda: self.srfs("down"))

    def up(self):
        result = self.srfs("up")
        self.assertEqual(result.returncode, 0, result.stdout + result.stderr)

    def add(self, script):
        """Adds a version of `faulty` that runs this script. Returns its number."""
        program = self.folder / "program"
        program.write_text(f"#!/bin/sh\n{script}\n")
        return self.json("versions", "add", "faulty", str(program), "--origin", "a test")["version"]

    def use(self, version, probation_s=3600):
        return self.srfs("versions", "use", "faulty", str(version), "--probation", str(probation_s))

    def versions(self):
        return self.json("versions", "--node", "faulty")[0]

    def state(self, number):
        return {v["number"]: v["state"] for v in self.versions()["versions"]}[number]

    def node(self):
        return {n["name"]: n for n in self.json_of_status()}["faulty"]

    def json_of_status(self):
        result = self.srfs("status", "--json")  # exit code 1 while a node is down
        return json.loads(result.stdout)

    def wait_for_version(self, number):
        wait_until(lambda: self.versions()["running"] == number and self.node()["state"] == "active", DEADLINE_S, f"version {number} in Active")


class WithoutRingTest(VersionsTest):
    def test_a_version_is_stored_used_confirmed_and_left_for_the_one_before(self):
        self.up()
        self.assertEqual([self.versions()[key] for key in ("active", "last_good", "running", "versions")], [0, 0, 0, []])
        self.assertEqual(self.add(GOOD), 1)
        self.assertEqual(self.state(1), "candidate")
        before = self.node()["incarnation"]

        result = self.use(1)
        self.assertEqual(result.returncode, 0, result.stderr)
        self.assertIn("faulty runs version 1, on probation for 3600 s", result.stdout)
        self.wait_for_version(1)
        self.assertEqual(self.node()["incarnation"], before + 1)
        self.assertEqual(self.state(1), "probation")
        self.assertEqual(self.srfs("versions", "confirm", "faulty", "1").returncode, 0)
        self.assertEqual((self.state(1), self.versions()["last_good"]), ("committed", 1))

        self.assertEqual(self.use("previous").returncode, 0)
        self.wait_for_version(0)
        table = self.srfs("versions").stdout
        for part in ("faulty", "golden", "active", "previous", "a test", "second"):
            self.assertIn(part, table)

    def test_a_start_of_the_suite_starts_the_active_version(self):
        self.add(GOOD)
        self.assertEqual(self.use(1).returncode, 0)
        self.assertEqual((self.versions()["active"], self.versions()["running"]), (1, None))
        self.up()
        self.assertEqual(self.versions()["running"], 1)

    def test_a_version_that_does_not_start_is_followed_by_the_last_good_one(self):
        self.up()
        self.add("exit 7")
        result = self.use(1)
        self.assertEqual(result.returncode, 1)
        self.assertIn("the golden version instead of version 1", result.stderr)
        self.wait_for_version(0)
        self.assertEqual(self.state(1), "failed")
        self.assertIn("the golden version instead of version 1", self.srfs("faults").stdout)

    def test_damage_is_found_and_a_damaged_program_is_not_used(self):
        self.up()
        self.add(GOOD)
        self.assertEqual(self.srfs("versions", "--check").returncode, 0)
        program = self.var / "versions" / "faulty" / "faulty.1"
        text = program.read_text()
        program.chmod(0o755)
        program.write_text(text.upper())
        result = self.srfs("versions", "--check")
        self.assertEqual(result.returncode, 1)
        self.assertIn("DAMAGED", result.stdout)
        result = self.use(1)
        self.assertEqual(result.returncode, 1)
        self.assertIn("SHA-256", result.stderr)
        self.assertEqual((self.versions()["active"], self.versions()["running"]), (0, 0))

    def test_a_version_is_not_confirmed_before_it_runs(self):
        self.add(GOOD)
        self.assertEqual(self.use(1).returncode, 0)
        result = self.srfs("versions", "confirm", "faulty", "1")
        self.assertEqual(result.returncode, 1)
        self.assertIn("faulty does not run version 1", result.stderr)
        self.up()
        self.assertEqual(self.srfs("versions", "confirm", "faulty", "1").returncode, 0)

    def test_a_probation_sees_two_starts_of_the_suite_and_no_third(self):
        self.add(GOOD)
        self.assertEqual(self.use(1).returncode, 0)
        for expected in (1, 1, 0):
            self.up()
            self.assertEqual(self.versions()["running"], expected)
            self.up()  # starts nothing new: not counted
            self.assertEqual(self.srfs("down").returncode, 0)
        self.assertEqual(self.state(1), "failed")
        self.assertIn("3 resets or starts of the suite in its probation", self.srfs("faults").stdout)

    def test_what_cannot_be_done_is_refused_with_a_reason(self):
        self.assertEqual(self.srfs("versions", "add", "nobody", str(self.file)).returncode, 2)
        self.assertEqual(self.srfs("versions", "add", "faulty", "/nowhere").returncode, 1)
        self.assertEqual(self.use("first").returncode, 2)
        self.assertEqual(self.use(5).returncode, 1)
        self.assertEqual(self.use("previous").returncode, 2)
        self.add(GOOD)
        self.assertEqual(self.srfs("versions", "confirm", "faulty", "1").returncode, 1)
        self.assertEqual(self.srfs("versions", "remove", "faulty", "golden").returncode, 1)
        self.assertEqual(self.srfs("versions", "remove", "faulty", "1").returncode, 0)
        self.assertEqual(self.versions()["versions"], [])


class WithRingTest(VersionsTest):
    ring = "ring: { period_ms: 100, misses: 5, restarts: 2, first_wait_ms: 60000, longest_wait_ms: 60000, window_ms: 600000 }\n"

    def fault(self):
        """The ledger's newest line about a failed version."""
        lines = [json.loads(line) for line in self.srfs("faults", "--json").stdout.splitlines()]
        return next((line for line in reversed(lines) if line.get("failed_version") is not None), None)

    def test_a_node_in_a_slot_restarts_the_golden_program_of_another(self):
        self.up()
        self.use(self.json("versions", "add", "faulty", str(BIN / "faulty_node"), "--origin", "a test")["version"])
        self.wait_for_version(1)
        second = {n["name"]: n for n in self.json_of_status()}["second"]
        os.kill(second["pid"], signal.SIGKILL)

        def is_back():
            now = {n["name"]: n for n in self.json_of_status()}["second"]
            return now["state"] == "active" and now["pid"] != second["pid"]

        wait_until(is_back, DEADLINE_S, "second restarted by faulty")

    def test_a_version_that_crashes_in_its_probation_comes_back_as_the_last_good_one_at_once(self):
        self.up()
        self.add(GOOD)
        self.assertEqual(self.use(1).returncode, 0)
        self.wait_for_version(1)
        os.kill(self.node()["pid"], signal.SIGSEGV)
        self.wait_for_version(0)  # without the wait of 60 s after a second death in a row
        wait_until(lambda: self.state(1) == "failed", DEADLINE_S, "the verdict on disk")
        fault = self.fault()
        self.assertEqual((fault["failed_version"], fault["version"], fault["outcome_text"]), (1, 0, "restarted"))
        self.assertIn("in its probation", fault["reason"])

    def test_a_version_that_never_becomes_active_is_rolled_back_too(self):
        self.up()
        broken = self.folder / "broken.yaml"
        broken.write_text(self.file.read_text().replace("configure_ms: 20", "configure_ms: 20, fault: fail_activation", 1))
        self.add(f"exec {BIN}/faulty_node --name faulty --deployment {broken} --var {self.var}")
        self.assertEqual(self.use(1).returncode, 0)
        self.wait_for_version(0)
        wait_until(lambda: self.state(1) == "failed", DEADLINE_S, "the verdict on disk")
        self.assertIn("instead of active on probation", self.fault()["reason"])

    def test_a_probation_that_is_survived_makes_the_version_the_last_good_one_and_later_deaths_keep_it(self):
        self.up()
        self.add(GOOD)
        self.assertEqual(self.use(1, probation_s=1).returncode, 0)
        wait_until(lambda: self.state(1) == "committed", DEADLINE_S, "the end of the probation")
        self.wait_for_version(1)
        old = self.node()
        os.kill(old["pid"], signal.SIGSEGV)
        wait_until(lambda: (self.node()["incarnation"] or 0) > old["incarnation"], DEADLINE_S, "the next incarnation")
        self.wait_for_version(1)
        self.assertEqual(self.state(1), "committed")
        self.assertIsNone(self.fault())


class LimitsTest(VersionsTest):
    ring = "ring: { period_ms: 100, misses: 5 }\n"

    def setUp(self):
        super().setUp()
        with self.file.open("a") as file:
            file.write("  - { name: maintenance, executable: maintenance_node }\n")

    def up_with(self, fault):
        """Starts the suite with this fault in the golden version, and waits until maintenance has samples of it."""
        self.file.write_text(self.file.read_text().replace("configure_ms: 20", f"configure_ms: 20, fault: {fault}", 1))
        self.up()
        log = self.var / "log" / "maintenance.log"
        wait_until(lambda: "monitoring the limits of versions on probation" in log.read_text(), DEADLINE_S, "maintenance")
        end = time.monotonic() + 2
        wait_until(lambda: time.monotonic() > end, DEADLINE_S, "samples of the golden version")

    def use_one_that(self, fault, probation_s=3600):
        other = self.folder / "other.yaml"
        other.write_text(re.sub("fault: [a-z_]+", f"fault: {fault}", self.file.read_text()))
        self.add(f"exec {BIN}/faulty_node --name faulty --deployment {other} --var {self.var}")
        self.assertEqual(self.use(1, probation_s).returncode, 0)

    def reason(self):
        faults = [json.loads(line) for line in self.srfs("faults", "--json").stdout.splitlines()]
        return next(f for f in reversed(faults) if f.get("failed_version") == 1)["reason"]

    def test_a_version_whose_telemetry_leaves_a_hard_limit_is_rolled_back(self):
        self.up_with("good_battery")
        self.use_one_that("low_battery")
        wait_until(lambda: self.state(1) == "failed", DEADLINE_S, "the verdict on disk")
        self.wait_for_version(0)
        self.assertRegex(self.reason(), r"limit violation: payload_eps\.\S*battery_voltage_v 5")

    def test_a_version_that_raises_an_event_of_severity_high_is_rolled_back(self):
        self.up_with("good_battery")
        self.use_one_that("high_event")
        wait_until(lambda: self.state(1) == "failed", DEADLINE_S, "the verdict on disk")
        self.wait_for_version(0)
        self.assertIn("limit violation: timing.watchdog_withheld", self.reason())

    def test_a_violation_that_stood_before_is_not_held_against_the_version(self):
        self.up_with("low_battery")
        self.use_one_that("low_battery", probation_s=5)
        wait_until(lambda: self.state(1) == "committed", DEADLINE_S, "the end of the probation")
        self.wait_for_version(1)


class ConfirmedTest(VersionsTest):
    ring = "ring: { period_ms: 100, misses: 5, confirmed: [faulty] }\n"

    def test_a_version_that_works_well_and_is_not_confirmed_in_time_is_rolled_back(self):
        self.up()
        self.add(GOOD)
        result = self.use(1, probation_s=3)
        self.assertIn("is rolled back", result.stdout)
        self.wait_for_version(1)
        self.wait_for_version(0)
        wait_until(lambda: self.state(1) == "failed", DEADLINE_S, "the verdict on disk")
        faults = [json.loads(line) for line in self.srfs("faults", "--json").stdout.splitlines()]
        fault = next(f for f in reversed(faults) if f.get("failed_version") == 1)
        self.assertIn("not confirmed in time", fault["reason"])

    def test_a_version_that_is_confirmed_stays(self):
        self.up()
        self.add(GOOD)
        self.assertEqual(self.use(1, probation_s=5).returncode, 0)
        self.wait_for_version(1)
        pid = self.node()["pid"]
        self.assertEqual(self.srfs("versions", "confirm", "faulty", "1").returncode, 0)
        end = time.monotonic() + 7  # after the probation
        wait_until(lambda: time.monotonic() > end, DEADLINE_S, "the end of the probation")
        self.assertEqual((self.state(1), self.node()["pid"]), ("committed", pid))


if __name__ == "__main__":
    unittest.main()
