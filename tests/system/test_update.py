# SPDX-FileCopyrightText: 2026 SRFS contributors
# SPDX-License-Identifier: Apache-2.0
"""Packages of sources, from the ground to a running program: the lane builds, tests and swaps them; bad ones are refused or rolled back."""

import os
import signal
import subprocess
import unittest

from support import BIN, DEADLINE_S, SystemTest, hurried_lane

from srfs import ROOT
from srfs.flight import mission
from srfs.flight.processes import wait_until

BUILD_DEADLINE_S = 180  # a compiler on a loaded machine
IDLE = ROOT / "examples" / "payload_idle" / "main.cpp"
GOOD = IDLE.read_text()
BEGIN = "int main(int argc, char** argv) {\n"
# Passes its self-test and dies when a file comes, after each start.
DIES = GOOD.replace(BEGIN, """#include <chrono>
#include <cstdlib>
#include <thread>

#include <unistd.h>
""" + BEGIN + """  std::thread([] {
    while (access("FILE", F_OK) != 0) std::this_thread::sleep_for(std::chrono::milliseconds(10));
    std::abort();
  }).detach();
""")  # fmt: skip
FAILS_ITS_TEST = GOOD.replace(BEGIN, BEGIN + "  return 7;\n")
NODE = "payload_thermal"


class UpdateTest(SystemTest):
    """Runs the suite from an installation, against which the lane builds."""

    counter = 0

    def setUp(self):
        super().setUp()
        self.enterContext(hurried_lane(self.var))

    def flight(self, deployment="fig16"):
        return mission.Mission(self.var, deployment, mission.installed(BIN), print)

    def package(self, text, key=None):
        """Makes a package that replaces NODE by this source. Returns its path."""
        self.counter += 1
        sources = self.folder / f"sources_{self.counter}"
        sources.mkdir()
        (sources / "main.cpp").write_text(text)
        out = self.folder / f"{self.counter}.pkg"
        command = [BIN / "srfs-ground", "package", "make", "--node", NODE, "--kind", "replace", "--counter", self.counter, "--sources", sources,
                   "--option=-O0", "--probation", 3600, "--key", key or self.var / "ground" / "package_test.seed", "-o", out]  # fmt: skip
        made = subprocess.run([str(word) for word in command], stdin=subprocess.DEVNULL, capture_output=True, text=True, timeout=60)
        self.assertEqual(made.returncode, 0, made.stderr)
        return out

    def put(self, flight, package):
        """Stores the package as CFDP leaves it; other tests cover the upload. Returns its name."""
        files = flight.var / "files"
        files.mkdir(exist_ok=True)
        (files / package.name).write_bytes(package.read_bytes())
        return package.name

    def install(self, ground, flight, package, *more):
        since = ground.position()
        outcome = ground.command(f"tc package.install file={self.put(flight, package)} {' '.join(more)}", 60)
        return outcome, since

    def end(self, ground, since):
        """The event that ends an update."""
        ends = ("update.installed", "update.candidate", "update.failed", "update.refused")
        event = ground.wait_for(lambda m: m["type"] == "event" and m["event"] in ends, BUILD_DEADLINE_S, since)
        self.assertIsNotNone(event, "the update ended")
        return event

    def versions(self, flight):
        return flight.versions(NODE)

    def status(self, flight, node=NODE):
        return {n["name"]: n for n in flight.status()}[node]

    def outcomes(self, recorder):
        return recorder.select(lambda m: m["type"] == "liveness" and m["verdict"] == "outcome" and m["outcome"] == "restarted")

    def active(self, flight, node=NODE):
        return self.status(flight, node)["state"] == "active"


class GoodPackageTest(UpdateTest):
    def test_a_package_is_built_tested_and_swapped_in_without_the_ring_and_with_nothing_lost(self):
        with self.flight() as flight:
            ground, recorder = flight.ground(), flight.recorder()
            before = {n["name"]: n["pid"] for n in flight.status()}
            outcome, since = self.install(ground, flight, self.package(GOOD))
            self.assertEqual(outcome["stage"], "completed", outcome)
            # Other telecommands to maintenance do not wait for a compiler.
            self.complete(ground, "tc ring.report_faults count=1")
            end = self.end(ground, since)
            self.assertEqual((end["event"], end["fields"]["version"]), ("update.installed", 1), end)
            print("outage", end["fields"]["outage_ms"], "ms")
            after = {n["name"]: n["pid"] for n in flight.status()}
            self.assertEqual({name for name in after if after[name] != before[name]}, {NODE})
            self.assertEqual((self.versions(flight)["running"], self.versions(flight)["last_good"]), (1, 0))
            self.assertEqual(self.outcomes(recorder), [], "the ring restarted nobody")
            steps = [m["fields"]["step"] for m in ground.select(lambda m: m["type"] == "event" and m["event"] == "update.step", since)]
            self.assertEqual(steps, ["build", "self_test", "store", "swap"])
            ground.send("tc package.report")
            status = ground.housekeeping("update_status", DEADLINE_S, since)["fields"]
            self.assertEqual((status["step"], status["node"], status["counter"], status["starts"]), ("installed", NODE, 1, 1))
            log = ground.wait_for(lambda m: m["type"] == "event" and m["event"] == "update.log_queued", DEADLINE_S, since)
            self.assertEqual(log["fields"]["name"], f"{NODE}_package_1_build.report")
            # The ring guards the new version.
            os.kill(flight.node_pid(NODE), signal.SIGKILL)
            wait_until(lambda: self.versions(flight)["running"] == 0 and self.active(flight), DEADLINE_S, "the last good version runs")
            # The same package again does not count as old; an older one does.
            again, since = self.install(ground, flight, self.folder / "1.pkg", "activate=false")
            self.assertEqual(again["stage"], "completed")
            self.assertEqual(self.end(ground, since)["event"], "update.candidate")


