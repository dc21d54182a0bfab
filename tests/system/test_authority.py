# SPDX-FileCopyrightText: 2026 SRFS contributors
# SPDX-License-Identifier: Apache-2.0
"""Who has no key orders nothing: a process in the suite's DDS domain, a hostile node of the suite (tests/system/rogue.cpp), srfs of another
user."""

import contextlib
import json
import os
import subprocess
import unittest

from support import BIN, DEADLINE_S, SystemTest, restarts, wait_for_slots

from srfs.flight.deployments import PAYLOADS
from srfs.flight.mission import keys_folder
from srfs.flight.processes import wait_until

MEMBER = ("--member", "--claim", "sim/payload_adcs/9")  # a node of the suite that turned hostile
ACTIVATE, DEACTIVATE = 3, 4  # transitions of lifecycle_msgs
# Target, APID, function, arguments as srfs-ground would send them.
POWER_CYCLE = ("payload_eps", 17, 17, "00c8")  # eps.power_cycle_peripheral, hazardous
RING_HOLD = ("maintenance", 48, 1, "0c" + b"payload_adcs".hex())
LAST_FORGED_ID = 2**62 + 9  # of ten
PACKAGE_INSTALL = ("maintenance", 48, 12, "09" + b"x.package".hex() + "01")
NOBODY = ("setpriv", "--reuid=nobody", "--regid=nogroup", "--clear-groups")


class Rogue:
    """Runs one attack. What it prints comes line by line."""

    def __init__(self, flight, *words):
        command = [BIN / "rogue", flight.var, *map(str, words)]
        self.process = subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)

    def says(self):
        line = self.process.stdout.readline()
        if not line:
            raise AssertionError(f"the rogue ended with {self.process.wait()}")
        return json.loads(line)

    def go_on(self):
        self.process.stdin.write("\n")
        self.process.stdin.flush()

    def __enter__(self):
        return self

    def __exit__(self, *_):
        with contextlib.suppress(OSError):
            self.process.stdin.close()
        self.process.wait(DEADLINE_S)
        self.process.stdout.close()


class AuthorityTest(SystemTest):
    def attack(self, flight, *words):
        with Rogue(flight, *words) as rogue:
            return rogue.says()

    def rejected(self, ground, topic, who=""):
        self.wait_for_event(
            ground, "node.foreign_samples", matches=lambda m: m["fields"]["topic"] == topic and m["fields"]["participant"].startswith(who)
        )

    def srfs_of_nobody(self, flight, *words):
        """Runs srfs as another user, who knows the deployment and the DDS domain; as this one, with that one's files, where users cannot be
        changed."""
        var = self.folder / "nobody"
        (var / "run").mkdir(parents=True, exist_ok=True)
        (var / "run/dds_domain").write_text((flight.var / "run/dds_domain").read_text())
        self.folder.chmod(0o711)
        command = [BIN / "srfs", *map(str, words), "--deployment", flight.deployment, "--var", var]
        may_start = os.geteuid() == 0 and subprocess.run([*NOBODY, "test", "-x", BIN / "srfs"]).returncode == 0
        return subprocess.run([*NOBODY, *command] if may_start else command, stdin=subprocess.DEVNULL, capture_output=True, text=True, timeout=60)

    def test_neither_a_stranger_nor_a_node_without_the_key_of_another_commands_it(self):
        with self.flight() as flight:
            ground = flight.ground()

            # A hazardous telecommand that nobody armed, orders about the ring and about programs.
            orders = (POWER_CYCLE, RING_HOLD, PACKAGE_INSTALL)
            for order in orders:
                self.assertEqual(self.attack(flight, "telecommand", *order), {"published": 10})
            self.rejected(ground, "/telecommand", "'/' at 127.0.0.1")
            for order in orders:
                self.assertEqual(self.attack(flight, "telecommand", *order, *MEMBER), {"published": 10})
            self.rejected(ground, "/telecommand", "wrong proof: telecommand")

            # A telecommand of ttc's own, again after it was done and undone.
            hold = flight.var / "state/payload_adcs/hold"
            self.assertFalse(hold.exists())
            with Rogue(flight, "replay", "maintenance", *MEMBER) as rogue:
                self.assertEqual(rogue.says(), {"listening": True})
                self.complete(ground, "tc ring.hold node=payload_adcs")
                self.assertIn("heard", rogue.says())
                self.complete(ground, "tc ring.release node=payload_adcs")
                rogue.go_on()
                self.assertEqual(rogue.says(), {"replayed": 10})
            self.complete(ground, "tc ring.release node=payload_adcs")
            self.assertFalse(hold.exists())

            # The suite's key alone is lost: ttc has it, and the nodes have theirs of it.
            key = keys_folder(flight.var) / "command_key"
            before = key.read_bytes()
            key.unlink()
            self.complete(ground, "tc ring.release node=payload_adcs")
            wait_until(lambda: self.complete(ground, "tc ring.release node=payload_adcs") and key.exists(), DEADLINE_S, "the key")
            self.assertEqual(key.read_bytes(), before)

            # Orders by the services of ROS 2.
            self.assertEqual(self.attack(flight, "transition", "ttc", DEACTIVATE), {"success": False})
            self.rejected(ground, "~/change_state")
            answer = self.attack(flight, "parameter", "timing", "tick_period_ms", 1000)
            self.assertEqual(answer, {"success": False, "reason": "refused: not from the suite"})
            for words in (("lifecycle", "ttc", "deactivate"), ("param", "set", "timing", "tick_period_ms", 1000)):
                refused = self.srfs_of_nobody(flight, *words)
                self.assertEqual(refused.returncode, 1, refused)
                self.assertIn("dds.orders is proven", refused.stderr)
            self.assertEqual({n["state"] for n in flight.status()}, {"active"})
            self.assertNotIn("by telecommand", (flight.var / "log/payload_eps.log").read_text())
            self.assertEqual(flight.srfs("param", "set", "payload_eps", "parameter_trial_s", "200").returncode, 0)

            # What was held back for 10 s since the first report.
            self.rejected(ground, "/telecommand", f"wrong proof: telecommand {LAST_FORGED_ID}, function {PACKAGE_INSTALL[2]}")
            self.assertEqual(ground.select(lambda m: m["type"] == "event" and m.get("event", "").startswith("update.")), [])
            self.assertFalse(hold.exists())


