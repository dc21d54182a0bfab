# SPDX-FileCopyrightText: 2026 SRFS contributors
# SPDX-License-Identifier: Apache-2.0
"""Time-tagged telecommands with the real processes: released at their time, executed once even if ttc dies, listed, moved and deleted."""

import os
import random
import threading
import unittest

from support import DEADLINE_S, kill, wait_for_slots
from test_once import ARGUMENTS, PERIPHERALS, OnceTest

from srfs.flight.processes import wait_until

PATIENCE_S = 120  # from the release on: the ring waits longer after each death
LATE_MAX_MS = 600000  # a telecommand due while ttc is dead is released when ttc is back, however long that takes here
KILLS = int(os.environ.get("SRFS_SCHEDULE_KILLS", "5"))


class ScheduleTest(OnceTest):
    def patient_deployment(self):
        return self.deployment(("parameters: { initial_mode: nominal }", f"parameters: {{ initial_mode: nominal, schedule_late_max_ms: {LATE_MAX_MS} }}"))

    def own_stages(self, ground, line):
        """Stages of the telecommand itself, without those of the request that schedules it."""
        return [m for m in self.stages(ground, line) if not m.get("insertion")]

    def own(self, ground, line):
        return [m["stage"] for m in self.own_stages(ground, line)]

    def wait_for_stage(self, ground, line, stage, deadline_s):
        """Waits for a stage of the telecommand itself; a failed insertion ends the wait too."""
        wait_until(lambda: stage in self.own(ground, line) or any(m["final"] and not m["success"] for m in self.stages(ground, line)),
                   deadline_s, f"line {line} is {stage}: {self.stages(ground, line)}")  # fmt: skip
        self.assertIn(stage, self.own(ground, line), self.stages(ground, line))

    def schedule_at(self, ground, number, at):
        peripheral = tuple(PERIPHERALS)[number % len(PERIPHERALS)]
        text = PERIPHERALS[peripheral].format(ARGUMENTS[peripheral][number // len(PERIPHERALS) % 2])
        return ground.send(f"tc {text} --at {at} --timeout {PATIENCE_S}")

    def listed(self, ground):
        """(release, apid, sequence) of the activities on board."""
        since = ground.position()
        outcome = ground.command("tc schedule.summary_all", DEADLINE_S)
        self.assertEqual(outcome and outcome.get("stage"), "completed", outcome)
        report = ground.wait_for(lambda m: m["type"] == "schedule" and m["report"] == "summary", DEADLINE_S, since)
        return [(a["release"], a["apid"], a["sequence"]) for a in report["activities"]]

    def judge_executions(self, flight, recorder, count, kills=0):
        """Each of the @p count telecommands is executed once."""
        found = {peripheral: self.executed(flight, peripheral) for peripheral in PERIPHERALS}
        self.assertEqual(sum(f["count"] for f in found.values()), count, found)
        # A ttc that has just started orders before the recorder knows it; the payload's reports name these.
        published = {m["id"] & 0xFFFFFFFF: m["node"] for m in recorder.select(lambda m: m["type"] == "report" and m["node"].startswith("payload_"))}
        ordered = {m["id"] & 0xFFFFFFFF: m["target"] for m in recorder.select(lambda m: m["type"] == "telecommand")}
        self.assertLessEqual(len({number for f in found.values() for number in f["last"]} - set(ordered)), kills, "one for each ttc")
        published |= ordered
        for peripheral, f in found.items():
            self.assertEqual(len(set(f["last"])), len(f["last"]), f"executed twice at {peripheral}")
            self.assertLessEqual({published[number] for number in f["last"]}, {f"payload_{peripheral}"})


class TimeTaggedTest(ScheduleTest):
    def test_they_are_released_at_their_time_and_what_is_moved_or_deleted_before_is_not(self):
        with self.flight(self.patient_deployment()) as flight:
            recorder, ground = flight.recorder(), flight.ground()
            wait_for_slots(recorder, "payload_eps", "released", 2, 0)
            far = [self.schedule_at(ground, n, "+10min") for n in range(3)]
            for line in far:
                self.wait_for_stage(ground, line, "scheduled", DEADLINE_S)
            listed = self.listed(ground)
            self.assertEqual(sorted(apid for _, apid, _ in listed), [16, 17, 18])
            self.assertEqual(listed, sorted(listed))

            # One is deleted and one is moved. One that is scheduled later is due first.
            self.complete(ground, f"tc schedule.delete request_apid=16 request_sequence={listed[0][2]}")
            sequence = {apid: count for _, apid, count in listed}
            self.complete(ground, f"tc schedule.shift request_apid=18 request_sequence={sequence[18]} offset_s=3600")
            self.assertEqual([apid for _, apid, _ in self.listed(ground)], [17, 18])
            soon = self.schedule_at(ground, 1, "+8s")
            self.wait_for_stage(ground, soon, "completed", DEADLINE_S + PATIENCE_S)
            self.judge_executions(flight, recorder, 1)

            refused = ground.command(f"tc schedule.shift request_apid=17 request_sequence={sequence[17]} offset_s=-3600", DEADLINE_S)
            self.assertEqual((refused["stage"], refused["name"]), ("start_failed", "release_time_past"))
            self.complete(ground, "tc schedule.reset")
            self.assertEqual(self.listed(ground), [])
            self.judge_executions(flight, recorder, 1)


class KilledAroundTheReleaseTest(ScheduleTest):
    def test_however_often_ttc_is_killed_each_is_executed_once_and_its_end_is_told(self):
        seed = random.randrange(1 << 32)
        print(f"seed {seed}")
        chance = random.Random(seed)
        with self.flight(self.patient_deployment()) as flight:
            recorder, ground = flight.recorder(), flight.ground()
            wait_for_slots(recorder, "payload_eps", "released", 2, 0)
            lines = [self.schedule_at(ground, n, f"+{10 + 1.2 * n:.1f}s") for n in range(12)]
            for line in lines:
                self.wait_for_stage(ground, line, "scheduled", DEADLINE_S)
            for _ in range(KILLS):
                # Kills before, at and after a release, and while ttc reads the schedule again.
                threading.Event().wait(chance.uniform(0, 3))
                kill(flight, "ttc")
            for line in lines:
                self.wait_for_stage(ground, line, "completed", PATIENCE_S + DEADLINE_S)
            self.assertEqual(self.listed(ground), [])
            self.judge_executions(flight, recorder, len(lines), KILLS)


if __name__ == "__main__":
    unittest.main()
