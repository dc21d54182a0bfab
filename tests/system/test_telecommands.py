# SPDX-FileCopyrightText: 2026 SRFS contributors
# SPDX-License-Identifier: Apache-2.0
"""Telecommands that wait while their payload is killed, or for too long; and the state that a restarted payload node must not change."""

import os
import signal
import unittest

from support import DEADLINE_S, SystemTest, wait_for_slots

from srfs.flight.processes import wait_until

CRITICAL = ("critical: [timing, can_switcher, ttc]", "critical: [timing, ttc]")  # the switcher is Inactive for longer than the watchdog would wait
ACCEPTED, STARTED, COMPLETED = 1, 3, 7
EXPIRED, PERIPHERAL_SILENT = 20, 30


def reports(recorder, number=None, since=0):
    return recorder.select(lambda m: m["type"] == "report" and number in (None, m["id"]), since)


class WaitingTelecommandsTest(SystemTest):
    """The switcher is inactive while the telecommands arrive, so no payload has a slot to execute them in."""

    def switcher(self, flight, transition):
        result = flight.srfs("lifecycle", "can_switcher", transition)
        self.assertEqual(result.returncode, 0, result.stdout + result.stderr)

    def executed(self, flight, payload):
        return flight.control({"query": "executed"})["executed"][payload]["last"]

    def send(self, ground, recorder, text):
        """Sends a telecommand and waits until its payload has accepted it; returns its line and id."""
        since = recorder.position()
        line = ground.send(f"tc {text}")
        accepted = recorder.wait_for(lambda m: m["type"] == "report" and m["stage"] == ACCEPTED, DEADLINE_S, since)
        self.assertTrue(accepted and accepted["success"], accepted)
        return line, accepted["id"]

    def kill(self, flight, node):
        pid = flight.node_pid(node)
        os.kill(pid, signal.SIGKILL)
        wait_until(lambda: flight.node_pid(node) != pid, DEADLINE_S, f"{node} is gone")
        up = flight.srfs("up", "--deadline", str(DEADLINE_S), timeout_s=2 * DEADLINE_S)
        self.assertEqual(up.returncode, 0, up.stdout + up.stderr)
        self.assertNotIn(flight.node_pid(node), (None, pid))

    def test_what_was_accepted_before_a_kill_is_executed_once_in_order_after_the_restart(self):
        with self.flight(self.deployment(CRITICAL)) as flight:
            recorder, ground = flight.recorder(), flight.ground()
            wait_for_slots(recorder, "payload_eps", "released", 2, 0)
            self.switcher(flight, "deactivate")
            sent = [self.send(ground, recorder, text) for text in (
                "eps.set_charge_limit limit=0.8", "eps.switch_load load=2 state=on", "eps.reset_peripheral", "eps.set_charge_limit limit=0.9")]  # fmt: skip
            self.assertEqual(self.executed(flight, "eps"), [])
            resets = flight.control({"query": "counters"})["peripherals"]["eps"]["resets"]

            self.kill(flight, "payload_eps")
            self.assertEqual(self.executed(flight, "eps"), [], "nothing without a slot")
            self.switcher(flight, "activate")
            for number, (line, _) in enumerate(sent):
                outcome = ground.outcome(line, DEADLINE_S) or {}
                # A reset is not repeated. If the simulated peripheral got no CPU in time, its outcome is unknown; the count below covers it.
                unknown = number == 2 and outcome.get("name") == "peripheral_silent"
                self.assertTrue(unknown or outcome.get("stage") == "completed", outcome)

            by_id = [number & 0xFFFFFFFF for k, (_, number) in enumerate(sent) if k != 2]
            self.assertEqual(self.executed(flight, "eps"), by_id, "each once, in the order in which they came")
            wait_until(lambda: flight.control({"query": "counters"})["peripherals"]["eps"]["resets"] == resets + 1, DEADLINE_S, "one reset")

    def test_an_expired_telecommand_is_reported_as_such_and_not_executed(self):
        with self.flight(self.deployment(CRITICAL)) as flight:
            recorder, ground = flight.recorder(), flight.ground()
            wait_for_slots(recorder, "payload_eps", "released", 2, 0)
            resets = flight.control({"query": "counters"})["peripherals"]["eps"]["resets"]
            self.switcher(flight, "deactivate")
            _, first = self.send(ground, recorder, "eps.switch_load load=2 state=on")
            _, slow = self.send(ground, recorder, "eps.reset_peripheral")  # its timeout is longer
            # 10 s, the dictionary's default. ttc and the payload share a clock: ttc does not report the command as lost before it expires.
            expired_at = recorder.wait_for(lambda m: m["type"] == "tick" and m["at_ns"] > reports(recorder, first)[0]["at_ns"] + 10_500_000_000,
                                           DEADLINE_S + 15)  # fmt: skip
            self.assertIsNotNone(expired_at)
            self.switcher(flight, "activate")

            end = recorder.wait_for(lambda m: m["type"] == "report" and m["id"] == first and not m["success"], DEADLINE_S)
            self.assertEqual((end["stage"], end["failure_code"]), (STARTED, EXPIRED))
            # Not expired. A simulated peripheral that got no CPU in time has not confirmed its reset.
            end = recorder.wait_for(lambda m: m["type"] == "report" and m["id"] == slow and (m["stage"] == COMPLETED or not m["success"]), DEADLINE_S)
            self.assertIsNotNone(end)
            self.assertTrue(end["success"] or end["failure_code"] == PERIPHERAL_SILENT, end)
            wait_until(lambda: flight.control({"query": "counters"})["peripherals"]["eps"]["resets"] == resets + 1, DEADLINE_S, "one reset")
            self.assertEqual(self.executed(flight, "eps"), [])


