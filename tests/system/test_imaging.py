# SPDX-FileCopyrightText: 2026 SRFS contributors
# SPDX-License-Identifier: Apache-2.0
"""Imaging tasks with the real processes: from the telecommand to files on the ground, cancelled, at a commanded time, and with a killed node."""

import datetime
import itertools
import json
import os
import re
import signal
import subprocess
import unittest

from support import BIN, DEADLINE_S, SystemTest

from srfs.flight.processes import wait_until

TASK_S = 120  # for a small task, on a machine under load
ABORTED, NO_USABLE_FRAME, IMAGING_LOST = 39, 119, 121
CAPTURED, PROCESSING, QUARTER_PROCESSED = 100, 101, 125
CAPTURE = {"exposure_us": 100000, "interval_ms": 300}
WARM_CAMERA = """  camera: { width: 640, height: 480, field_deg: 9, fwhm_px: 1.4, pointing: { ra_deg: 100, dec_deg: 40, roll_deg: 20 }, warm_share: 0.1, warm_e_s: 900 }
  watchdog:"""


class ImagingTest(SystemTest):
    def setUp(self):
        super().setUp()
        self.numbers = itertools.count(1)

    def send(self, ground, command, at=None, **arguments):
        """Sends image.COMMAND. @return its line and its task number"""
        task = arguments.pop("task", None) or next(self.numbers)
        settings = {**(CAPTURE if command == "capture" else {}), **arguments}
        words = " ".join(f"{name}={value}" for name, value in settings.items())
        tag = f"--at {at}" if at else ""
        return ground.send(f"tc image.{command} task={task} {words} {tag}"), task

    def wait_for_step(self, ground, line, step):
        """Waits for progress of at least that step, while the telecommand is under way."""
        came = ground.wait_for(lambda m: m["type"] == "tc_stage" and m["line"] == line and (m["final"] or m.get("step", 0) >= step), TASK_S)
        self.assertIsNotNone(came, f"line {line}: no step {step}")
        self.assertFalse(came["final"], came)

    def assert_completes(self, ground, line):
        """Waits for the completion of the telecommand itself, not of the request that schedules it."""
        outcome = ground.wait_for(lambda m: m.get("line") == line and (m["type"] == "error" or m.get("final") and not m.get("insertion")), TASK_S)
        self.assertEqual(outcome and outcome.get("stage"), "completed", outcome)

    def assert_fails(self, ground, line, code):
        outcome = ground.outcome(line, TASK_S)
        self.assertIsNotNone(outcome, f"line {line} has no end")
        self.assertEqual((outcome.get("stage"), outcome.get("code")), ("failed", code), outcome)

    def frames(self, flight, task):
        return sorted((flight.var / "images/frames" / f"{task:010}").glob("*.fits"))

    def on_the_ground(self, flight, task, name):
        """Waits until the whole file has arrived. Returns its path."""
        def found():
            return [f for f in (flight.var / "ground/files").glob(f"image_*_{task:010}_{name}") if not f.name.startswith(".")]  # fmt: skip
        wait_until(found, TASK_S, f"{name} of task {task} on the ground")
        return found()[0]


