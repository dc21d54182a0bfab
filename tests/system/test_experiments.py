"""The paper's experiments with the real processes. ./run test --full runs all of them with their drawings."""

import json
import subprocess
import unittest

from support import BIN, PYTHON, ROOT, SystemTest


class ExperimentTest(SystemTest):
    def run_experiment(self, *arguments):
        return subprocess.run([PYTHON, "-B", str(ROOT / "tools" / "experiments" / "experiment.py"), *arguments, "--bin", str(BIN)],
                              stdin=subprocess.DEVNULL, capture_output=True, text=True, timeout=200)  # fmt: skip


class ExperimentsTest(ExperimentTest):
    def test_fig14b_and_its_files(self):
        run = self.run_experiment("fig14b", "--out", str(self.folder / "out"), "--var", str(self.var), "--json")

        summary = json.loads(run.stdout)
        self.assertEqual([c["what"] for c in summary["checks"] if not c["ok"]], [], run.stderr)
        self.assertEqual(run.returncode, 0)
        self.assertEqual(json.loads((self.folder / "out" / "summary.json").read_text()), summary)
        rows = (self.folder / "out" / "fig14b.csv").read_text().splitlines()
        self.assertEqual(rows[0], "payload,state,begin_s,end_s")
        self.assertEqual(sum(",occupying_can," in row for row in rows), summary["slots"])

    def test_a_timing_that_blocks_nothing_is_not_fig14b(self):
        # Heartbeats so far apart that even the slow payload is done before the next one.
        deployment = self.deployment(("tick_period_ms: 250", "tick_period_ms: 500"), base="fig14")
        run = self.run_experiment("fig14b", "--out", str(self.folder / "out"), "--var", str(self.var), "--deployment", str(deployment))
        self.assertEqual(run.returncode, 1, run.stdout + run.stderr)
        self.assertIn("NOT OK  payload_eps has the bus over a heartbeat (0 times)", run.stdout)


class Fig15Test(ExperimentTest):
    def test_fig15_and_its_files(self):
        run = self.run_experiment("fig15", "--out", str(self.folder / "out"), "--var", str(self.var), "--json")

        summary = json.loads(run.stdout)
        self.assertEqual([c["what"] for c in summary["checks"] if not c["ok"]], [], run.stderr)
        self.assertEqual(run.returncode, 0)
        self.assertEqual([h["failure"] for h in summary["healed"]], ["killed", "stopped"])
        rows = (self.folder / "out" / "fig15.csv").read_text().splitlines()
        self.assertEqual(rows[0], "payload,state,begin_s,end_s")

    def test_another_order_of_the_ring_is_not_fig15(self):
        deployment = self.deployment(("[payload_adcs, payload_thermal, payload_eps]", "[payload_adcs, payload_eps, payload_thermal]"), base="fig15")
        run = self.run_experiment("fig15", "--out", str(self.folder / "out"), "--var", str(self.var), "--deployment", str(deployment), "--step-deadline", "15")
        self.assertNotEqual(run.returncode, 0, run.stdout + run.stderr)


class Fig16Test(ExperimentTest):
    def test_fig16_and_its_files(self):
        run = self.run_experiment("fig16", "--out", str(self.folder / "out"), "--var", str(self.var), "--json")

        summary = json.loads(run.stdout or "{}")
        self.assertEqual([c["what"] for c in summary.get("checks", [{"ok": False, "what": "no summary"}]) if not c["ok"]], [], run.stderr)
        self.assertEqual(run.returncode, 0)
        self.assertEqual(list(summary["steps_s"]), ["build", "self_test", "store", "swap", "installed"])
        rows = (self.folder / "out" / "fig16.csv").read_text().splitlines()
        self.assertEqual(rows[0], "payload,state,begin_s,end_s")


if __name__ == "__main__":
    unittest.main()
