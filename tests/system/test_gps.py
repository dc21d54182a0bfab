# SPDX-FileCopyrightText: 2026 SRFS contributors
# SPDX-License-Identifier: Apache-2.0
"""The suite's reaction to a GPS receiver that is lost, reports wrong data, is disturbed or unplugged."""

import unittest

from support import DEADLINE_S, SystemTest


class GpsTest(SystemTest):
    def timing(self, ground, matches, what, since=0):
        message = ground.housekeeping("timing", DEADLINE_S, matches=matches, since=since)
        self.assertIsNotNone(message, what)
        return message["fields"]

    def test_the_time_goes_on_whatever_the_receiver_does(self):
        with self.flight(self.deployment()) as flight:
            ground = flight.ground()
            ground.command("tc housekeeping.set_interval structure=timing interval_ms=500", DEADLINE_S)
            locked = self.timing(ground, lambda f: f["sync_state"] == "locked" and f["time_valid"], "locked with valid time")
            self.assertLess(locked["estimated_error_us"], 1e9)

            with self.subTest("lost: holdover, and the watchdog is fed"):
                since = ground.position()
                flight.control({"gps": "off"})
                self.wait_for_event(ground, "timing.holdover", since)
                lost = self.timing(ground, lambda f: f["sync_state"] == "holdover", "holdover", since)
                later = self.timing(
                    ground,
                    lambda f: f["watchdog_feeds"] >= lost["watchdog_feeds"] + 3 and f["ticks"] > lost["ticks"],
                    "fed and ticking in holdover", since,
                )  # fmt: skip
                self.assertTrue(later["time_valid"])
                self.assertEqual(later["sync_state"], "holdover")
                self.assertGreater(later["estimated_error_us"], lost["estimated_error_us"], "the error grows in holdover")
                since = ground.position()
                flight.control({"gps": "none"})
                self.timing(ground, lambda f: f["sync_state"] == "locked", "locked again", since)

            with self.subTest("a wrong fix is refused"):
                since = ground.position()
                flight.control({"gps": {"time_step_s": 100}})
                self.assertEqual(self.wait_for_event(ground, "timing.time_jump_refused", since)["fields"]["difference_s"], 100)
                refused = self.timing(ground, lambda f: f["time_jumps_refused"] > 0, "counted", since)
                self.assertEqual(refused["times_set"], locked["times_set"])

            with self.subTest("a rollover of the week is put right"):
                since = ground.position()
                flight.control({"gps": {"week_eras": -1}})
                rolled = self.timing(ground, lambda f: f["week_rollovers"] > 0, "counted", since)
                self.assertEqual(rolled["times_set"], locked["times_set"])

            with self.subTest("false pulses are outliers"):
                since = ground.position()
                flight.control({"gps": {"second_receiver_ms": 300}})
                self.timing(ground, lambda f: f["pulse_outliers"] > rolled["pulse_outliers"] + 2, "counted", since)

            with self.subTest("the serial line vanishes and returns"):
                before = ground.fresh("timing", DEADLINE_S)
                flight.control({"gps": {"unplugged": True}})
                since = ground.position()
                self.timing(ground, lambda f: f["ticks"] > before["ticks"] + 20, "ticks without the line", since)
                flight.control({"gps": "none"})
                back = self.timing(ground, lambda f: f["gps_line_reopened"] > before["gps_line_reopened"], "opened again", since)
                self.timing(ground, lambda f: f["sentences_seen"] > back["sentences_seen"] + 2, "sentences again", since)
            self.assertEqual(ground.fresh("timing", DEADLINE_S)["phase_adoptions"], locked["phase_adoptions"])
            self.complete(ground, "ping --timeout 20")


if __name__ == "__main__":
    unittest.main()