class BadPackageTest(UpdateTest):
    def test_what_is_bad_is_refused_or_rolled_back_with_its_reason_and_the_node_works_on(self):
        with self.flight() as flight:
            ground = flight.ground()
            pid = flight.node_pid(NODE)
            good = self.package(GOOD)

            tampered = self.folder / "tampered.pkg"
            octets = bytearray(good.read_bytes())
            octets[-1] ^= 1
            tampered.write_bytes(octets)
            subprocess.run([BIN / "srfs-ground", "package", "keygen", self.folder / "other.seed", self.folder / "other.pub"], check=True, timeout=60)
            foreign = self.package(GOOD, self.folder / "other.seed")
            for package, reason in ((tampered, "signed"), (foreign, "key")):
                outcome, since = self.install(ground, flight, package)
                self.assertEqual((outcome["stage"], outcome["name"]), ("failed", "package_refused"), package)
                self.assertIn(reason, self.end(ground, since)["fields"]["reason"])
            outcome = ground.command("tc package.install file=../keys/package.pub", DEADLINE_S)
            self.assertEqual((outcome["stage"], outcome["name"]), ("failed", "package_not_found"))
            self.assertEqual(ground.command("tc package.cancel", DEADLINE_S)["name"], "no_update")

            outcome, since = self.install(ground, flight, self.package(GOOD + "\nthis is no C++;\n"))
            self.assertEqual(outcome["stage"], "completed")
            end = self.end(ground, since)
            self.assertEqual((end["event"], end["fields"]["step"]), ("update.failed", "build"), end)
            outcome, since = self.install(ground, flight, good)  # its counter is below the last one used
            self.assertEqual(outcome["name"], "package_refused")

            outcome, since = self.install(ground, flight, self.package(FAILS_ITS_TEST))
            end = self.end(ground, since)
            self.assertEqual((end["event"], end["fields"]["step"]), ("update.failed", "self_test"), end)
            self.assertEqual(flight.node_pid(NODE), pid, "the node was not touched")

            order = flight.var / "state" / NODE / "die"
            outcome, since = self.install(ground, flight, self.package(DIES.replace("FILE", str(order))))
            self.assertEqual(self.end(ground, since)["event"], "update.installed")
            order.touch()
            wait_until(lambda: self.versions(flight)["running"] == 0 and self.active(flight), DEADLINE_S, "rolled back")
            self.assertEqual(self.versions(flight)["versions"][-1]["state"], "failed")
            self.assertFalse((flight.var / "update" / "job").exists(), "nothing is left of it")


class NewNodeUpdateTest(UpdateTest):
    def joined(self, flight, added):
        """Uploads the node of examples/ADDED as sources and waits until it joins. Returns a session that knows its dictionary fragment."""
        ground = flight.ground()
        package = self.folder / "new.pkg"
        made = subprocess.run([str(BIN / "srfs-ground"), "package", "make", "--manifest", str(ROOT / "examples" / added / "package.yaml"),
                               "--key", str(self.var / "ground" / "package_test.seed"), "-o", str(package)],
                              stdin=subprocess.DEVNULL, capture_output=True, text=True, timeout=60)  # fmt: skip
        self.assertEqual(made.returncode, 0, made.stderr)
        before = {n["name"]: n["pid"] for n in flight.status()}
        outcome, since = self.install(ground, flight, package)
        self.assertEqual(outcome["stage"], "completed", outcome)
        end = self.end(ground, since)
        self.assertEqual((end["event"], end["fields"]["node"]), ("update.installed", added), end)
        wait_until(lambda: self.active(flight, added), DEADLINE_S, "the new node is Active")
        self.assertEqual({n["name"]: n["pid"] for n in flight.status() if n["name"] != added}, before, "nobody else was restarted")
        ground.end()
        return flight.ground()


