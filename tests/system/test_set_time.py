# SPDX-FileCopyrightText: 2026 SRFS contributors
# SPDX-License-Identifier: Apache-2.0
"""Setting the time by telecommand without GPS."""

import datetime
import unittest

from support import DEADLINE_S, SystemTest, kill

HOUR = datetime.timedelta(hours=1)
TOLERANCE_S = 60  # between the clocks of host and mission on a machine under load; the steps here are an hour


def from_now(by=datetime.timedelta()):
    return (datetime.datetime.now(datetime.timezone.utc) + by).strftime("%Y-%m-%dT%H:%M:%S.%fZ")


def seconds_from_now(utc):
    return (datetime.datetime.fromisoformat(utc) - datetime.datetime.now(datetime.timezone.utc)).total_seconds()


class SetTimeTest(SystemTest):
    def timing(self, ground, matches=lambda fields: True):
        packet = ground.housekeeping("timing", 3 * DEADLINE_S, matches=matches)
        self.assertIsNotNone(packet, "no structure timing")
        return packet["fields"]

    def test_a_small_difference_is_taken_over_a_large_one_only_by_the_armed_telecommand_and_it_survives_a_death(self):
        with self.flight() as flight:
            ground = flight.ground()
            self.timing(ground, lambda f: f["time_valid"])
            flight.control({"gps": "off"})

            taken = ground.command(f"tc timing.set_time utc={from_now()} accuracy_ms=500", DEADLINE_S)
            self.assertEqual(taken.get("stage"), "completed", taken)
            self.assertLess(abs(seconds_from_now(self.timing(ground, lambda f: f["times_commanded"] == 1)["utc"])), TOLERANCE_S)

            refused = ground.command(f"tc timing.set_time utc={from_now(HOUR)}", DEADLINE_S)
            self.assertEqual((refused.get("stage"), refused.get("name")), ("failed", "time_jump_refused"), refused)
            step = f"timing.step_time utc={from_now(HOUR)} accuracy_ms=2000"
            refused = ground.command(f"tc {step}", DEADLINE_S)
            self.assertEqual(refused.get("name"), "not_armed", refused)
            self.assertLess(seconds_from_now(self.timing(ground)["utc"]), TOLERANCE_S)

            self.complete(ground, f"arm {step}")
            self.complete(ground, f"tc {step}")
            stepped = self.timing(ground, lambda f: f["times_commanded"] == 2)
            self.assertLess(abs(seconds_from_now(stepped["utc"]) - 3600), TOLERANCE_S)
            self.assertTrue(stepped["time_valid"])

            kill(flight, "timing")
            after = self.timing(ground, lambda f: f["times_commanded"] == 0)
            self.assertLess(abs(seconds_from_now(after["utc"]) - 3600), TOLERANCE_S)
            self.assertTrue(after["time_valid"])
            self.assertIsNotNone(ground.wait_for(lambda m: m["type"] == "event" and m["event"] == "timing.time_set", DEADLINE_S))


if __name__ == "__main__":
    unittest.main()