class ForgedTopicsTest(SystemTest):
    def test_flags_and_ticks_of_one_that_claims_to_be_can_switcher_cost_no_payload_its_slots(self):
        with self.flight() as flight:
            ground, recorder = flight.ground(), flight.recorder()
            for payload in PAYLOADS:
                wait_for_slots(recorder, payload, "released", 2, 0)
            before = restarts(flight)
            with Rogue(flight, "bus", *PAYLOADS, "--claim", "sim/can_switcher/1") as rogue:
                self.assertEqual(rogue.says(), {"forged": 20})
                forged, seen = recorder.position(), ground.position()
                for payload in PAYLOADS:
                    wait_for_slots(recorder, payload, "released", 5, forged)
                for topic in ("/can/task_flags", "/timing/tick"):
                    self.wait_for_event(ground, "node.foreign_samples", seen, lambda m: m["fields"]["topic"] == topic)  # noqa: B023
            # Who believed one of them ignored all true flags from then on, and was killed at the end of its lease.
            self.assertEqual(restarts(flight), before)
            claimed = ("transition", "ttc", DEACTIVATE, "--claim", "sim/srfs/1")
            with Rogue(flight, *claimed) as rogue:
                self.assertEqual(rogue.says(), {"success": False})
            # All of this in a name of its own, whatever it claims to be: nothing passes for a member's datagram.
            for log in sorted((flight.var / "log").glob("*.log")):
                self.assertNotIn("forged datagrams", log.read_text(errors="replace"), log.name)


class OpenOrdersTest(SystemTest):
    def test_where_the_deployment_says_so_anybody_commands(self):
        with self.flight("sim_open") as flight:
            for transition in (DEACTIVATE, ACTIVATE):
                with Rogue(flight, "transition", "payload_eps", transition) as rogue:
                    self.assertEqual(rogue.says(), {"success": True})
            for order in (POWER_CYCLE, RING_HOLD):
                with Rogue(flight, "telecommand", *order) as rogue:
                    self.assertEqual(rogue.says(), {"published": 10})
            log = flight.var / "log/payload_eps.log"
            wait_until(lambda: "by telecommand" in log.read_text(), DEADLINE_S, "the power cycle")
            wait_until(lambda: (flight.var / "state/payload_adcs/hold").exists(), DEADLINE_S, "payload_adcs held")


if __name__ == "__main__":
    unittest.main()
