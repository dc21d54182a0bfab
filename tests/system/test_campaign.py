# SPDX-FileCopyrightText: 2026 SRFS contributors
# SPDX-License-Identifier: Apache-2.0
"""The campaigns in their short form. ./run test --full runs the long ones."""

import json
import subprocess
import unittest

from support import BIN, PROGRAM, SystemTest


class CampaignTest(SystemTest):
    def run_campaign(self, *arguments, timeout_s=600):
        """Runs a campaign in which every check must hold. Returns its summary and output folder."""
        out = self.folder / "out"
        run = subprocess.run([*PROGRAM, "srfs.campaign", *arguments, "--json",
                              "--out", str(out), "--var", str(self.var), "--bin", str(BIN)],
                             stdin=subprocess.DEVNULL, capture_output=True, text=True, timeout=timeout_s)  # fmt: skip
        self.assertTrue(run.returncode in (0, 1) and run.stdout, run.stderr)
        summary = json.loads(run.stdout)
        self.assertEqual([c for c in summary["checks"] if not c["ok"]], [], f"seed {summary['seed']}\n{run.stderr}")
        self.assertEqual(run.returncode, 0)
        self.assertEqual(json.loads((out / "summary.json").read_text()), summary)
        return summary, out


class FaultCampaignTest(CampaignTest):
    def test_classes_of_failure_are_healed_by_the_ring_and_nobody_else_is_restarted(self):
        summary, out = self.run_campaign("faults", "--class", "kill,stop,abort,stale_nonce,no_binary,bad_version", "--nodes", "payload_eps,ttc", "--subsets", "2",
                                         "--misses", "5")  # other programs may share the CPUs
        table = {row["class"]: row for row in summary["table"]}
        self.assertEqual({name: row["trials"] for name, row in table.items()},
                         {"kill": 2, "stop": 2, "abort": 2, "stale_nonce": 2, "no_binary": 2, "bad_version": 2, "subset": 2})  # fmt: skip
        self.assertTrue(all(row["recovered"] == row["trials"] and row["false_restarts"] == 0 for row in table.values()), table)
        self.assertGreater(summary["telecommands"]["executed"], 0)
        self.assertIn("| kill | SIGKILL | 2 of 2 |", (out / "report.md").read_text())
        self.assertGreater((out / "trials.csv").read_text().count("\n"), 11)


class OverloadCampaignTest(CampaignTest):
    def test_beside_programs_that_take_the_cpus_who_is_ill_is_healed_and_nobody_else_is_restarted(self):
        summary, _ = self.run_campaign("overload", "--class", "stop,loop", "--nodes", "maintenance", "--calm", "5", "--flood", "10", "--misses", "5")
        table = {row["class"]: row for row in summary["table"]}
        self.assertEqual({name: row["recovered"] for name, row in table.items()}, {"stop": 1, "loop": 1, "hog": 1, "soak": 1, "overload": 1})
        self.assertGreater(summary["telecommands"]["executed"], 0)


class StrangersCampaignTest(CampaignTest):
    def test_a_flood_from_outside_the_suite_restarts_no_node(self):
        summary, _ = self.run_campaign("strangers", "--seconds", "1", "--settle", "0")
        self.assertEqual(summary["restarts"], 0)
        self.assertTrue(all(count > 0 for count in summary["sent"].values()), summary["sent"])


class FencingCampaignTest(CampaignTest):
    def test_two_hundred_slots_with_stopped_and_killed_processes(self):
        summary, out = self.run_campaign("fencing", "--slots", "200")
        self.assertGreaterEqual(summary["slots"], 200)
        self.assertGreater(sum(kind["count"] for kind in summary["faults"].values()), 0)
        self.assertTrue((out / "can.log").stat().st_size and (out / "faults.csv").read_text().count("\n") > 1)


if __name__ == "__main__":
    unittest.main()
