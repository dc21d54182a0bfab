# SPDX-FileCopyrightText: 2026 SRFS contributors
# SPDX-License-Identifier: Apache-2.0
"""The judgement of the CAN record, against made-up slots."""

import unittest

from srfs.record import can_frames

MS = 1_000_000
EPS = "payload_eps"
SLOTS = [{"published": start * MS, "lease_end": (start + 120) * MS} for start in (1000, 1300, 1600)]
TELECOMMANDS = {0x1_0000_002A: {"target": EPS, "at": 1105 * MS}}


def record(at_ms, number=0x2A):
    return [
        "(1.001000) can0 18DA1201#0401057E9BCCCCCC",  # a wake-up
        f"({at_ms // 1000}.{at_ms % 1000:03}000) can0 18DA1201#100B0207{number:08X}",
        "(1.999000) can0 18DA0112#3000",
        "(2.0000",  # a line that is still being written
    ]


def judge(sent_ms, frame_ms, **record_of):
    frames = can_frames.command_frames(record(frame_ms, **record_of))
    return can_frames.next_slot_fact(sent_ms * MS, EPS, TELECOMMANDS, SLOTS, frames)


def slot(holder, published, released, lease_end=1000):
    return {"holder": holder, "published": published, "released": released, "lease_end": lease_end}


class JudgeSlotsTest(unittest.TestCase):
    SLOTS = [slot("a", 100, 150), slot("b", 200, None, 280), {"holder": None, "published": 281}, slot("c", 400, 450), slot("a", 500, 550)]

    def test_every_frame_in_its_senders_slot_is_good(self):
        frames = [(100, "a"), (150, "a"), (201, "b"), (280, "b"), (400, "c")]
        self.assertEqual(can_frames.judge_slots(frames, self.SLOTS), (5, []))

    def test_a_frame_of_another_payload_in_a_slot_is_wrong(self):
        good, wrong = can_frames.judge_slots([(110, "a"), (120, "b"), (130, "a")], self.SLOTS)
        self.assertEqual(good, 2)
        self.assertEqual(wrong, ["a frame of b at 120 ns in the slot of a"])

    def test_a_frame_behind_the_release_or_the_lease_is_wrong(self):
        self.assertEqual(len(can_frames.judge_slots([(151, "a"), (451, "c")], self.SLOTS)[1]), 2)
        self.assertEqual(can_frames.judge_slots([(151, "a")], self.SLOTS, clock_error_ns=1), (1, []))

    def test_what_nobody_recorded_is_not_judged(self):
        self.assertEqual(can_frames.judge_slots([(99, "b"), (300, "b"), (501, "b")], self.SLOTS), (0, []))

    def test_only_frames_of_the_computer_count(self):
        lines = ["(1.000001) vcan0 18DA1101#04", "(1.000002) vcan0 18DA0111#30", "(1.000003) vcan0 18DA1301#R", "(1.0"]
        self.assertEqual([frame[:2] for frame in can_frames.computer_frames(lines)], [(1_000_001_000, "payload_adcs"), (1_000_003_000, "payload_thermal")])


class CanFramesTest(unittest.TestCase):
    def test_the_first_frame_of_a_command_names_its_telecommand(self):
        self.assertEqual(can_frames.command_frames(record(1310)), {(EPS, 0x2A): [1310 * MS]})
        self.assertEqual(can_frames.last_time(record(1310)), 1999 * MS)

    def test_a_frame_in_the_slot_after_the_octets_is_in_time(self):
        fact = judge(sent_ms=1100, frame_ms=1310)
        self.assertTrue(fact["in_next_slot"])
        self.assertEqual(fact["frame_after_ms"], 210)

    def test_a_frame_one_slot_later_is_late(self):
        fact = judge(sent_ms=1100, frame_ms=1610)
        self.assertFalse(fact["in_next_slot"])
        self.assertEqual(fact["why"], "1 slots late")

    def test_a_slot_that_begins_while_the_telecommand_is_being_accepted_need_not_carry_it(self):
        near = {0x2A: {"target": EPS, "at": 1299 * MS}}
        frames = can_frames.command_frames(record(1610))
        self.assertTrue(can_frames.next_slot_fact(1290 * MS, EPS, near, SLOTS, frames)["in_next_slot"])

    def test_a_frame_outside_every_slot_is_not_in_time(self):
        self.assertIn("outside", judge(sent_ms=1100, frame_ms=1500)["why"])

    def test_a_telecommand_without_frame_or_publication_is_not_in_time(self):
        self.assertIn("no frame", judge(sent_ms=1100, frame_ms=1310, number=0x2B)["why"])
        self.assertIn("never published", judge(sent_ms=1200, frame_ms=1310)["why"])


if __name__ == "__main__":
    unittest.main()
