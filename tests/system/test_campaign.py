"""The fencing campaign in its short form. ./run test --full runs the long one."""

import json
import subprocess
import unittest

from support import BIN, PYTHON, ROOT, SystemTest


class FencingCampaignTest(SystemTest):
    def test_two_hundred_slots_with_stopped_and_killed_processes(self):
        out = self.folder / "out"
        run = subprocess.run([PYTHON, "-B", str(ROOT / "tests" / "campaign" / "campaign.py"), "fencing", "--slots", "200", "--json",
                              "--out", str(out), "--var", str(self.var), "--bin", str(BIN)],
                             stdin=subprocess.DEVNULL, capture_output=True, text=True, timeout=220)  # fmt: skip
        self.assertIn(run.returncode, (0, 1), run.stderr)
        summary = json.loads(run.stdout)
        self.assertEqual([c for c in summary["checks"] if not c["ok"]], [], f"seed {summary['seed']}\n{run.stderr}")
        self.assertEqual(run.returncode, 0)
        self.assertEqual(json.loads((out / "summary.json").read_text()), summary)
        self.assertGreaterEqual(summary["slots"], 200)
        self.assertGreater(sum(kind["count"] for kind in summary["faults"].values()), 0)
        self.assertTrue((out / "can.log").stat().st_size and (out / "faults.csv").read_text().count("\n") > 1)


if __name__ == "__main__":
    unittest.main()