class PayloadRestartTest(SystemTest):
    def test_a_restart_of_the_node_does_not_touch_the_power_of_its_peripheral(self):
        with self.flight(self.deployment(CRITICAL)) as flight:
            recorder = flight.recorder()
            wait_for_slots(recorder, "payload_eps", "released", 2, 0)
            before = flight.control({"query": "counters"})["peripherals"]
            pid = flight.node_pid("payload_eps")
            os.kill(pid, signal.SIGKILL)
            wait_until(lambda: flight.node_pid("payload_eps") != pid, DEADLINE_S, "payload_eps is gone")
            self.assertTrue(flight.control({"query": "counters"})["peripherals"]["eps"]["powered"], "a dead node leaves the switch as it is")
            self.assertEqual(flight.srfs("up", timeout_s=60).returncode, 0)
            since = recorder.position()
            wait_for_slots(recorder, "payload_eps", "released", 3, since)
            wait_for_slots(recorder, "payload_adcs", "released", 3, since)

            after = flight.control({"query": "counters"})["peripherals"]
            power = {name: (device["powered"], device["power_cycles"]) for name, device in after.items()}
            self.assertEqual(power, {name: (True, device["power_cycles"]) for name, device in before.items()})
            self.assertEqual(after["eps"]["resets"], before["eps"]["resets"])
            self.assertEqual(flight.restarts(), 1)
        with self.flight(self.deployment(CRITICAL)) as flight:
            self.assertEqual(flight.restarts(), 0, "those of the flight before, which the folder remembers")


class SensorInputsTest(SystemTest):
    def test_every_input_is_reported_by_the_payload_it_belongs_to(self):
        with self.flight(self.deployment(CRITICAL)) as flight:
            flight.control({"gpio": {"inputs": 0}})
            ground = flight.ground()

            def inputs(payload, levels, valid):
                def matches(fields):  # a reading answered late on a busy machine is not valid; a later one is
                    return (int(str(fields["sensor_levels"]), 0), int(str(fields["sensor_valid"]), 0)) == (levels, valid)
                return ground.housekeeping(f"{payload}_counters", DEADLINE_S, matches=matches)

            self.assertIsNotNone(inputs("payload_adcs", 0, 0b0011))
            for bank, payload, valid in ((0b0010, "payload_adcs", 0b0011), (0b0100, "payload_thermal", 0b0100), (0b1000, "payload_eps", 0b1000)):
                with self.subTest(payload):
                    since = ground.position()
                    flight.control({"gpio": {"inputs": bank}})
                    self.assertIsNotNone(inputs(payload, bank, valid))
                    event = ground.wait_for(lambda m: m["type"] == "event" and m["source"] == payload and "sensor inputs" in m.get("text", ""),
                                            DEADLINE_S, since)  # fmt: skip
                    self.assertIsNotNone(event)


if __name__ == "__main__":
    unittest.main()