class NewNodeTest(NewNodeUpdateTest):
    """The worked example: the impact payload is uploaded as sources."""

    def test_a_package_of_kind_new_joins_the_suite_and_a_telecommand_removes_it(self):
        added = "payload_impact"
        with self.flight("sim") as flight:
            ground = self.joined(flight, added)
            self.assertIsNotNone(ground.housekeeping(added, DEADLINE_S), "its telemetry decodes on the ground")
            self.assertTrue(ground.command("tc impact.set_threshold threshold_v=0.5")["success"])

            self.assertTrue(ground.command(f"arm node.remove node={added}", DEADLINE_S)["success"])
            self.complete(ground, f"tc node.remove node={added}")
            wait_until(lambda: added not in {n["name"] for n in flight.status()}, DEADLINE_S, "it is gone")
            self.assertFalse((flight.var / "versions" / added).exists())


class NewImageMethodTest(NewNodeUpdateTest):
    """A method of image processing as a node of its own."""

    def test_a_method_that_came_up_as_sources_measures_the_frames_of_the_camera(self):
        added = "image_straylight"
        with self.flight("sim") as flight:
            ground = self.joined(flight, added)
            self.assertIsNotNone(ground.housekeeping(added, DEADLINE_S), "ttc knows its fragment")
            outcome = ground.command(f"tc parameters.set parameter={added}.sky_limit_adu value=1", DEADLINE_S)
            self.assertEqual(outcome["stage"], "completed", outcome)
            since = ground.position()
            outcome = ground.command("tc image.capture task=1 frames=2 exposure_us=100000 interval_ms=300", 120)
            self.assertEqual(outcome["stage"], "completed", outcome)
            event = ground.wait_for(lambda m: m["type"] == "event" and m["event"] == "straylight.bright_sky", DEADLINE_S, since)
            self.assertIsNotNone(event, "any sky is above one unit")
            self.assertEqual(event["fields"]["frame"], "0000000001/0001")
            told = ground.housekeeping(added, DEADLINE_S, since, lambda fields: fields["frames"] == 2)
            self.assertIsNotNone(told, "both frames were measured")
            self.assertGreater(told["fields"]["sky_adu"], 1)


class OpenCvMethodTest(NewNodeUpdateTest):
    """A method that is written in OpenCV."""

    def test_a_method_in_opencv_comes_up_as_sources_and_compares_the_frames_of_the_camera(self):
        added = "image_motion"
        with self.flight("sim") as flight:
            ground = self.joined(flight, added)
            self.assertIsNotNone(ground.housekeeping(added, DEADLINE_S), "ttc knows its fragment")
            since = ground.position()
            outcome = ground.command("tc image.capture task=1 frames=4 exposure_us=100000 interval_ms=300", 120)
            self.assertEqual(outcome["stage"], "completed", outcome)
            told = ground.housekeeping(added, DEADLINE_S, since, lambda fields: fields["frames"] == 4)
            self.assertIsNotNone(told, "all frames were measured")
            self.assertEqual(told["fields"]["frames_compared"], 3, "they show the same stars")
            pid = flight.node_pid(added)
            print("memory of the node, MB:", sum(int(line.split()[1]) for line in open(f"/proc/{pid}/smaps_rollup") if line.startswith("Pss:")) / 1000)
            idle = flight.node_pid("image_processing")
            with open(f"/proc/{idle}/maps") as maps:
                self.assertNotIn("opencv", maps.read(), "nobody else loads it")


class KilledMaintenanceTest(UpdateTest):
    def test_an_update_goes_on_when_maintenance_is_killed_in_the_build_and_in_the_swap(self):
        # Here the ring includes all nodes, so that it restarts maintenance.
        with self.flight(self.deployment(("  members: [payload_adcs, payload_thermal, payload_eps]\n", ""), base="fig16")) as flight:
            ground = flight.ground()
            outcome, since = self.install(ground, flight, self.package(GOOD))
            self.assertEqual(outcome["stage"], "completed")

            def step(name):
                return ground.wait_for(lambda m: m["type"] == "event" and m["event"] == "update.step" and m["fields"]["step"] == name, BUILD_DEADLINE_S, since)

            self.assertIsNotNone(step("build"))
            os.kill(flight.node_pid("maintenance"), signal.SIGKILL)
            self.assertIsNotNone(step("swap"))
            os.kill(flight.node_pid("maintenance"), signal.SIGKILL)  # during the swap or shortly after it
            wait_until(lambda: flight.node_pid("maintenance") and self.active(flight, "maintenance"), DEADLINE_S, "maintenance is back")
            wait_until(lambda: self.versions(flight)["running"] == 1 and self.active(flight), BUILD_DEADLINE_S, "version 1 runs")
            self.assertEqual(len(self.versions(flight)["versions"]), 1)


if __name__ == "__main__":
    unittest.main()
