# SPDX-FileCopyrightText: 2026 SRFS contributors
# SPDX-License-Identifier: Apache-2.0
"""An operator's tools for a node that keeps dying: `srfs faults`, `srfs ring`."""

import json
import os
import signal

from support import DEADLINE_S, ToolTest

from srfs.flight.processes import wait_until

DEPLOYMENT = """
deployment: t
nodes:
  - { name: faulty, executable: faulty_node, parameters: { configure_ms: 20 } }
  - { name: second, executable: faulty_node, parameters: { configure_ms: 20 } }
"""


def crc32c(data):
    remainder = 0xFFFFFFFF
    for octet in data:
        remainder ^= octet
        for _ in range(8):
            remainder = remainder >> 1 ^ (0x82F63B78 if remainder & 1 else 0)
    return remainder ^ 0xFFFFFFFF


def ledger_line(**changes):
    """A line of VAR/state/ring/faults.log as docs/how-to/inspect_the_suite.md describes it."""
    record = {
        "kind": "fault", "seq": 1, "utc": "2026-11-21T08:00:00.250000Z", "mono_ns": 1000, "boot": "b", "observer": "timing",
        "subject": "faulty", "class": 2, "class_text": "exited", "misses": 0, "detail": "", "cause": "signal 11 (SIGSEGV)",
        "kernel_state": "-", "old": 1, "new": 2, "outcome": 1, "outcome_text": "restarted", "reason": "",
        "last_turn_age_us": 5000, "judged_us": 100, "killed_us": 250, "started_us": 31000, "active_us": None,
    }
    text = json.dumps({**record, **changes}, separators=(",", ":"))
    return f"{text}\t{crc32c(text.encode()):08x}\n"


class RingToolsTest(ToolTest):
    def setUp(self):
        super().setUp()
        self.file = self.folder / "t.yaml"
        self.file.write_text(DEPLOYMENT)
        self.var.mkdir()
        self.addCleanup(lambda: self.srfs("down"))

    def standing(self, node):
        return {n["name"]: n for n in self.json("ring", "status")}[node]["standing"]

    def test_faults_are_shown_while_nothing_runs_and_damaged_lines_are_counted(self):
        self.assertEqual(self.srfs("faults").stdout, "no faults\n")
        ledger = self.var / "state" / "ring" / "faults.log"
        ledger.parent.mkdir(parents=True)
        ledger.write_text(
            ledger_line()
            + ledger_line(kind="active", seq=2, active_us=120500)
            + ledger_line(seq=3, cause="never")[:-9]  # torn, so that the next line is unreadable too
            + ledger_line(seq=4, cause="nor this")
            + ledger_line(seq=5, subject="second", utc="2026-11-21T09:00:00Z", outcome=5, outcome_text="quarantined", new=0))
        result = self.srfs("faults")
        self.assertEqual(result.returncode, 0)
        lines = result.stdout.splitlines()
        self.assertEqual(len(lines), 3, result.stdout)
        for part in ("faulty", "timing", "exited", "1 > 2", "restarted", "0.1", "0.2", "31.0", "120.5", "signal 11 (SIGSEGV)"):
            self.assertIn(part, lines[1])
        self.assertIn("1 damaged lines were skipped", result.stderr)
        self.assertEqual(len(self.srfs("faults", "--node", "second").stdout.splitlines()), 2)
        self.assertEqual(len(self.srfs("faults", "--since", "2026-11-21T08:30:00Z").stdout.splitlines()), 2)
        records = [json.loads(line) for line in self.srfs("faults", "--json").stdout.splitlines()]
        self.assertEqual([r["seq"] for r in records], [1, 2, 5])
        self.assertEqual(self.srfs("faults", "--since", "yesterday").returncode, 2)

    def test_a_held_node_stays_down_until_it_is_released_and_starts_in_the_state_that_was_asked_for(self):
        self.assertEqual(self.srfs("ring", "hold", "faulty", "--reason", "looking at its log").returncode, 0)
        result = self.srfs("up")
        self.assertEqual(result.returncode, 0, result.stdout + result.stderr)
        self.assertIn("faulty is held: looking at its log", result.stderr)
        self.assertEqual(self.standing("faulty"), "held: looking at its log")
        self.assertEqual(self.standing("second"), "guarded")
        self.assertEqual(self.srfs("ring", "release", "faulty", "--state", "inactive").returncode, 0)
        self.assertEqual(self.standing("faulty"), "to be started")
        result = self.srfs("up")
        self.assertEqual(result.returncode, 0, result.stdout + result.stderr)
        states = {n["name"]: n["state"] for n in self.json("status")}
        self.assertEqual(states, {"faulty": "inactive", "second": "active"})

    def test_a_node_that_crashes_leaves_its_backtrace_in_its_log(self):
        self.assertEqual(self.srfs("up").returncode, 0)
        pid = {n["name"]: n["pid"] for n in self.json("status")}["faulty"]
        os.kill(pid, signal.SIGSEGV)
        log = self.var / "log" / "faulty.log"
        wait_until(lambda: "*** end of backtrace" in log.read_text(), DEADLINE_S, "the backtrace")
        self.assertIn(f"*** fatal signal 11 (SIGSEGV) in thread faulty_node of pid {pid}", log.read_text())
        self.assertIn("libsrfs_ros", log.read_text())

    def test_what_cannot_be_done_is_refused_with_a_reason(self):
        self.assertEqual(self.srfs("ring", "hold", "nobody").returncode, 2)
        self.assertEqual(self.srfs("ring", "release", "nobody").returncode, 2)
        self.assertEqual(self.srfs("up").returncode, 0)
        result = self.srfs("ring", "release", "faulty", "--state", "inactive")
        self.assertEqual(result.returncode, 1)
        self.assertIn("faulty is running", result.stderr)
