# SPDX-FileCopyrightText: 2026 SRFS contributors
# SPDX-License-Identifier: Apache-2.0
"""The ring's reports as a timeline."""

import unittest

from srfs.record import ringline
from srfs.record.ringline import DOWN, UP, WAITING, RingLine, states, step


def report(at, observer, subject, verdict, **more):
    return {"type": "liveness", "said_ns": at, "observer": observer, "subject": subject, "verdict": verdict, "misses": 0, **more}


def recorded(*reports):
    line = RingLine()
    for r in reports:
        line.on_message(r)
    return line


RAISED = recorded(
    report(10, "a", "b", "miss", misses=1),
    report(20, "a", "b", "miss", misses=2),
    report(30, "a", "b", "accused", misses=3, fault="absent"),
    report(35, "a", "b", "outcome", outcome="restarted"),
    report(40, "a", "b", "alive", lifecycle_state=1),
    report(50, "a", "b", "alive", lifecycle_state=3),
)


class StepTest(unittest.TestCase):
    def test_a_restart_is_read_from_accusation_to_the_first_answer_of_an_active_node(self):
        found = step(RAISED, "a", "b", None, 0, 100)
        self.assertEqual((found["accused_ns"], found["accused_misses"], found["fault"]), (30, 3, "absent"))
        self.assertEqual((found["outcome"], found["outcome_ns"], found["active_ns"]), ("restarted", 35, 50))

    def test_what_was_said_before_or_by_others_does_not_count(self):
        for observer, since in (("a", 36), ("c", 0)):
            found = step(RAISED, observer, "b", None, since, 100)
            self.assertEqual((found["accused_ns"], found["outcome"], found["active_ns"]), (None, None, None))

    def test_an_answer_before_the_restart_is_no_healing(self):
        line = recorded(report(5, "a", "b", "alive", lifecycle_state=3), report(9, "a", "b", "outcome", outcome="restarted"))
        self.assertIsNone(line.alive("a", "b", 0, renewed=True))

    def test_restarts_by_anybody_but_the_node_before_are_named(self):
        ring = ("a", "b", "c")
        self.assertEqual(RAISED.restarts_by_others(ring, 0), [])
        line = recorded(report(5, "a", "c", "outcome", outcome="restarted"), report(6, "b", "a", "outcome", outcome="renewed"))
        self.assertEqual([m["subject"] for m in line.restarts_by_others(ring, 0)], ["c"])


class StatesTest(unittest.TestCase):
    def test_a_node_waits_from_its_first_miss_to_an_answer_and_is_off_without_a_process(self):
        processes = [(2, "a", 7), (33, "b", 8), (60, "a", None), (70, "a", 9)]
        self.assertEqual(states(RAISED, processes, ["a"], 0, 80),
                         [("a", DOWN, 0, 2), ("a", UP, 2, 10), ("a", WAITING, 10, 40), ("a", UP, 40, 60), ("a", DOWN, 60, 70), ("a", UP, 70, 80)])  # fmt: skip
        self.assertEqual(states(RAISED, processes, ["b", "c"], 0, 80), [("b", DOWN, 0, 33), ("b", UP, 33, 80), ("c", DOWN, 0, 80)])

    def test_last_words_of_a_dead_node_do_not_revive_it(self):
        line = recorded(report(12, "a", "b", "alive", lifecycle_state=3))
        self.assertEqual(states(line, [(2, "a", 7), (10, "a", None)], ["a"], 0, 20), [("a", DOWN, 0, 2), ("a", UP, 2, 10), ("a", DOWN, 10, 20)])

    def test_the_states_are_those_of_the_drawing(self):
        self.assertEqual(ringline.STATES, (DOWN, UP, WAITING))


if __name__ == "__main__":
    unittest.main()
