# SPDX-FileCopyrightText: 2026 SRFS contributors
# SPDX-License-Identifier: Apache-2.0
"""The CAN rotation when it is changed at run time and when its ticks are missing, observed on the nodes' own topics."""

import os
import signal
import time
import unittest

from support import DEADLINE_S, SystemTest, wait_for_slots

from srfs.flight.deployments import PAYLOADS

TICKS_MISSING, TICKS_BACK = 310, 311  # events of can_switcher (msgs/mission/can_switcher.yaml)


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
            # The first flag may have been sent before the change.
            turns = [holder for holder, _ in holders(recorder, recorder.position(), 7)[1:]]
            self.assertEqual(len(turns), 6)
            self.assertNotIn("payload_eps", turns)
            for before, after in zip(turns, turns[1:]):
                self.assertNotEqual(before, after, turns)

            refused = self.set_parameter(flight, "rotation_order", "[payload_thermal, payload_thermal]")
            self.assertNotEqual(refused.returncode, 0)
            self.assertIn("appears twice", refused.stdout + refused.stderr)

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


class MissingTicksTest(SystemTest):
    """The tests hold timing in the ring; otherwise the ring would restart it too early for the test."""

    def deployment_with_a_patient_watchdog(self):
        return self.deployment(("watchdog_timeout_s: 10", "watchdog_timeout_s: 120"), ("watchdog: { timeout_ms: 10000 }", "watchdog: { timeout_ms: 120000 }"))

    def wait_for_event_number(self, recorder, number, since):
        self.assertIsNotNone(recorder.wait_for(lambda m: m["type"] == "event" and m["event_id"] == number, DEADLINE_S, since))

    def wait_for_every_payload(self, recorder, count):
        since = recorder.position()
        for payload in PAYLOADS:
            wait_for_slots(recorder, payload, "released", count, since)

    def test_the_rotation_goes_on_without_timing_whether_it_is_killed_or_stopped_and_with_it_when_it_is_back(self):
        with self.flight(self.deployment_with_a_patient_watchdog()) as flight:
            recorder = flight.recorder()
            self.wait_for_every_payload(recorder, 2)
            pids = {payload: flight.node_pid(payload) for payload in PAYLOADS}
            for number in (signal.SIGKILL, signal.SIGSTOP):
                with self.subTest(signal=number.name):
                    held = flight.srfs("ring", "hold", "timing")
                    self.assertEqual(held.returncode, 0, held.stdout + held.stderr)
                    timing = flight.node_pid("timing")
                    since = recorder.position()
                    os.kill(timing, number)

                    self.wait_for_event_number(recorder, TICKS_MISSING, since)
                    without = time.monotonic_ns()
                    self.wait_for_every_payload(recorder, 4)
                    self.assertEqual(recorder.select(lambda m: m["type"] == "tick" and m["published_ns"] > without), [], "none of this was timing's doing")

                    since = recorder.position()
                    if number == signal.SIGSTOP:
                        os.kill(timing, signal.SIGCONT)
                        self.wait_for_event_number(recorder, TICKS_BACK, since)
                    released = flight.srfs("ring", "release", "timing")
                    self.assertEqual(released.returncode, 0, released.stdout + released.stderr)
                    self.wait_for_event_number(recorder, TICKS_BACK, since)
                    self.wait_for_every_payload(recorder, 4)
            turns = [m["holder"] for m in recorder.select(lambda m: m["type"] == "flags" and m["holder"])]
            self.assertEqual({payload: flight.node_pid(payload) for payload in PAYLOADS}, pids, "nobody else had to die")
        for before, after in zip(turns, turns[1:]):
            self.assertEqual(PAYLOADS.index(after), (PAYLOADS.index(before) + 1) % len(PAYLOADS), "every payload in its turn")

    def test_a_timing_node_that_is_deactivated_by_command_stops_the_rotation_until_it_is_active_again(self):
        with self.flight(self.deployment_with_a_patient_watchdog()) as flight:
            recorder = flight.recorder()
            self.wait_for_every_payload(recorder, 2)

            self.assertEqual(flight.srfs("lifecycle", "timing", "deactivate").returncode, 0)
            stopped, since = time.monotonic_ns(), recorder.position()
            deactivated = since
            for _ in range(15):  # each lasts one period of the ring, which equals the tick period
                asked = recorder.wait_for(lambda m: m["type"] == "liveness" and m["verdict"] == "alive" and m["subject"] == "can_switcher", DEADLINE_S, since)
                self.assertIsNotNone(asked)
                since = recorder.position()
            flags = recorder.select(lambda m: m["type"] == "flags" and m["published_ns"] > stopped)
            self.assertLessEqual(len(flags), 1, "but one that was decided on before")
            self.assertEqual(recorder.select(lambda m: m["type"] == "event" and m["event_id"] == TICKS_MISSING, deactivated), [])

            self.assertEqual(flight.srfs("lifecycle", "timing", "activate").returncode, 0)
            self.wait_for_every_payload(recorder, 2)


if __name__ == "__main__":
    unittest.main()
