# SPDX-FileCopyrightText: 2026 SRFS contributors
# SPDX-License-Identifier: Apache-2.0
"""Orders that stop a node on the command path or the watchdog's feeder end by themselves."""

import os
import signal
import subprocess
import unittest

from support import BIN, DEADLINE_S, SystemTest

from srfs.flight.deployments import NODES
from srfs.flight.processes import wait_until

LIMIT = ("  period_ms: 100 ", "  command_path_limit_ms: 6000\n  period_ms: 100 ")
TIMEOUT = ("watchdog: { timeout_ms: 10000 }", "watchdog: { timeout_ms: 5000 }")


class CommandPathTest(SystemTest):
    def state(self, flight, node):
        return next(n["state"] for n in flight.status() if n["name"] == node)

    def says(self, flight, *words):
        """Runs `srfs`, which must succeed. Returns its text output."""
        command = [BIN / "srfs", *words, "--deployment", flight.deployment, "--var", flight.var]
        done = subprocess.run(command, stdin=subprocess.DEVNULL, capture_output=True, text=True, timeout=DEADLINE_S)
        self.assertEqual(done.returncode, 0, done.stdout + done.stderr)
        return done.stdout

    def test_a_ttc_that_was_deactivated_comes_back_by_itself_also_when_it_died_meanwhile(self):
        with self.flight(self.deployment(LIMIT)) as flight:
            said = self.says(flight, "lifecycle", "ttc", "deactivate")
            self.assertIn("inactive; for at most 6 s and not across a reset: it is on the command path", said)
            first = flight.node_pid("ttc")
            os.kill(first, signal.SIGKILL)
            wait_until(lambda: flight.node_pid("ttc") not in (None, first), DEADLINE_S, "the ring has started it")
            wait_until(lambda: self.state(flight, "ttc") == "active", DEADLINE_S, "it is Active again")
            log = (flight.var / "log/ttc.log").read_text()
            self.assertIn("inactive for 6 s, the limit on the command path: going to active", log)

    def test_a_hold_of_ttc_ends_by_itself(self):
        with self.flight(self.deployment(LIMIT)) as flight:
            self.assertIn("for at most 6 s", self.says(flight, "ring", "hold", "ttc"))
            os.kill(flight.node_pid("ttc"), signal.SIGKILL)
            wait_until(lambda: "held" in flight.srfs("faults", "--node", "ttc").stdout, DEADLINE_S, "the ring has found it dead, and left it alone")
            wait_until(lambda: flight.node_pid("ttc") and self.state(flight, "ttc") == "active", DEADLINE_S, "the ring has started it")

    def test_after_the_watchdogs_reset_the_command_path_is_active_whatever_was_ordered_before(self):
        with self.flight(self.deployment(TIMEOUT)) as flight:
            watchdog = lambda: flight.control({"query": "counters"})["watchdog"]  # noqa: E731
            wait_until(lambda: watchdog()["armed"], DEADLINE_S, "the watchdog is armed")
            before = flight.node_pid("timing")
            for node in ("ttc", "can_switcher", "maintenance", "timing"):
                self.assertEqual(flight.srfs("ring", "hold", node).returncode, 0)
                self.assertEqual(flight.srfs("lifecycle", node, "deactivate").returncode, 0)
            wait_until(lambda: watchdog()["bites"] == 1, DEADLINE_S, "a timing node that is not Active does not feed")
            wait_until(lambda: flight.node_pid("timing") not in (None, before), DEADLINE_S, "the suite is started anew")
            wait_until(lambda: {n["state"] for n in flight.status()} == {"active"}, DEADLINE_S, "all nodes are Active")
            self.assertEqual(watchdog()["bites"], 1)
            self.assertEqual(flight.ground().command("ping", DEADLINE_S).get("stage"), "completed")

    def test_a_critical_node_that_is_not_active_gets_the_computer_restarted_long_before_its_order_ends(self):
        with self.flight(self.deployment(TIMEOUT)) as flight:
            watchdog = lambda: flight.control({"query": "counters"})["watchdog"]  # noqa: E731
            wait_until(lambda: watchdog()["armed"], DEADLINE_S, "the watchdog is armed")
            before = flight.node_pid("ttc")
            self.assertIn("for at most 600 s", self.says(flight, "lifecycle", "ttc", "deactivate"))
            wait_until(lambda: watchdog()["bites"] == 1, DEADLINE_S, "ttc answers, and is not Active")
            self.assertIn("watchdog not fed: ttc is not Active", (flight.var / "log/timing.log").read_text())
            wait_until(lambda: flight.node_pid("ttc") not in (None, before) and self.state(flight, "ttc") == "active", DEADLINE_S, "ttc is Active")
            self.assertEqual(flight.ground().command("ping --timeout 20", DEADLINE_S).get("stage"), "completed")


if __name__ == "__main__":
    unittest.main()
