# SPDX-FileCopyrightText: 2026 SRFS contributors
# SPDX-License-Identifier: Apache-2.0
"""How the fault campaign counts the slots that a fault took from other nodes."""

import unittest

from srfs.campaign import faults

MS = 1_000_000
ORDER = ("payload_adcs", "payload_eps", "payload_thermal")


def flight(times_ms, unreleased=(), switcher=1):
    """Grants in order at these times, each released, except those at the indices `unreleased`."""
    messages = []
    for number, at in enumerate(times_ms):
        holder = ORDER[number % len(ORDER)]
        messages.append({"type": "flags", "switcher": switcher, "grant": number, "holder": holder, "published_ns": at * MS})
        if number not in unreleased:
            messages.append({"type": "bus", "switcher": switcher, "grant": number, "status": "released", "payload": holder})
    return messages


def lost(times_ms, victims=("timing",), begin_ms=1050, end_ms=None, **other):
    end_ms = end_ms or max(times_ms) + 100
    return faults.slots_lost(flight(times_ms, **other), begin_ms * MS, end_ms * MS, victims)


STEADY = list(range(0, 1100, 100))  # the last grant before the fault is at 1000


class SlotsLostTest(unittest.TestCase):
    def test_a_rotation_that_goes_on_has_lost_none(self):
        self.assertEqual(lost([*STEADY, 1100, 1200, 1300]), 0)

    def test_every_tick_without_a_grant_is_a_lost_slot_also_the_first_after_the_fault(self):
        self.assertEqual(lost([*STEADY, 1500, 1600]), 4)
        self.assertEqual(lost([*STEADY, 1100, 1200, 1400]), 1)

    def test_a_rotation_that_stands_still_until_the_end_has_lost_all_of_them(self):
        self.assertEqual(lost(STEADY, end_ms=2500), 9)  # grants of the last 0.5 s may be in transit
        self.assertEqual(lost([*STEADY, 1100], end_ms=1500), 0)

    def test_a_beat_that_moves_by_half_a_period_has_lost_none(self):
        self.assertEqual(lost([*STEADY, 1125, 1200, 1300, 1450, 1550]), 0)
        self.assertEqual(lost([*STEADY, 1125, 1200, 1300, 1470, 1570]), 1)

    def test_a_long_outage_does_not_change_what_is_usual(self):
        self.assertEqual(lost([*STEADY, 2000, 3000, 4000]), 27)

    def test_a_grant_that_was_not_released_is_lost_but_for_the_last_that_still_runs(self):
        self.assertEqual(lost([*STEADY, 1100, 1200, 1300], unreleased=[12]), 1)
        self.assertEqual(lost([*STEADY, 1100, 1200, 1300], unreleased=[13]), 0)

    def test_what_a_payload_does_with_its_own_slot_is_its_own_loss(self):
        times = [*STEADY, 1100, 1500, 1600]  # payload_thermal holds the slot at 1100
        self.assertEqual(lost(times, victims=("payload_thermal",), unreleased=[11]), 0)
        self.assertEqual(lost(times, victims=("payload_adcs",)), 3, "it held nothing")

    def test_who_gives_the_grants_is_not_judged_by_their_number(self):
        self.assertEqual(lost([*STEADY, 1900, 2000], victims=("can_switcher", "timing")), 0)


if __name__ == "__main__":
    unittest.main()
