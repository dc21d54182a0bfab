# SPDX-FileCopyrightText: 2026 SRFS contributors
# SPDX-License-Identifier: Apache-2.0
"""The command-loss timer: what ttc does when no telecommand comes, and that a telecommand ends it."""

import os
import signal
import unittest

from support import DEADLINE_S, SystemTest

from srfs.flight.processes import wait_until

SHORT = ("initial_mode: nominal", "initial_mode: nominal, command_loss_s: 12")


class CommandLossTest(SystemTest):
    def step(self, ground, name):
        event = ground.wait_for(lambda m: m["type"] == "event" and m["event"] == "ttc.command_loss" and m["fields"]["step"] == name, DEADLINE_S)
        self.assertIsNotNone(event, f"step {name}")
        return event["fields"]

    def test_without_a_telecommand_it_goes_through_its_steps_across_a_kill_and_a_reset_until_one_comes(self):
        with self.flight(self.deployment(SHORT)) as flight:
            ground = flight.ground()
            self.assertEqual(ground.command("ping", DEADLINE_S).get("stage"), "completed")
            os.kill(flight.node_pid("ttc"), signal.SIGKILL)
            safe = self.step(ground, "safe_mode")
            self.assertEqual(safe["number"], 1)
            self.assertGreaterEqual(safe["silent_s"], 12)
            mode = ground.wait_for(lambda m: m["type"] == "event" and m["event"] == "ttc.mode_changed", DEADLINE_S)
            self.assertEqual((mode["fields"]["mode"], mode["fields"]["reason"]), ("safe", "no telecommand came"))
            self.assertEqual(self.step(ground, "line")["number"], 2)
            self.assertEqual(self.step(ground, "keys")["number"], 3)
            keys = ground.wait_for(lambda m: m["type"] == "event" and m["event"] == "ttc.keys_selected", DEADLINE_S)
            self.assertEqual(keys["fields"]["set"], "b")
            self.assertEqual(self.step(ground, "restart")["number"], 4)
            before = flight.node_pid("can_switcher")
            wait_until(lambda: flight.control({"query": "counters"})["watchdog"]["bites"] >= 1, DEADLINE_S, "the watchdog restarts the computer")
            wait_until(lambda: flight.node_pid("can_switcher") not in (None, before), DEADLINE_S, "the suite is started anew")
            later = ground.wait_for(lambda m: m["type"] == "event" and m["event"] == "ttc.command_loss" and m["fields"]["number"] > 4, 2 * DEADLINE_S)
            self.assertIsNotNone(later, "the reset does not end it")

            # Whatever set is selected, the contingency key works.
            flight.hang_up(ground)
            wait_until(lambda: self.ground_run("--keys", "contingency", "ping").returncode == 0, DEADLINE_S, "a telecommand is answered")
            ground = flight.ground()
            over = ground.command("tc parameters.set parameter=ttc.command_loss_s value=3600", DEADLINE_S)
            self.assertIsNotNone(over)


if __name__ == "__main__":
    unittest.main()
