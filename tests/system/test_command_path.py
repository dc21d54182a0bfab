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


class SetAsideTest(SystemTest):
    """What operators left behind is not used any more when the suite does not become healthy with it."""

    def reset(self, flight):
        """The power goes and comes again."""
        watchdog = lambda: flight.control({"query": "counters"})["watchdog"]  # noqa: E731
        wait_until(lambda: watchdog()["armed"], DEADLINE_S, "the watchdog is armed")
        bites = watchdog()["bites"]
        pids = [pid for name in NODES if (pid := flight.node_pid(name))]
        for number in (signal.SIGSTOP, signal.SIGKILL):
            for pid in pids:
                os.kill(pid, number)
        wait_until(lambda: watchdog()["bites"] == bites + 1, DEADLINE_S, "the watchdog restarts the computer")
        wait_until(lambda: all(flight.node_pid(name) not in (None, *pids) for name in ("ttc", "maintenance")), DEADLINE_S, "the suite is started anew")
        wait_until(lambda: {n["state"] for n in flight.status() if n["name"] in ("timing", "ttc", "maintenance")} == {"active"}, DEADLINE_S, "it is Active")

    def test_after_too_many_resets_orders_and_kept_values_are_set_aside_and_come_back_by_telecommand(self):
        deployment = self.deployment(TIMEOUT, ("  period_ms: 100 ", "  unhealthy_starts: 2\n  period_ms: 100 "))
        with self.flight(deployment) as flight:
            ground = flight.ground()
            complete = lambda text: self.assertEqual(ground.command(f"tc {text}", DEADLINE_S).get("stage"), "completed", text)  # noqa: E731
            complete("ring.hold node=payload_eps")
            complete("parameters.set parameter=can_switcher.early_handover value=true")
            complete("parameters.keep node=can_switcher")
            hold = flight.var / "state/payload_eps/hold"
            self.reset(flight)
            self.assertTrue(hold.exists())
            since = ground.position()
            self.reset(flight)
            self.assertFalse(hold.exists())
            said = ground.wait_for(lambda m: m["type"] == "event" and m["event"] == "maintenance.orders_set_aside", DEADLINE_S, since)
            self.assertEqual(said["fields"], {"starts": 2, "what": "can_switcher (kept values), payload_eps (hold)"})
            wait_until(lambda: flight.node_pid("payload_eps"), DEADLINE_S, "payload_eps is started")

            complete("ring.restore_orders node=payload_eps")
            self.assertTrue(hold.exists())
            again = ground.command("tc ring.restore_orders node=payload_eps", DEADLINE_S)
            self.assertEqual(again.get("name"), "nothing_set_aside", again)
            refused = ground.command("tc ring.restore_orders node=ttc", DEADLINE_S)
            self.assertEqual(refused.get("name"), "on_command_path", refused)
            complete("ring.release node=payload_eps")
            complete("parameters.restore node=can_switcher generation=1")


if __name__ == "__main__":
    unittest.main()
