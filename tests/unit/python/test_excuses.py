# SPDX-FileCopyrightText: 2026 SRFS contributors
# SPDX-License-Identifier: Apache-2.0
"""Which failures are excused on a busy machine, and which not."""

import unittest

from srfs.flight.lateness import Excuses
from srfs.record import rotation

S = 1_000_000_000
MS = 1_000_000


class ExcusesTest(unittest.TestCase):
    WAITING = {"ttc": {"waited_s": 0.03, "waits": [[10 * S, 10 * S + 200 * MS, 30 * MS]]}}
    QUIET = {"late_at": []}

    def test_a_loss_is_excused_by_what_a_process_it_needed_waited_meanwhile(self):
        excuses = Excuses(self.QUIET, self.WAITING)

        self.assertEqual(excuses.find(["ttc", "hw_sim"], 10 * S, 10 * S + 300 * MS), "ttc waited 30 ms for a CPU")
        self.assertIsNone(excuses.find(["hw_sim"], 10 * S, 10 * S + 300 * MS), "another process")
        self.assertIsNone(excuses.find(["ttc"], 11 * S, 12 * S), "another time")
        self.assertIsNone(excuses.find(["ttc"], 9 * S, 12 * S), "too little for so long a time")

    def test_a_machine_that_stood_still_is_an_excuse_too(self):
        excuses = Excuses({"late_at": [[10 * S, 10 * S + 50 * MS]]}, {})

        self.assertEqual(excuses.find(["ttc"], 10 * S, 10 * S + 300 * MS), "this machine stood still for 50 ms")

    def test_without_evidence_nothing_is_excused(self):
        self.assertIsNone(Excuses(self.QUIET, {}).find(["ttc"], 0, 100 * S))


class FailedSlotsTest(unittest.TestCase):
    def test_slots_that_were_over_and_neither_used_nor_handed_back_have_failed(self):
        seen = rotation.Rotation()
        for number, (holder, status) in enumerate([("a", "released"), ("b", "failed"), ("a", "not used"), ("b", None), ("a", "released"), ("b", None)]):
            seen.grants[(1, number)] = {"holder": holder, "cycle": number, "published": number * S, "lease_end": number * S + 80 * MS, "status": status,
                                        "released": number * S + 50 * MS if status else None, "used_us": None}  # fmt: skip

        self.assertEqual([slot["cycle"] for slot in seen.failed_slots("b")], [1, 3], "the last one is under way")
        self.assertEqual(seen.failed_slots("a"), [])

    def test_a_tick_without_a_grant_and_without_cause_is_a_skip(self):
        seen = rotation.Rotation()
        for cycle in (1, 2, 4, 5):
            seen.grants[(1, cycle)] = {"holder": "a", "cycle": cycle, "caused": cycle * S, "published": cycle * S, "lease_end": cycle * S + 80 * MS, "status": "released",
                                       "released": cycle * S + 50 * MS, "used_us": 50_000}  # fmt: skip
        seen.ticks = seen.due = {cycle: cycle * S for cycle in range(1, 6)}

        self.assertEqual(seen.skips(), [3 * S])
        self.assertEqual(seen.skipped(), (0, 1))

    def test_a_tick_that_came_when_the_switcher_had_made_it_itself_is_no_skip(self):
        def granted(at, late):
            seen = rotation.Rotation()
            for number, (cycle, caused) in enumerate([(1, 1 * S), (2, 2 * S), (2, at), (4, 4 * S)]):
                seen.on_message({"type": "flags", "switcher": 1, "grant": number, "holder": "a", "cycle": cycle, "flags": [True], "at_ns": caused,
                                 "tick_received_ns": caused, "published_ns": caused, "lease_end_ns": caused + 120 * MS})  # fmt: skip
                seen.on_message({"type": "bus", "switcher": 1, "grant": number, "status": "released", "detail": "", "said_ns": caused + 50 * MS, "used_us": 50_000})
            for cycle in range(1, 5):
                at_ns = cycle * S + (late if cycle == 3 else 0)
                seen.on_message({"type": "tick", "cycle": cycle, "at_ns": at_ns, "due_ns": cycle * S, "published_ns": at_ns})
            return seen

        self.assertEqual(granted(3 * S + 250 * MS, 400 * MS).skips(), [])
        self.assertEqual(granted(2 * S + 60 * MS, 0).skips(), [3 * S], "a slot that was handed over early is another one")

    def test_a_release_that_is_said_again_to_a_recall_moves_nothing(self):
        def flags(number, holder, at):
            seen.on_message({"type": "flags", "switcher": 1, "grant": number, "holder": holder, "cycle": number, "flags": [True, False], "at_ns": at,
                             "tick_received_ns": at, "published_ns": at, "lease_end_ns": at + 120 * MS})  # fmt: skip

        def released(number, at, detail=""):
            seen.on_message({"type": "bus", "switcher": 1, "grant": number, "status": "released", "detail": detail, "said_ns": at, "used_us": 50_000})

        seen = rotation.Rotation()
        flags(1, "a", S)
        released(1, S + 83 * MS)
        flags(2, "b", S + 100 * MS)
        released(1, S + 105 * MS, "recalled")
        released(2, S + 150 * MS)

        self.assertEqual(seen.overlaps(), 0)
        flags(3, "a", S + 200 * MS)
        flags(4, "b", S + 250 * MS)
        released(3, S + 260 * MS)
        self.assertEqual(seen.overlaps(), 1, "the next grant came before the first release")

    def test_an_end_for_which_the_recorder_was_too_slow_is_no_overlap(self):
        seen = rotation.Rotation()
        for number, released in ((1, True), (2, False), (3, True), (4, False), (5, True)):
            seen.grants[(1, number)] = {"holder": "ab"[number % 2], "cycle": number, "published": number * S, "lease_end": number * S + 1200 * MS,
                                        "status": "released" if released else None, "released": number * S + 50 * MS if released else None,
                                        "used_us": None}  # fmt: skip

        def lost(topic, at, messages):
            seen.on_message({"type": "lost", "at_ns": at, "topic": topic, "messages": messages})

        self.assertEqual(seen.overlaps(), 2, "nothing was lost, so the ends were not said")
        lost("/can/task_flags", 5 * S, 7)
        self.assertEqual(seen.overlaps(), 2, "flags were lost, not ends")
        lost("/can/bus_status", 1 * S, 7)
        self.assertEqual(seen.overlaps(), 2, "the loss was before these grants")
        lost("/can/bus_status", 3 * S, 7)
        self.assertEqual((seen.overlaps(), seen.undecided()), (1, 1), "one end may have been among them, the other grant came later")
        self.assertEqual(seen.overlaps(until=4 * S), 0)
        lost("/can/bus_status", 5 * S, 1)
        self.assertEqual((seen.overlaps(), seen.undecided()), (0, 2))


if __name__ == "__main__":
    unittest.main()
