# SPDX-FileCopyrightText: 2026 SRFS contributors
# SPDX-License-Identifier: Apache-2.0
"""Faults of a peripheral, of a node's state and of the watchdog's feeder: each causes a defined reaction, and the other nodes continue."""

import os
import signal
import threading
import unittest

from support import DEADLINE_S, SystemTest, restarts, slots, wait_for_slots

from srfs.flight.deployments import NODES, PAYLOADS
from srfs.flight.processes import lock_owner, wait_until

HEALTHY = ("payload_adcs", "payload_thermal")


class PeripheralFaultTest(SystemTest):
    def test_the_rotation_goes_on_whatever_a_peripheral_does(self):
        with self.flight() as flight:
            recorder = flight.recorder()
            for payload in PAYLOADS:
                wait_for_slots(recorder, payload, "released", 3, 0)
            before = restarts(flight)
            for fault in ("silent", "late", "short", "garbage"):
                with self.subTest(fault):
                    since = recorder.position()
                    flight.control({"peripheral": "eps", "fault": fault})
                    wait_for_slots(recorder, "payload_eps", "failed", 2, since)
                    since = recorder.position()
                    for payload in HEALTHY:
                        # In a row: a busy machine may cost a slot now and then, but a fault elsewhere must not.
                        wait_until(lambda p=payload, s=since: self.has_row(recorder, p, 6, s), DEADLINE_S, f"6 good slots of {payload} in a row")

                    since = recorder.position()
                    flight.control({"peripheral": "eps", "fault": "none"})
                    wait_for_slots(recorder, "payload_eps", "released", 3, since)
            self.assertEqual(restarts(flight), before)

    def has_row(self, recorder, payload, length, since):
        """Whether `length` slots of a payload in a row ended well."""
        row = 0
        for slot in recorder.select(lambda m: m["type"] == "bus" and m["payload"] == payload and m["status"] in ("released", "failed"), since):
            row = row + 1 if slot["status"] == "released" else 0
            if row == length:
                return True
        return False


class LifecycleTest(SystemTest):
    def test_a_node_that_is_killed_while_the_suite_starts_is_awaited(self):
        lock = self.var / "run" / "payload_adcs.lock"

        def kill_when_it_runs():
            wait_until(lambda: lock.exists() and lock_owner(lock), DEADLINE_S, "payload_adcs runs")
            os.kill(lock_owner(lock), signal.SIGKILL)

        killer = threading.Thread(target=kill_when_it_runs)
        killer.start()
        with self.flight() as flight:
            killer.join()
            wait_until(lambda: restarts(flight)["payload_adcs"] in (1, 2), DEADLINE_S, "its neighbours restarted it")
            wait_until(lambda: [node["state"] for node in flight.status()] == ["active"] * len(NODES), DEADLINE_S, "all are Active")

    def test_a_deactivated_payload_leaves_the_rotation_to_the_others_and_comes_back(self):
        with self.flight() as flight:
            recorder = flight.recorder()
            wait_for_slots(recorder, "payload_eps", "released", 3, 0)
            pid = flight.node_pid("payload_eps")

            self.assertEqual(flight.srfs("lifecycle", "payload_eps", "deactivate").returncode, 0)
            self.assertEqual(self.state(flight, "payload_eps"), "inactive")
            since = recorder.position()
            requests = self.requests_to_eps(flight)
            for payload in HEALTHY:
                wait_for_slots(recorder, payload, "released", 10, since)
            self.assertEqual(self.requests_to_eps(flight), requests, "inactive sends nothing on the bus")
            handed_back = slots(recorder, "payload_eps", "released", since)
            self.assertEqual({m["detail"] for m in handed_back}, {"inactive"})

            self.assertEqual(flight.srfs("lifecycle", "payload_eps", "activate").returncode, 0)
            since = recorder.position()
            wait_for_slots(recorder, "payload_eps", "released", 3, since)
            self.assertEqual(flight.node_pid("payload_eps"), pid, "the same process all the time")

    def test_a_transition_that_is_not_allowed_is_refused_by_name(self):
        with self.flight() as flight:
            result = flight.srfs("lifecycle", "payload_eps", "configure")
            self.assertEqual(result.returncode, 1)
            self.assertIn("configure", result.stdout + result.stderr)
            self.assertEqual(self.state(flight, "payload_eps"), "active")
            self.assertEqual(flight.srfs("lifecycle", "payload_sps", "activate").returncode, 2)

    def requests_to_eps(self, flight):
        return flight.control({"query": "counters"})["peripherals"]["eps"]["requests"]

    def state(self, flight, name):
        return next(node["state"] for node in flight.status() if node["name"] == name)


if __name__ == "__main__":
    unittest.main()
