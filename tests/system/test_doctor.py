# SPDX-FileCopyrightText: 2026 SRFS contributors
# SPDX-License-Identifier: Apache-2.0
"""`srfs doctor` reports what this machine lacks; a node gets what the deployment requests and the machine provides."""

import collections
import json
import re
import subprocess
import unittest

from support import BIN, SystemTest, ToolTest

from srfs import ROOT

LINE = re.compile(r"^(OK|note|unknown|WARN|FAIL) +(\S+) +(\S.*)$")
VERDICTS = ("OK", "note", "unknown", "WARN", "FAIL")
VARYING = {"memory.suites"}  # other tests run beside this one


class DoctorTest(SystemTest):
    def doctor(self, *arguments, code=None, cwd=ROOT):
        command = [str(BIN / "srfs"), "doctor", *arguments, "--var", str(self.var)]
        result = subprocess.run(command, cwd=cwd, stdin=subprocess.DEVNULL, capture_output=True, text=True, timeout=60)
        if code is not None:
            self.assertEqual(result.returncode, code, result.stdout + result.stderr)
        return result

    def lines(self, result):
        """([(verdict, check) of each line], summary line)."""
        *lines, summary = result.stdout.splitlines()
        matches = [LINE.match(line) for line in lines]
        self.assertNotIn(None, matches, result.stdout)
        return [match.group(1, 2) for match in matches], summary

    def test_lines_json_and_exit_code_agree_and_nothing_is_changed(self):
        result = self.doctor("--deployment", "sim")
        found, summary = self.lines(result)
        count = collections.Counter(verdict for verdict, _ in found)
        self.assertEqual(result.returncode, 1 if count["FAIL"] else 0)
        self.assertTrue(summary.startswith("NOT ready for 'sim'" if count["FAIL"] else "Ready for 'sim'"), summary)
        self.assertIn(", ".join(f"{count[v]} {v}" for v in VERDICTS), summary)
        for device in ("can", "rs422", "gps_pulse", "watchdog"):
            self.assertIn(("note", f"device.{device}"), found, "simulated ones")

        result = self.doctor("--deployment", str(ROOT / "launch_config" / "sim.yaml"), "--json")
        report = json.loads(result.stdout)
        verdicts = [finding["verdict"] for finding in report["findings"]]
        self.assertEqual(report["counts"], {v: verdicts.count(v) for v in VERDICTS})
        self.assertEqual(report["ok"], "FAIL" not in verdicts)
        self.assertEqual(result.returncode, 0 if report["ok"] else 1)
        names = {check for _, check in found} - VARYING
        self.assertEqual({finding["check"] for finding in report["findings"]} - VARYING, names)
        for finding in report["findings"]:
            self.assertTrue(finding["found"], finding)
            if finding["verdict"] in ("WARN", "FAIL"):
                self.assertTrue(finding["expected"], finding)
        self.assertFalse(self.var.exists(), "looking makes no folder")

    def test_a_deployment_is_found_by_its_name_from_any_folder(self):
        for arguments in ((), ("--deployment", "sim")):
            self.assertIn("eady for 'sim'", self.doctor(*arguments, cwd=self.folder).stdout)
        self.assertIn("eady for 'board_rk3568'", self.doctor("--deployment", "board_rk3568", cwd="/").stdout)

    def test_a_device_that_is_not_there_fails_and_a_deployment_that_is_not_there_is_a_wrong_question(self):
        file = self.deployment(('"sim:run/watchdog.sock"', '"dev:/dev/no_such_watchdog"'))
        result = self.doctor("--deployment", str(file), code=1)
        found, _ = self.lines(result)
        self.assertIn(("FAIL", "device.watchdog"), found)
        self.assertIn("-> dmesg", next(line for line in result.stdout.splitlines() if "device.watchdog" in line))
        self.doctor("--deployment", "no_such_deployment", code=2)
        self.doctor("--no-such-option", code=2)
        self.assertIn("OK, note, unknown, WARN or FAIL", " ".join(self.doctor("--help", code=0).stdout.split()))


class HeldMemoryTest(ToolTest):
    def test_a_node_holds_its_memory_or_says_once_why_not_and_works_all_the_same(self):
        self.file = self.folder / "t.yaml"
        self.file.write_text(
            "deployment: t\nnodes:\n"
            "  - { name: held, executable: faulty_node, memory: { lock: true, stack_kib: 512 }, parameters: { configure_ms: 20 } }\n"
            "  - { name: free, executable: faulty_node, parameters: { configure_ms: 20 } }\n")
        self.addCleanup(lambda: self.srfs("down"))
        result = self.srfs("up")
        self.assertEqual(result.returncode, 0, result.stdout + result.stderr)
        states = {node["name"]: node for node in self.json("status")}

        def kib(node, key):
            text = open(f"/proc/{states[node]['pid']}/status").read()
            return int(re.search(rf"^{key}:\s+(\d+) kB$", text, re.MULTILINE).group(1))

        log = (self.var / "log" / "held.log").read_text()
        if "memory is locked" in log:
            self.assertGreater(kib("held", "VmLck"), 10_000)
            self.assertLess(kib("held", "VmRSS"), 100_000, "stacks of threads that nobody touched cost nothing")
        else:
            self.assertEqual(log.count("memory is not locked"), 1)
            self.assertIn("limits.d", log)
        self.assertGreaterEqual(kib("held", "VmStk"), 512)
        self.assertEqual(kib("free", "VmLck"), 0)


if __name__ == "__main__":
    unittest.main()
