# SPDX-FileCopyrightText: 2026 SRFS contributors
# SPDX-License-Identifier: Apache-2.0
"""The demo script from end to end, as a new user runs it."""

import json
import signal
import subprocess
import unittest

from support import BIN, DEADLINE_S, PROGRAM, SystemTest

from srfs.flight.deployments import PAYLOADS
from srfs.flight.processes import wait_until


class DemoTest(SystemTest):
    def start(self, *options):
        return subprocess.Popen(
            [*PROGRAM, "srfs.demo", "--bin", str(BIN), "--var", str(self.var), *options],
            stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True,
        )  # fmt: skip

    def test_script_runs_as_expected_and_ends_with_a_summary(self):
        output, _ = self.start("--duration", "20").communicate(timeout=400)
        try:
            summary = json.loads(output.strip().splitlines()[-1])
        except (ValueError, IndexError):
            self.fail(f"no summary:\n{output}")

        self.assertEqual(summary["failures"], [], output)
        self.assertTrue(summary["ok"], output)
        self.assertGreater(summary["ticks"], 100)
        for payload in PAYLOADS:
            self.assertGreater(summary["slots"][payload]["used"], 10)
        self.assertGreater(summary["telecommands"]["completed"], 5)
        self.assertEqual(summary["measures"]["overlapping_grants"], 0)
        self.assertNotIn("\033", output, "no terminal codes without a terminal")
        self.assert_nothing_left(self.var)

    def test_termination_in_the_middle_ends_everything_and_is_no_success(self):
        demo = self.start("--json")
        wait_until(lambda: (self.var / "run" / "ttc.lock").exists() or demo.poll() is not None, DEADLINE_S, "the suite starts")
        demo.send_signal(signal.SIGTERM)
        output, _ = demo.communicate(timeout=DEADLINE_S)

        self.assertEqual(demo.returncode, 1, output)
        self.assertFalse(json.loads(output.strip().splitlines()[-1])["ok"])
        self.assert_nothing_left(self.var)


if __name__ == "__main__":
    unittest.main()
