# SPDX-FileCopyrightText: 2026 SRFS contributors
# SPDX-License-Identifier: Apache-2.0
"""A node is added to the running suite and removed again: the impact payload of examples/payload_impact."""

import json
import os
import signal
import struct
import subprocess
import unittest

from support import BIN, DEADLINE_S, SystemTest, ToolTest, slots, wait_for_slots

from srfs import ROOT
from srfs.flight.deployments import NODES, PAYLOADS
from srfs.flight.processes import lock_owner, wait_until

PACKAGE = ROOT / "examples" / "payload_impact"
PROGRAM = BIN / "payload_impact_node"
ADDED = "payload_impact"


class AddedPayloadTest(SystemTest):
    def add(self, flight):
        result = flight.srfs("node", "add", str(PACKAGE), "--program", str(PROGRAM))
        self.assertEqual(result.returncode, 0, result.stdout + result.stderr)

    def holders(self, recorder, since=0):
        return [m["holder"] for m in recorder.select(lambda m: m["type"] == "flags" and m["holder"], since)]

    def assert_no_turn_was_lost(self, holders):
        """Without the added payload's turns, the other payloads follow each other in the usual order."""
        others = [holder for holder in holders if holder != ADDED]
        first = PAYLOADS.index(others[0])
        self.assertEqual(others, [PAYLOADS[(first + i) % 3] for i in range(len(others))])

    def wait_for_fault(self, flight):
        def faults():
            lines = [json.loads(line) for line in flight.srfs("faults", "--node", ADDED).stdout.splitlines()]
            return [line for line in lines if line.get("outcome_text") == "restarted"]

        wait_until(faults, DEADLINE_S, f"a restart of {ADDED} in the ledger")
        return faults()[-1]

    def test_a_fourth_payload_joins_ring_slots_and_dictionary_and_leaves_them_again(self):
        with self.flight() as flight:
            recorder = flight.recorder()
            before = flight.ground()
            for payload in PAYLOADS:
                wait_for_slots(recorder, payload, "released", 3, 0)
            self.assertEqual(before.command("tc impact.clear")["type"], "error", "no such telecommand yet")
            pids = {node: flight.node_pid(node) for node in NODES}
            before.end()

            # Its slot comes around.
            self.add(flight)
            wait_for_slots(recorder, ADDED, "released", 5, 0)
            self.assertIn(ADDED, [node["name"] for node in flight.status() if node["state"] == "active"])
            holders = self.holders(recorder)
            after_thermal = [b for a, b in zip(holders, holders[1:]) if a == "payload_thermal"]
            self.assertEqual(after_thermal[-3:], [ADDED] * 3)

            # Its upstream node checks and restarts it.
            watched = recorder.wait_for(
                lambda m: m["type"] == "liveness" and m["subject"] == ADDED and m["verdict"] == "alive" and m["observer"] == "payload_thermal", DEADLINE_S)
            self.assertIsNotNone(watched)
            wait_until(lambda: recorder.select(lambda m: m["type"] == "liveness" and m["observer"] == ADDED and m["verdict"] == "alive"),
                       DEADLINE_S, f"{ADDED} checks its own downstream")
            old = flight.node_pid(ADDED)
            os.kill(old, signal.SIGKILL)
            wait_until(lambda: flight.node_pid(ADDED) not in (None, old), DEADLINE_S, f"{ADDED} restarted")
            self.assertEqual(self.wait_for_fault(flight)["observer"], "payload_thermal")
            wait_for_slots(recorder, ADDED, "released", 5, recorder.position())

            # The ground decodes its telemetry, and its telecommands reach its peripheral once.
            ground = flight.ground()
            packet = ground.housekeeping("payload_impact", DEADLINE_S)
            self.assertIsNotNone(packet, "no telemetry of the added payload")
            self.assertIn("threshold_v", packet["fields"])
            outcome = ground.command("tc impact.set_threshold threshold_v=0.5")
            self.assertTrue(outcome["type"] == "tc_stage" and outcome["success"], outcome)
            self.assertIsNotNone(ground.housekeeping("payload_impact", DEADLINE_S, matches=lambda fields: "0.5" in json.dumps(fields["threshold_v"])))
            self.assertEqual(flight.control({"query": "executed"})["executed"]["impact"]["count"], 1)
            refused = ground.command("tc impact.power_cycle_peripheral")
            self.assertFalse(refused.get("success"), "it is hazardous and not armed")
            self.assertIsNotNone(ground.housekeeping("added_nodes", 60, matches=lambda fields: ADDED in json.dumps(fields["names"])))

            # The other nodes are unaffected.
            self.assert_no_turn_was_lost(self.holders(recorder))
            for payload in PAYLOADS:
                self.assertEqual(slots(recorder, payload, "failed"), [])
            self.assertEqual({node: flight.node_pid(node) for node in NODES}, pids)

            # Remove it.
            result = flight.srfs("node", "remove", ADDED)
            self.assertEqual(result.returncode, 0, result.stdout + result.stderr)
            self.assertIsNone(flight.node_pid(ADDED))
            left = ground.wait_for(lambda m: m.get("event") == "suite.node_left", DEADLINE_S)
            self.assertIsNotNone(left, "ttc says that it left")
            since = recorder.position()
            for payload in PAYLOADS:
                wait_for_slots(recorder, payload, "released", 5, since)
            self.assertNotIn(ADDED, self.holders(recorder, since))
            outcome = ground.command("tc impact.clear")
            self.assertFalse(outcome.get("success"), "nobody is there to take it")
            self.assertEqual([node["name"] for node in flight.status()], list(NODES))
            self.assert_no_turn_was_lost(self.holders(recorder))
            self.assertEqual({node: flight.node_pid(node) for node in NODES}, pids)
            self.assertFalse((self.var / "versions" / ADDED).exists())