class ImagingTaskTest(ImagingTest):
    def test_a_task_goes_from_a_telecommand_to_files_on_the_ground(self):
        with self.flight() as flight:
            ground = flight.ground()
            line, task = self.send(ground, "capture", frames=3, method="streak", budget_octets=65536)
            self.assert_completes(ground, line)
            steps = [m["step"] for m in ground.select(lambda m: m["type"] == "tc_stage" and m["line"] == line and m["stage"] == "progress")]
            self.assertEqual(steps, sorted(steps))
            self.assertLessEqual({1, CAPTURED, PROCESSING, 200}, set(steps))
            self.assertEqual([f.name for f in self.frames(flight, task)], ["0001.fits", "0002.fits", "0003.fits"])

            findings = self.on_the_ground(flight, task, "findings.json")
            self.assertEqual(len(json.loads(findings.read_text())["frames"]), 3)
            self.assertTrue(findings.name.startswith("image_001_"), "the most important product")
            self.assertEqual(self.on_the_ground(flight, task, "thumbnail.png").read_bytes()[:8], b"\x89PNG\r\n\x1a\n")
            products = flight.var / "images/products" / f"{task:010}"
            self.assertEqual(findings.read_bytes(), (products / "findings.json").read_bytes())
            octets = sum(f.stat().st_size for f in (flight.var / "ground/files").glob(f"image_*_{task:010}_*"))
            self.assertLessEqual(octets, 65536)
            wait_until(lambda: all(f.with_suffix(".sent").exists() for f in self.frames(flight, task)), TASK_S, "the frames are marked as sent")

            # Process the same frames by another method, and send one whole frame.
            self.assert_completes(ground, self.send(ground, "process", task=task, method="star_centroid")[0])
            self.assert_completes(ground, self.send(ground, "send_frame", task=task, frame=2)[0])
            strips = lambda: list((flight.var / "ground/files").glob(f"strip_*_{task:010}_0002_*"))  # noqa: E731
            wait_until(strips, TASK_S, "the frame on the ground")
            whole = subprocess.run([str(BIN / "srfs-product"), str(strips()[0]), "--out", str(self.folder / "frame.fits")],
                                   stdin=subprocess.DEVNULL, capture_output=True, text=True, timeout=TASK_S)  # fmt: skip
            self.assertEqual(whole.returncode, 0, whole.stdout + whole.stderr)

    def findings(self, flight, ground, command, **arguments):
        """A task that completes. @return what it found"""
        line, task = self.send(ground, command, **arguments)
        self.assert_completes(ground, line)
        return json.loads((flight.var / "images/products" / f"{task:010}" / "findings.json").read_text())

    def test_a_dark_made_in_orbit_takes_the_detectors_pattern_out_of_later_frames(self):
        with self.flight(self.deployment(("  watchdog: { timeout", WARM_CAMERA + " { timeout"))) as flight:
            ground = flight.ground()
            flight.control({"camera": {"covered": True}})
            made = self.findings(flight, ground, "capture", frames=5, method="calibrate")["master"]
            self.assertEqual((made["kind"], made["generation"], made["frames"], made["exposure"]), ("dark", 1, 5, 0.1), made)
            self.assertTrue((flight.var / "images/calibration/dark_0001.master").is_file())

            flight.control({"camera": {"covered": False}})
            task = next(self.numbers)
            with_dark = self.findings(flight, ground, "capture", task=task, frames=1, method="star_centroid")
            truth = flight.control({"query": "camera"})["camera"]
            without = self.findings(flight, ground, "process", task=task, method="star_centroid", parameters="calibrated=0")
            self.assertEqual((with_dark["calibration"], with_dark["frames"][0]["dark"]), ([made], 1))
            self.assertEqual(without["calibration"], [])
            found, found_without = with_dark["frames"][0]["stars"], without["frames"][0]["stars"]
            self.assertLess(10, found)
            self.assertLess(found, 1.1 * truth["star_count"] + 3)
            self.assertGreater(found_without, 1.3 * found, "warm pixels look like stars")

            # Of another exposure there is no dark: neither a frame nor a flat uses this one.
            longer = self.findings(flight, ground, "capture", frames=1, method="star_centroid", exposure_us=200000)
            self.assertIn("no dark fits 640 x 480 px, 0.2 s", str(longer["frames"][0]["notes"]))
            flat, _ = self.send(ground, "capture", frames=3, method="calibrate", parameters="kind=1", exposure_us=200000)
            self.assert_fails(ground, flat, NO_USABLE_FRAME)

    def test_a_cancelled_task_stops_and_the_next_one_works(self):
        with self.flight() as flight:
            ground = flight.ground()
            running, first = self.send(ground, "capture", frames=200, method="streak")
            waiting, second = self.send(ground, "capture", frames=1, method="streak")
            wait_until(lambda: len(self.frames(flight, first)) >= 2, TASK_S, "two frames")
            self.assert_completes(ground, self.send(ground, "cancel", task=second)[0])
            self.assert_fails(ground, waiting, ABORTED)
            self.assert_completes(ground, self.send(ground, "cancel", task=first)[0])
            self.assert_fails(ground, running, ABORTED)
            self.assertLess(len(self.frames(flight, first)), 200)
            self.assertEqual(self.frames(flight, second), [])
            line, _ = self.send(ground, "capture", frames=1, method="")
            self.assert_completes(ground, line)

    def test_a_capture_begins_at_its_time_by_its_argument_and_by_the_schedule(self):
        with self.flight() as flight:
            ground = flight.ground()
            start = datetime.datetime.now(datetime.timezone.utc).replace(microsecond=0) + datetime.timedelta(seconds=20)
            timed, task = self.send(ground, "capture", frames=1, method="", start=start.strftime("%Y-%m-%dT%H:%M:%SZ"))
            scheduled, other = self.send(ground, "capture", at="+5s", frames=1, method="")
            at_once, third = self.send(ground, "capture", frames=1, method="")
            self.assert_completes(ground, at_once)
            self.assertEqual(self.frames(flight, task), [], "its time has not come")
            self.assert_completes(ground, scheduled)
            self.assertEqual(len(self.frames(flight, other)), 1)
            self.assert_completes(ground, timed)
            (frame,) = self.frames(flight, task)
            begin = re.search(rb"DATE-OBS= *'([0-9T:.\-]+)", frame.read_bytes()).group(1).decode()
            late_s = (datetime.datetime.fromisoformat(begin[:26]).replace(tzinfo=datetime.timezone.utc) - start).total_seconds()
            self.assertLess(abs(late_s), 0.5, begin)


class KilledImagingTest(ImagingTest):
    def test_a_killed_image_processing_loses_its_task_and_no_other(self):
        with self.flight() as flight:
            ground = flight.ground()
            lost, _ = self.send(ground, "capture", frames=24, method="streak")
            self.wait_for_step(ground, lost, QUARTER_PROCESSED)
            # The second task captures while the first is processed.
            other, _ = self.send(ground, "capture", frames=10, method="streak")
            pid = flight.node_pid("image_processing")
            os.kill(pid, signal.SIGKILL)
            self.assert_fails(ground, lost, IMAGING_LOST)
            wait_until(lambda: flight.node_pid("image_processing") not in (None, pid), DEADLINE_S, "the ring has started it again")
            self.assert_completes(ground, other)
            said = ground.wait_for(lambda m: m["type"] == "event" and m["event"] == "image.task_failed", DEADLINE_S)
            self.assertIsNotNone(said)

    def test_a_killed_image_acquisition_loses_its_task_and_the_next_one_works(self):
        with self.flight() as flight:
            ground = flight.ground()
            lost, task = self.send(ground, "capture", frames=100, method="streak")
            wait_until(lambda: len(self.frames(flight, task)) >= 3, TASK_S, "three frames")
            pid = flight.node_pid("image_acquisition")
            os.kill(pid, signal.SIGKILL)
            self.assert_fails(ground, lost, IMAGING_LOST)
            wait_until(lambda: flight.node_pid("image_acquisition") not in (None, pid), DEADLINE_S, "the ring has started it again")
            self.assert_completes(ground, self.send(ground, "capture", frames=1, method="streak")[0])
            # Frames stored before are not lost.
            self.assert_completes(ground, self.send(ground, "process", task=task, method="streak")[0])


if __name__ == "__main__":
    unittest.main()
