# SPDX-FileCopyrightText: 2026 SRFS contributors
# SPDX-License-Identifier: Apache-2.0
"""Frames of the simulated sky: taken at the commanded time and stored, also when the camera misbehaves."""

import json
import math
import subprocess
import unittest

from support import BIN, DEADLINE_S, SystemTest

CAMERA = """  camera: { width: 960, height: 540, field_deg: 12, pointing: { ra_deg: 100, dec_deg: 40, roll_deg: 20 }, debris: { magnitude: 2, rate_deg_s: 3 }, switched: true }
  watchdog:"""

CAMERA_ABSENT, CAMERA_FAILED, BAD_SETTING = 110, 111, 120


class CaptureTest(SystemTest):
    def capture(self, task, *options):
        run = subprocess.run([BIN / "capture_client", self.var, str(task), *options], stdin=subprocess.DEVNULL, capture_output=True, text=True, timeout=120)
        self.assertEqual(run.returncode, 0, run.stderr)
        return json.loads(run.stdout)

    def detect(self, method, *files):
        paths = [self.var / "images" / f for f in files]
        run = subprocess.run([BIN / "srfs-detect", "--method", method, "--json", *paths], stdin=subprocess.DEVNULL, capture_output=True, text=True, timeout=120)
        self.assertEqual(run.returncode, 0, run.stderr)
        return json.loads(run.stdout)

    def wait_for_telemetry(self, ground, matches, what):
        self.assertIsNotNone(ground.housekeeping("image_acquisition", DEADLINE_S, matches=matches), what)

    def check_power(self, ground):
        failed = self.capture(16)
        self.assertEqual((failed["state"], failed["failure_code"]), ("aborted", CAMERA_ABSENT), failed)
        since = ground.position()
        ground.command("tc eps.switch_load load=2 state=on --wait", DEADLINE_S)
        self.assertTrue(ground.wait_for(lambda m: m.get("event") == "image.camera_ready", DEADLINE_S, since))

    def check_time(self):
        result = self.capture(17, "--frames", "3", "--interval-ms", "400", "--start-in-ms", "3000", "--exposure-us", "100000")
        self.assertEqual((result["state"], result["failure_code"]), ("succeeded", 0), result)
        self.assertEqual(result["files"], [f"frames/0000000017/000{n}.fits" for n in (1, 2, 3)])
        # Never before; how late is a matter of the CPU that the image lane gets.
        self.assertGreater(result["start_error_us"], -1000, result)
        self.assertLess(result["start_error_us"], 3_000_000, result)
        for file in result["files"]:
            self.assertTrue((self.var / "images" / file).is_file())
        return result["files"]

    def check_stars(self, flight, file):
        truth = flight.control({"query": "camera"})["camera"]
        stars = self.detect("star_centroid", file)["stars"]
        inside = [t for t in truth["stars"][3:15] if 10 < t["x"] < 949 and 10 < t["y"] < 529]
        self.assertGreater(len(inside), 3)
        for t in inside:
            self.assertTrue(any(math.hypot(s["x"] - t["x"], s["y"] - t["y"]) < 1 for s in stars), t)
        solution = self.detect("plate_solve", file)["solution"]
        self.assertAlmostEqual(solution["ra_deg"], truth["ra_deg"], delta=0.01)
        self.assertAlmostEqual(solution["dec_deg"], truth["dec_deg"], delta=0.01)
        self.assertAlmostEqual(solution["roll_deg"], truth["roll_deg"], delta=0.1)
        self.assertFalse(solution["mirrored"])

    def check_streak(self, flight):
        flight.control({"camera": {"pass": True}})
        result = self.capture(18, "--exposure-us", "500000")
        truth = flight.control({"query": "camera"})["camera"]["streaks"]
        self.assertEqual(len(truth), 1)
        found = self.detect("streak", *result["files"])["streaks"]
        ends = [(truth[0]["x1"], truth[0]["y1"]), (truth[0]["x2"], truth[0]["y2"])]

        def distance(s):
            direct = max(math.dist((s["x1"], s["y1"]), ends[0]), math.dist((s["x2"], s["y2"]), ends[1]))
            return min(direct, max(math.dist((s["x1"], s["y1"]), ends[1]), math.dist((s["x2"], s["y2"]), ends[0])))

        self.assertTrue(found)
        self.assertLess(min(distance(s) for s in found), 4)

    def check_bad_frames(self, flight, ground):
        for fault in ("short", "torn", "repeated"):
            flight.control({"camera": {"fault": fault, "frames": 1}})
            self.assertEqual(self.capture(19, "--frames", "2")["state"], "succeeded", fault)
        self.wait_for_telemetry(ground, lambda f: f["frames_lost"] >= 3, "three frames lost")
        flight.control({"camera": {"fault": "torn", "frames": 3}})
        failed = self.capture(20, "--frames", "2")
        self.assertEqual((failed["state"], failed["failure_code"]), ("aborted", CAMERA_FAILED), failed)
        self.assertIn("torn", failed["reason"])

    def check_unplugged(self, flight, ground):
        since = ground.position()
        flight.control({"camera": {"fault": "absent"}})
        failed = self.capture(21)
        self.assertEqual((failed["state"], failed["failure_code"]), ("aborted", CAMERA_ABSENT), failed)
        self.assertTrue(ground.wait_for(lambda m: m.get("event") == "image.camera_lost", DEADLINE_S, since))
        flight.control({"camera": {"fault": "none"}})
        self.assertTrue(ground.wait_for(lambda m: m.get("event") == "image.camera_ready", DEADLINE_S, since))
        self.assertEqual(self.capture(21)["state"], "succeeded")

    def check_refusals(self):
        self.assertEqual(self.capture(22, "--frames", "0")["state"], "aborted")
        self.assertEqual(self.capture(22, "--gain-db", "55")["failure_code"], BAD_SETTING)

    def check_cancelling(self):
        waiting = self.capture(23, "--start-in-ms", "600000", "--cancel-after", "0")
        self.assertEqual((waiting["state"], waiting["files"]), ("canceled", []))
        partly = self.capture(24, "--frames", "50", "--interval-ms", "300", "--cancel-after", "2")
        self.assertEqual(partly["state"], "canceled")
        self.assertGreaterEqual(len(partly["files"]), 2)

    def check_store(self, ground):
        stored = len(list((self.var / "images").rglob("*.fits")))
        self.wait_for_telemetry(ground, lambda f: f["store_frames"] == stored and f["camera_state"] == "ready", f"{stored} frames")

    def test_frames_are_taken_at_their_time_and_show_the_sky(self):
        with self.flight(self.deployment(("  watchdog: { timeout", CAMERA + " { timeout"))) as flight:
            ground = flight.ground()
            ground.command("tc housekeeping.set_interval structure=image_acquisition interval_ms=500", DEADLINE_S)
            with self.subTest("without power there is no camera"):
                self.check_power(ground)
            with self.subTest("at the commanded time"):
                files = self.check_time()
            with self.subTest("the stars are where the truth says"):
                self.check_stars(flight, files[-1])
            with self.subTest("debris leaves its streak"):
                self.check_streak(flight)
            with self.subTest("bad frames are taken again, and counted"):
                self.check_bad_frames(flight, ground)
            with self.subTest("an unplugged camera is said, and used again when it is back"):
                self.check_unplugged(flight, ground)
            with self.subTest("what cannot be is refused with its reason"):
                self.check_refusals()
            with self.subTest("a task that waits, or exposes, is cancelled"):
                self.check_cancelling()
            with self.subTest("the store is counted"):
                self.check_store(ground)


if __name__ == "__main__":
    unittest.main()
