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
        line.on_message({"type": "tick", "cycle": cycle, "due_ns": cycle * BEAT})
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

    SOON = "half of the switches to each payload come within 50 ms of their heartbeat"
    NEXT = "every switch comes at the first heartbeat after the release"

    def assert_no_next_heartbeat(self, line, end, wrong):
        self.assertIn(f"{self.NEXT}, {wrong} of 12 do not", failed(timeline.fig14a, line, end))

    def moved(self, line, number, at, cycle):
        """Its grant names this heartbeat and gives the bus at this time; the slot begins then and lasts as long as before."""
        payload = PAYLOADS[number % 3]
        old = line.grants[1, number]
        line.grants[1, number] = timeline.Grant(payload, cycle, at, at)
        shift = at + MS // 2 - old.published
        slot = [c for c in sorted(line.changes) if c[1] == payload and c[0] > old.published][:3]
        line.changes = [(since + shift, who, state) if (since, who, state) in slot else (since, who, state) for since, who, state in line.changes]

    def test_a_switch_at_a_release_is_refused(self):
        line, end = fly()
        self.moved(line, 3, 6 * BEAT + 110 * MS, 6)  # p3 releases at 101 ms
        self.assert_no_next_heartbeat(line, end, 1)

    def test_a_switch_at_a_release_behind_a_blocked_heartbeat_is_refused(self):
        line, end = fly(holds={4: 375 * MS})
        self.moved(line, 5, 9 * BEAT + 127 * MS, 9)  # p2 had the bus over heartbeat 9 and released it at 126 ms
        self.assertIn(f"{self.NEXT}, 1 of 12 do not", failed(timeline.fig14b, line, end, "p2"))

    def test_a_switch_ahead_of_its_heartbeat_is_refused(self):
        line, end = fly()
        self.moved(line, 3, 6 * BEAT + 110 * MS, 7)
        self.assert_no_next_heartbeat(line, end, 1)

    def test_a_slot_without_a_grant_of_its_own_is_refused(self):
        for number in range(12):
            with self.subTest(number=number):
                line, end = fly()
                del line.grants[1, number]
                self.assert_no_next_heartbeat(line, end, 1)

    def test_without_heartbeats_or_grants_nothing_is_right(self):
        for what in ("due", "grants"):
            line, end = fly()
            getattr(line, what).clear()
            whats = failed(timeline.fig14a, line, end)
            self.assertIn(f"{self.NEXT}, 12 of 12 do not", whats)
            self.assertIn(self.SOON, whats)

    def test_a_switch_that_comes_late_came_at_its_heartbeat(self):
        line, end = fly(behind={5: 90 * MS})
        self.assertEqual(failed(timeline.fig14a, line, end), [])
        line, end = fly(holds={5: 20 * MS}, behind={5: 210 * MS})
        self.assertEqual(failed(timeline.fig14a, line, end), ["every switch comes within 200 ms of its heartbeat, 1 of 12 come later than that"])

    def test_switches_of_which_half_come_late_are_refused(self):
        line, end = fly(behind={number: 60 * MS for number in range(0, 12, 4)})
        self.assertEqual(failed(timeline.fig14a, line, end), [])
        line, end = fly(behind={number: 60 * MS for number in range(7)})
        self.assertEqual(failed(timeline.fig14a, line, end), [self.SOON])
        line, end = fly(behind={number: 60 * MS for number in range(2, 12, 3)})
        self.assertEqual(failed(timeline.fig14a, line, end), [self.SOON], "one payload of three")

    def substituted(self, line, number, cycle, beat):
        """The grant was made at a heartbeat of the switcher itself, as this one did not come in time."""
        at = beat * BEAT + 63 * MS
        line.grants[1, number] = timeline.Grant(PAYLOADS[number % 3], cycle, at, at)

    def test_a_heartbeat_that_the_switcher_made_itself_is_the_late_one(self):
        line, end = fly(behind={5: 64 * MS})
        self.substituted(line, 5, 8, 9)
        self.assertEqual(failed(timeline.fig14a, line, end), [])

    def test_a_heartbeat_made_by_the_switcher_behind_a_blocked_one_is_the_late_one(self):
        line, end = fly(holds={4: 375 * MS}, behind={5: 64 * MS})
        self.substituted(line, 5, 9, 10)
        self.assertEqual(failed(timeline.fig14b, line, end, "p2"), [])

    def test_heartbeats_that_the_switcher_made_one_after_the_other_are_those_that_never_came(self):
        line, end = fly(behind={5: 64 * MS})
        self.substituted(line, 5, 8, 9)
        line.grants[1, 6] = timeline.Grant("p1", 8, 10 * BEAT, 10 * BEAT)
        del line.due[9], line.due[10]
        self.assertEqual(failed(timeline.fig14a, line, end), [])

    def test_a_release_on_its_way_to_the_switcher_excuses_one_heartbeat(self):
        line, end = fly(holds={5: 230 * MS}, every={5: 2})
        self.assertEqual(failed(timeline.fig14a, line, end), [])
        line, end = fly(holds={5: 230 * MS}, every={5: 3})
        self.assert_no_next_heartbeat(line, end, 1)

    def test_releases_that_are_always_on_their_way_excuse_nothing(self):
        line, end = fly(holds={number: 155 * MS for number in range(12)}, every={number: 2 for number in range(12)})
        self.assertIn(f"{self.NEXT}, 11 of 12 do not", failed(timeline.fig14c, line, end))

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
        self.assertEqual(len(failed(timeline.fig14b, line, end, "p3")), 2, "the wrong one")

    def test_another_payload_may_block_it_when_its_slot_began_late(self):
        line, end = fly(holds={1: 400 * MS, 4: 400 * MS, 9: 195 * MS}, behind={9: 60 * MS}, every={9: 2})
        self.assertEqual(failed(timeline.fig14b, line, end, "p2"), [])
        line, end = fly(holds={1: 400 * MS, 4: 400 * MS, 9: 260 * MS})
        self.assertEqual(failed(timeline.fig14b, line, end, "p2"), ["only p2 blocks the switch, but for slots that began late: 1 others"])

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
