# SPDX-FileCopyrightText: 2026 SRFS contributors
# SPDX-License-Identifier: Apache-2.0
"""The judgement of the paper's Fig. 14, on timelines made by hand: it accepts the right shapes and rejects every wrong one."""

import pathlib
import unittest

TOOLS = pathlib.Path(__file__).resolve().parents[3] / "tools"

from srfs.record import timeline
from srfs.record.timeline import ASYNC, MS, OCCUPYING, OFF, PROCESSING

PAYLOADS = ("p1", "p2", "p3")
BEAT = 250 * MS
HOLD = 100 * MS
WORK = 350 * MS


def fly(slots=12, holds=None, work=WORK, order=PAYLOADS, every=None, behind=None):
    """A Timeline of `slots` slots. holds: {slot: time on the bus}; every: {slot: heartbeats until the next one}; behind: {slot: its delay}."""
    line = timeline.Timeline(PAYLOADS)
    beat = 4
    for number in range(slots):
        payload, hold = order[number % len(order)], (holds or {}).get(number, HOLD)
        begin = beat * BEAT + (behind or {}).get(number, MS)
        line.on_message(grant(number, payload, beat, begin - MS // 2))
        line.on_message({"type": "activity", "payload": payload, "state": OCCUPYING, "since_ns": begin})
        line.on_message({"type": "activity", "payload": payload, "state": PROCESSING, "since_ns": begin + hold})
        line.on_message({"type": "activity", "payload": payload, "state": OFF, "since_ns": begin + hold + work})
        beat += (every or {}).get(number, 1 + (hold + MS) // BEAT)
    for cycle in range(beat + 2):
        line.on_message({"type": "tick", "cycle": cycle, "due_ns": cycle * BEAT, "published_ns": cycle * BEAT})
    return line, (beat + 1) * BEAT


def grant(number, payload, cycle, caused):
    return {"type": "flags", "switcher": 1, "grant": number, "holder": payload, "cycle": cycle, "tick_received_ns": caused, "published_ns": caused}


def failed(judge, line, end, *more):
    beats = line.heartbeats(0, end)
    checks = judge(line.intervals(0, end), line.switches(0, end), beats, PAYLOADS, end, *more)
    return [c["what"] for c in checks if not c["ok"]]


class NormalTest(unittest.TestCase):
    def test_a_bus_that_goes_round_at_every_heartbeat_is_fig_14a_and_14c(self):
        line, end = fly()
        self.assertEqual(failed(timeline.fig14a, line, end), [])
        self.assertEqual(failed(timeline.fig14c, line, end), [])

    def test_nothing_recorded_is_nothing(self):
        line = timeline.Timeline(PAYLOADS)
        self.assertTrue(failed(timeline.fig14a, line, 10 * BEAT))

    def test_two_on_the_bus_are_refused(self):
        line, end = fly()
        line.on_message({"type": "activity", "payload": "p3", "state": OCCUPYING, "since_ns": 4 * BEAT + 50 * MS})
        line.on_message({"type": "activity", "payload": "p3", "state": OFF, "since_ns": 4 * BEAT + 60 * MS})
        self.assertIn("at most one payload occupies", " ".join(failed(timeline.fig14a, line, end)))

    def test_another_order_is_refused(self):
        line, end = fly(order=("p1", "p3", "p2"))
        self.assertIn("configured order", " ".join(failed(timeline.fig14a, line, end)))

    def test_a_heartbeat_without_a_switch_is_refused(self):
        line, end = fly(every={5: 2})
        self.assertIn("first heartbeat after the release", " ".join(failed(timeline.fig14a, line, end)))

    def test_a_switch_at_a_release_is_refused(self):
        line, end = fly()
        early = 6 * BEAT + 110 * MS  # p3 releases at 101 ms
        line.grants[(1, 3)] = timeline.Grant("p1", 6, early, early)
        line.changes = [(early if (since, who) == (7 * BEAT + MS, "p1") else since, who, state) for since, who, state in line.changes]
        self.assertEqual(failed(timeline.fig14a, line, end)[0], "every switch comes at the first heartbeat after the release, 1 of 11 do not")

    def test_a_slot_without_a_grant_is_refused(self):
        line, end = fly()
        line.grants = {key: grant for key, grant in line.grants.items() if grant.payload != "p2"}
        self.assertIn("first heartbeat after the release", " ".join(failed(timeline.fig14a, line, end)))

    def test_a_switch_that_comes_late_came_at_its_heartbeat_and_is_late(self):
        line, end = fly(behind={5: 90 * MS})
        self.assertEqual(failed(timeline.fig14a, line, end), ["the payload has the bus 50 ms after the heartbeat, 1 of 12 later than that"])

    def test_a_heartbeat_that_the_switcher_made_itself_is_the_late_one(self):
        for published_late in (0, 80 * MS):
            with self.subTest(published_late=published_late):
                line, end = fly(behind={5: 64 * MS})
                late = 4 + 5
                line.grants[1, 5] = timeline.Grant("p3", late - 1, late * BEAT + 63 * MS, late * BEAT + 63 * MS)
                line.ticks[late] += published_late
                whats = failed(timeline.fig14a, line, end)
                self.assertEqual([what for what in whats if "later than" not in what], [])

    def test_a_heartbeat_made_by_the_switcher_behind_a_blocked_one_is_the_late_one(self):
        line, end = fly(holds={4: 400 * MS}, behind={5: 64 * MS})
        late = 4 + 6
        line.grants[1, 5] = timeline.Grant("p3", late - 1, late * BEAT + 63 * MS, late * BEAT + 63 * MS)
        line.ticks[late] += 80 * MS
        self.assertEqual([what for what in failed(timeline.fig14b, line, end, "p2") if "later than" not in what], [])

    def test_a_release_on_its_way_to_the_switcher_excuses_one_heartbeat(self):
        line, end = fly(holds={5: 230 * MS}, every={5: 2})
        self.assertEqual(failed(timeline.fig14a, line, end), [])
        line, end = fly(holds={5: 230 * MS}, every={5: 3})
        self.assertIn("first heartbeat after the release", " ".join(failed(timeline.fig14a, line, end)))

    def test_a_slot_without_processing_is_refused(self):
        line, end = fly()
        line.changes = [c for k, c in enumerate(line.changes) if k != 4]
        self.assertTrue(failed(timeline.fig14a, line, end))

    def test_a_blocked_heartbeat_is_not_normal(self):
        line, end = fly(holds={4: 300 * MS})
        self.assertEqual(len(failed(timeline.fig14a, line, end)), 1)

    def test_processing_that_ends_before_the_next_slot_is_not_parallel(self):
        line, end = fly(work=50 * MS)
        self.assertEqual(failed(timeline.fig14a, line, end), [])
        self.assertEqual(len(failed(timeline.fig14c, line, end)), 1)


class BlockedTest(unittest.TestCase):
    def test_a_slow_payload_blocks_the_switch_and_the_next_comes_after_it(self):
        line, end = fly(holds={1: 400 * MS, 4: 400 * MS})
        self.assertEqual(failed(timeline.fig14b, line, end, "p2"), [])
        self.assertTrue(failed(timeline.fig14b, line, end, "p3"), "the wrong one")

    def test_without_a_blocked_heartbeat_it_is_not_fig_14b(self):
        line, end = fly()
        self.assertEqual(len(failed(timeline.fig14b, line, end, "p2")), 1)


class TelecommandTest(unittest.TestCase):
    AT = 6 * BEAT + 200 * MS  # after p3's slot; p1's next one begins at heartbeat 7

    def with_telecommand(self, pulse=True, frame=7 * BEAT + 20 * MS, completed=7 * BEAT + 30 * MS):
        line, end = fly()
        line.on_message({"type": "telecommand", "id": 5, "target": "p1", "at_ns": self.AT})
        if pulse:
            line.on_message({"type": "activity", "payload": "p1", "state": ASYNC, "since_ns": self.AT + MS})
            line.on_message({"type": "activity", "payload": "p1", "state": OFF, "since_ns": self.AT + 3 * MS})
        if completed:
            line.on_message({"type": "report", "id": 5, "stage": 7, "success": True, "at_ns": completed})
        return failed(timeline.fig14d, line, end, "p1", line.telecommands, line.completed, {5: frame} if frame else {})

    def test_a_pulse_and_execution_in_the_next_slot_are_fig_14d(self):
        self.assertEqual(self.with_telecommand(), [])

    def test_without_the_pulse_it_is_not(self):
        self.assertEqual(len(self.with_telecommand(pulse=False)), 2)

    def test_a_frame_in_a_later_slot_is_not(self):
        self.assertEqual(len(self.with_telecommand(frame=10 * BEAT + 20 * MS)), 1)

    def test_no_frame_is_not(self):
        self.assertEqual(len(self.with_telecommand(frame=None)), 1)

    def test_no_completion_is_not(self):
        self.assertEqual(len(self.with_telecommand(completed=None)), 1)

    def test_without_a_telecommand_it_is_not(self):
        line, end = fly()
        self.assertTrue(failed(timeline.fig14d, line, end, "p1", {}, {}, {}))


class UseOfTheBusTest(unittest.TestCase):
    def test_sequential_work_would_need_two_heartbeats_a_slot(self):
        line, end = fly()
        use = timeline.use_of_the_bus(line.intervals(BEAT * 4, BEAT * 16), line.heartbeats(BEAT * 4, BEAT * 16), BEAT * 4, BEAT * 16)
        self.assertEqual(use["slots"], 12)
        self.assertAlmostEqual(use["bus_utilisation"], 0.4, places=3)
        self.assertAlmostEqual(use["bus_utilisation_sequential"], 0.2, places=3)
        self.assertGreater(use["processing_beside_the_bus_ms"], 1000)
        self.assertEqual((use["slots_per_s"], use["slots_per_s_sequential"]), (4, 2))
        self.assertEqual((use["slot_ms"], use["processing_ms"]), (100, 350))

    def test_parallelism_is_the_ratio_to_a_run_in_strict_sequence(self):
        uses = []
        for every in (None, dict.fromkeys(range(12), 2)):
            line, end = fly(every=every)
            uses.append(timeline.use_of_the_bus(line.intervals(0, end), line.heartbeats(0, end), 0, end))
        self.assertEqual(uses[1]["processing_beside_the_bus_ms"], 0)
        self.assertEqual(timeline.parallelism(*uses), 2)

    def test_the_heartbeat_for_strict_sequence_is_one_that_timing_accepts(self):
        line, end = fly()
        self.assertEqual(timeline.longest_work(line.intervals(0, end)), HOLD + WORK)
        self.assertEqual([timeline.next_tick_period_ms(ms) for ms in (0.2, 15.1, 450, 501, 1000, 1000.1)], [1, 20, 500, 1000, 1000, 2000])


if __name__ == "__main__":
    unittest.main()
