"""The CAN rotation changed at run time, seen on the nodes' own topics."""

import unittest

from support import DEADLINE_S, PAYLOADS, SystemTest


def holders(recorder, since, count):
    """The holders of the next `count` flags from message `since` on, with their cycles."""
    def flags():
        return recorder.select(lambda m: m["type"] == "flags", since)

    recorder.wait_for(lambda m: m["type"] == "flags" and len(flags()) >= count, DEADLINE_S, since)
    return [(m["holder"], m["cycle"]) for m in flags()[:count]]


class SwitchingTest(SystemTest):
    def set_parameter(self, flight, name, value):
        return flight.srfs("param", "set", "can_switcher", name, value)

    def test_the_order_of_the_turns_is_a_parameter_and_nobody_else_gets_a_turn(self):
        with self.flight() as flight:
            recorder = flight.recorder()
            self.assertEqual(set(holder for holder, _ in holders(recorder, 0, 6)), set(PAYLOADS))

            changed = self.set_parameter(flight, "rotation_order", "[payload_thermal, payload_adcs]")
            self.assertEqual(changed.returncode, 0, changed.stdout + changed.stderr)
            # The first flag may have been on its way before the change.
            turns = [holder for holder, _ in holders(recorder, recorder.position(), 7)[1:]]
            self.assertEqual(len(turns), 6)
            self.assertNotIn("payload_eps", turns)
            for before, after in zip(turns, turns[1:]):
                self.assertNotEqual(before, after, turns)

            refused = self.set_parameter(flight, "rotation_order", "[payload_thermal, payload_thermal]")
            self.assertNotEqual(refused.returncode, 0)
            self.assertIn("stands twice", refused.stdout + refused.stderr)

            self.assertEqual(self.set_parameter(flight, "rotation_order", "[]").returncode, 0)
            since = recorder.position()
            back = recorder.wait_for(lambda m: m["type"] == "flags" and m["holder"] == "payload_eps", DEADLINE_S, since)
            self.assertIsNotNone(back, "added again")

    def test_a_payload_with_nothing_to_say_gives_its_slot_on_in_the_same_cycle_and_no_grants_overlap(self):
        deployment = self.deployment(
            ("executable: can_switcher_node\n    scheduling: { policy: other, priority: 0, cpus: [] }",
             "executable: can_switcher_node\n    scheduling: { policy: other, priority: 0, cpus: [] }\n    parameters: { early_handover: true }"),
            ("parameters: { sensor_inputs: [11] }", "parameters: { sensor_inputs: [11], measurement_period_ms: 60000 }"),
        )  # fmt: skip
        with self.flight(deployment) as flight:
            recorder = flight.recorder()
            unused = recorder.wait_for(lambda m: m["type"] == "bus" and m["detail"] == "nothing to say", DEADLINE_S)
            self.assertIsNotNone(unused)
            turns = holders(recorder, recorder.position(), 24)

            ground = flight.ground()
            outcome = ground.command("tc eps.switch_load load=2 state=on")
            self.assertEqual(outcome.get("stage"), "completed", "a telecommand is something to say: its slot is used")
        by_cycle = {}
        for holder, cycle in turns:
            by_cycle.setdefault(cycle, []).append(holder)
        self.assertIn(["payload_eps", "payload_thermal"], list(by_cycle.values()), turns)
        self.assertTrue(all(len(set(cycle)) == len(cycle) for cycle in by_cycle.values()), "one turn a cycle each")


if __name__ == "__main__":
    unittest.main()
