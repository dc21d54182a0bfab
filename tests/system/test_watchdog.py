# SPDX-FileCopyrightText: 2026 SRFS contributors
# SPDX-License-Identifier: Apache-2.0
"""The simulated hardware watchdog, the last line of defence, and the boot record that documents its resets."""

import os
import signal
import unittest

from support import DEADLINE_S, SystemTest

from srfs.flight.deployments import NODES
from srfs.flight.processes import PATIENCE, wait_until

TIMEOUT = ("watchdog: { timeout_ms: 10000 }", "watchdog: { timeout_ms: 5000 }")


class WatchdogTest(SystemTest):
    def pids(self, flight):
        return {name: flight.node_pid(name) for name in NODES}

    def counters(self, flight):
        return flight.control({"query": "counters"})["watchdog"]

    def wait_until_armed(self, flight):
        wait_until(lambda: self.counters(flight)["armed"], DEADLINE_S, "the watchdog is armed")

    def wait_until_all_are_new(self, flight, before):
        def renewed():
            now = self.pids(flight)
            return all(now[name] not in (None, before[name]) for name in NODES)

        wait_until(renewed, DEADLINE_S, "every node is a new process")
        wait_until(lambda: [node["state"] for node in flight.status()] == ["active"] * len(NODES), DEADLINE_S, "all nodes are active")

    def signal_all(self, pids, number):
        for pid in pids.values():
            os.kill(pid, number)

    def test_brings_all_nine_nodes_back_when_they_are_killed_or_stopped_at_once(self):
        with self.flight(self.deployment(TIMEOUT)) as flight:
            ground = flight.ground()
            for bites, number in enumerate((signal.SIGKILL, signal.SIGSTOP), 1):
                with self.subTest(signal=number.name):
                    self.wait_until_armed(flight)
                    before = self.pids(flight)
                    self.signal_all(before, signal.SIGSTOP)  # otherwise one node could start another before it dies itself
                    self.signal_all(before, number)

                    self.wait_until_all_are_new(flight, before)
                    counters = self.counters(flight)
                    self.assertEqual(counters["bites"], bites)
                    self.assertEqual(counters["restarts_started"], bites)
                    self.assertEqual(counters["restarts_failed"], 0)

                    self.complete(ground, "ping --timeout 20")
                    boot = ground.fresh("timing", DEADLINE_S)
                    self.assertEqual((boot["boot_count"], boot["reset_cause"]), (1 + bites, "watchdog"))
                    since = ground.position()
                    beacon = ground.wait_for(lambda m: m.get("structure") == "beacon", 60 * PATIENCE, since)
                    self.assertEqual((beacon["fields"]["boot_count"], beacon["fields"]["reset_cause"]), (1 + bites, "watchdog"))

    def test_counts_boots_and_not_restarts_of_nodes_and_says_when_one_is_healthy(self):
        deployment = self.deployment(("watchdog_timeout_s: 10", "watchdog_timeout_s: 10, healthy_after_s: 2"))
        with self.flight(deployment) as flight:
            ground = flight.ground()
            ground.command("tc housekeeping.set_interval structure=timing interval_ms=500", DEADLINE_S)
            first = ground.housekeeping("timing", DEADLINE_S, matches=lambda f: f["boot_healthy"])["fields"]
            self.assertEqual((first["boot_count"], first["reset_cause"], first["unhealthy_boots"]), (1, "power_on", 0))
            self.assertEqual(first["watchdog_timeout_s"], 10, "as the device says")

            before = flight.node_pid("timing")
            self.assertEqual(flight.srfs("lifecycle", "timing", "deactivate").returncode, 0)
            self.assertEqual(flight.srfs("lifecycle", "timing", "activate").returncode, 0)
            self.assertEqual(flight.node_pid("timing"), before)
            again = ground.fresh("timing", DEADLINE_S)
            self.assertEqual((again["boot_count"], again["boot_healthy"]), (1, True))

        with self.flight(deployment) as flight:  # a power cycle
            ground = flight.ground()
            second = ground.fresh("timing", DEADLINE_S)
            self.assertEqual((second["boot_count"], second["reset_cause"], second["unhealthy_boots"]), (2, "commanded", 0))


if __name__ == "__main__":
    unittest.main()
