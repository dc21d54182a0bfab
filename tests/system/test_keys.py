# SPDX-FileCopyrightText: 2026 SRFS contributors
# SPDX-License-Identifier: Apache-2.0
"""The uplink keys: switched by telecommand, remembered by both ends, never a lock-out."""

import unittest

from support import DEADLINE_S, SystemTest, kill

from srfs.flight.processes import wait_until


class KeysTest(SystemTest):
    def configure_anew(self, flight, meanwhile):
        """Takes ttc down to Unconfigured, where it has nothing open, and up again."""
        for transition in ("deactivate", "cleanup", None, "configure", "activate"):
            if transition is None:
                meanwhile()
                continue
            result = flight.srfs("lifecycle", "ttc", transition, "--deadline", str(1000 * DEADLINE_S), timeout_s=3 * DEADLINE_S)
            self.assertEqual(result.returncode, 0, result.stdout + result.stderr)

    def ping(self, ground, patience_s=2):
        return ground.command(f"ping --timeout {patience_s}").get("stage") == "completed"

    def spoil_the_selection(self):
        for copy in ("0", "1"):
            (self.var / "state" / "ttc" / f"key_selection.{copy}").write_text("2 0:b 00000000\n")

    def lose_two_keys(self):
        (self.var / "keys" / "tc_uplink.key").unlink()
        (self.var / "keys" / "tc_uplink_ad.key").write_text("damaged")

    def test_keys_are_switched_by_command_and_the_contingency_always_works(self):
        with self.flight() as flight:
            ground = flight.ground()
            wait_until(lambda: self.ping(ground), DEADLINE_S, "ttc answers")
            self.complete(ground, "tc ttc.select_keys set=b")
            self.assertIsNotNone(ground.wait_for(lambda m: m["type"] == "keys" and m["keys"] == "b", DEADLINE_S))
            self.assertTrue(self.ping(ground, DEADLINE_S), "both ends use b")
            kill(flight, "ttc")
            wait_until(lambda: self.ping(ground), DEADLINE_S, "b is remembered on board")

            # Both copies are lost: ttc uses a again, the tool uses b.
            self.configure_anew(flight, self.spoil_the_selection)
            event = ground.wait_for(lambda m: m.get("event") == "ttc.keys_selected" and "damaged" in m["text"], DEADLINE_S)
            self.assertIsNotNone(event)
            # The beacon names the selected keys; the tool follows it.
            self.assertIsNotNone(ground.wait_for(lambda m: m["type"] == "keys" and m["keys"] == "a", 2 * DEADLINE_S))
            self.assertTrue(self.ping(ground, DEADLINE_S))
            ground.end()

            result = self.ground_run("--keys", "b", "ping", "--timeout", "2")
            self.assertEqual(result.returncode, 1, "keys that are not selected")
            result = self.ground_run("--keys", "contingency", "ping", "--timeout", str(DEADLINE_S))
            self.assertEqual(result.returncode, 0, result.stderr)
            result = self.ground_run("--keys", "contingency", "tc", "ttc.select_keys", "set=b", "--wait")
            self.assertEqual(result.returncode, 0, result.stderr)
            result = self.ground_run("ping", "--timeout", str(DEADLINE_S))
            self.assertEqual(result.returncode, 0, result.stderr)

            for log in (self.var / "log").glob("*.log"):
                for key in (self.var / "keys").glob("*.key"):
                    self.assertNotIn(key.read_text().strip(), log.read_text(errors="replace"))

    def test_a_lost_key_file_costs_only_its_association(self):
        with self.flight() as flight:
            self.configure_anew(flight, self.lose_two_keys)
            wait_until(
                lambda: self.ground_run("--keys", "contingency", "ping", "--timeout", "2").returncode == 0, DEADLINE_S, "the contingency works"
            )
            result = self.ground_run("--keys", "b", "ping", "--timeout", str(DEADLINE_S))
            self.assertEqual(result.returncode, 0, "the other set is taken instead: " + result.stderr)


if __name__ == "__main__":
    unittest.main()