NODES_OF_THE_TOOL_TEST = """
nodes:
  - { name: first, executable: faulty_node, parameters: { configure_ms: 20 } }
  - { name: second, executable: faulty_node, parameters: { configure_ms: 20 } }
"""


class KilledToolTest(ToolTest):
    """The tool is killed at each of its changes to the disk. The suite is then completely the old or the new one, and continues."""

    def setUp(self):
        super().setUp()
        self.file = self.folder / "t.yaml"
        self.file.write_text(f"deployment: t\nring: {{ period_ms: 100, misses: 5, restarts: 1000, quarantine_deaths: 1000 }}\n{NODES_OF_THE_TOOL_TEST}")
        self.var.mkdir()
        self.package = self.folder / "package"
        self.package.mkdir()
        (self.package / "package.yaml").write_text("node: extra\ndeployment_entry: entry.yaml\n")
        (self.package / "entry.yaml").write_text("parameters: { configure_ms: 20 }\n")
        self.program = self.folder / "program"
        self.program.write_text(f'#!/bin/sh\nexec {BIN}/faulty_node "$@"\n')
        self.point = self.folder / "point"
        self.addCleanup(lambda: self.srfs("down"))

    def killed_at(self, call, *arguments):
        """Runs the tool. Returns True if it was killed at its call-th change."""
        self.point.write_bytes(struct.pack("=QQQ", call, 1, 1))
        environment = {**os.environ, "LD_PRELOAD": f"{BIN.parent}/lib/libsrfs_crash_point.so", "SRFS_CRASH_POINT": str(self.point)}
        command = [str(BIN / "srfs"), *arguments, "--deployment", str(self.file), "--var", str(self.var)]
        result = subprocess.run(command, stdin=subprocess.DEVNULL, capture_output=True, text=True, timeout=60, env=environment)
        self.assertIn(result.returncode, (0, -signal.SIGKILL), result.stdout + result.stderr)
        return result.returncode != 0

    def is_added(self):
        listed = self.json("node", "list")
        self.assertIn([node["name"] for node in listed["nodes"]], ([], ["extra"]))
        return bool(listed["nodes"])

    def pid(self):
        return lock_owner(self.var / "run" / "extra.lock")

    def wait_until_whole(self):
        """Waits until an added node runs, restarted by the ring if need be, or a removed one has no process. Returns whether it is added."""
        added = self.is_added()
        wait_until(lambda: (self.pid() is not None) == added, DEADLINE_S, f"extra {'runs' if added else 'is gone'}")
        return added

    def test_adding_and_removing(self):
        self.assertEqual(self.srfs("up").returncode, 0)
        add = ("node", "add", str(self.package), "--program", str(self.program))
        remove = ("node", "remove", "extra")
        seen = {"add": set(), "remove": set()}
        for step, arguments in (("add", add), ("remove", remove)):
            call = 1
            while True:
                present = self.is_added()
                if present != (step == "remove"):
                    self.assertEqual(self.srfs(*(add if step == "remove" else remove)).returncode, 0)
                    self.wait_until_whole()
                killed = self.killed_at(call, *arguments)
                seen[step].add(self.wait_until_whole())
                if not killed:
                    break
                call += 1
            self.assertGreater(call, 4, "the tool was killed several times")
            self.assertEqual(seen[step], {True, False}, "before and after the commit point")
        states = {node["name"]: node["state"] for node in json.loads(self.srfs("status", "--json").stdout)}
        self.assertEqual(states, {"first": "active", "second": "active"})


if __name__ == "__main__":
    unittest.main()
