# SPDX-FileCopyrightText: 2026 SRFS contributors
# SPDX-License-Identifier: Apache-2.0
"""`srfs-ground pass` and `first-contact`: a plan over several short passes that are cut, on a real suite."""

import json
import random
import signal
import subprocess
import unittest
from datetime import datetime, timedelta, timezone

from support import BIN, DEADLINE_S, SystemTest
from test_serve import Server

from srfs.flight.processes import processes_of, wait_until

PLAN = """
plan: short
station: { name: here, latitude_deg: 47.4, longitude_deg: 8.5 }
orbit: { times: times.txt }
queries: [housekeeping.one_shot structure=payload_eps]
script: lines.txt
up:
  - { file: up.bin, priority: 1 }
down:
  - { folder: products, pattern: "*.bin", priority: 2 }
"""
LINES = "tc eps.switch_load load=1 state=on\ntc eps.switch_load load=2 state=on\nwait 1s\ntc eps.switch_load load=2 state=off\n"


class PassTest(SystemTest):
    def setUp(self):
        super().setUp()
        content = random.Random(5)
        self.products = {f"strip_{i}.bin": content.randbytes(200_000) for i in range(4)}
        self.sent = content.randbytes(50_000)
        (self.folder / "up.bin").write_bytes(self.sent)
        (self.folder / "lines.txt").write_text(LINES)
        (self.folder / "times.txt").write_text("2099-01-01T08:00:00Z 2099-01-01T08:08:00Z\n")
        self.plan = self.folder / "plan.yaml"
        self.plan.write_text(PLAN)

    def program(self, *words):
        command = [str(BIN / "srfs-ground"), "--port", str(self.var / "rs422"), "--json", *words]
        return subprocess.Popen(command, stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True)

    def fly(self, seconds, cut_at=None):
        """One run. cut_at: how it is killed, when an item's news matches."""
        process = self.program("pass", "run", str(self.plan), "--duration", str(seconds))
        said = []
        for line in process.stdout:
            said.append(line)
            if cut_at and cut_at(line):
                process.kill()
                break
        process.stdout.close()
        process.wait(timeout=DEADLINE_S)
        return process.returncode, said

    def report(self):
        result = self.ground_run("--json", "pass", "report", str(self.plan))
        self.assertEqual(result.returncode, 0, result.stderr)
        return json.loads(result.stdout)

    def states(self):
        return {(item["kind"], item["what"]): item["state"] for item in self.report()["items"]}

    def switched(self):
        """The arguments of each switch_load in the archive, in order."""
        lines = self.ground_run("--json", "commands").stdout.splitlines()
        commands = [json.loads(line) for line in lines]
        return [" ".join(c["arguments"]) for c in commands if c["name"] == "eps.switch_load"]

    def test_three_short_passes_that_are_cut_do_everything_once(self):
        with self.flight():
            (self.var / "files/products").mkdir(parents=True)
            for name, content in self.products.items():
                (self.var / "files/products" / name).write_bytes(content)
            server = Server(self.var)
            try:
                # Killed while the second telecommand is under way: whether it was sent only the archive knows.
                code, _ = self.fly(60, cut_at=lambda line: "load=2 state=on" in line and '"ordered"' in line)
                self.assertEqual(code, -signal.SIGKILL)
                left = [what for what, state in self.states().items() if state != "done"]
                self.assertTrue(left)
                # Killed with a file under way.
                code, _ = self.fly(60, cut_at=lambda line: '"comes down"' in line)
                self.assertEqual(code, -signal.SIGKILL)
                code, said = self.fly(120)
                self.assertEqual(code, 0, said)
            finally:
                self.assertEqual(server.end(), 0)
            report = self.report()
            not_done = [item for item in report["items"] if item["state"] != "done"]
            self.assertEqual(not_done, [])
            self.assertEqual(self.switched(), ["load=1 state=on", "load=2 state=on", "load=2 state=off"], "each once, in order")
            self.assertEqual((self.var / "files/up.bin").read_bytes(), self.sent)
            arrived = {path.name.split("-", 1)[1]: path.read_bytes() for path in (self.var / "ground/files/passes/short").iterdir()}
            self.assertEqual(arrived, self.products)
            self.assertEqual([p["ended"] is None for p in report["flown"]], [True, True, False])
            text = (self.var / "ground/passes/short.md").read_text()
            self.assertIn("the program ended before the pass did", text)

    def test_a_second_run_of_the_same_plan_is_refused_meanwhile(self):
        with self.flight():
            (self.folder / "lines.txt").write_text("wait 20s\n")
            first = self.program("pass", "run", str(self.plan), "--duration", "60")
            wait_until(lambda: (self.var / "ground/passes/short.lock").exists(), DEADLINE_S, "the first run has begun")
            second = self.ground_run("pass", "run", str(self.plan), "--duration", "60")
            self.assertEqual(second.returncode, 2)
            self.assertIn("is being flown by another srfs-ground", second.stderr)
            first.send_signal(signal.SIGINT)
            first.communicate(timeout=DEADLINE_S)
            self.assertEqual(first.returncode, 1)
            self.assertEqual(self.report()["flown"][-1]["end"], "interrupted")

    def test_first_contact_says_how_the_spacecraft_is(self):
        with self.flight():
            contact = self.ground_run("--json", "first-contact", "--duration", "60")
            self.assertEqual(contact.returncode, 0, contact.stdout + contact.stderr)
            findings = [f["what"] for f in json.loads(contact.stdout.splitlines()[-1])["findings"]]
            for begin in ("boot ", "mode ", "its clock ", "keys: ", "it turns by "):
                self.assertTrue(any(what.startswith(begin) for what in findings), (begin, findings))

    def test_a_rehearsal_flies_the_plan_against_a_spacecraft_of_its_own(self):
        with self.flight() as flight:
            (self.folder / "times.txt").write_text(self.soon())
            command = [str(BIN / "srfs-ground"), "--port", str(self.var / "rs422"), "pass", "run", str(self.plan), "--rehearse"]
            rehearsed = subprocess.run(command, stdin=subprocess.DEVNULL, capture_output=True, text=True, timeout=4 * DEADLINE_S)
            self.assertEqual(rehearsed.returncode, 0, rehearsed.stdout + rehearsed.stderr)
            self.assertIn("rehearsal of the pass of", rehearsed.stdout)
            self.assertIn("nothing is left to do", rehearsed.stdout)
            self.assertEqual(self.report()["flown"], [], "the plan itself is as it was")
            self.assertFalse((self.var / "files/up.bin").exists())
            self.assertTrue(flight.status())

    def test_a_rehearsal_that_is_interrupted_leaves_nothing_running(self):
        (self.folder / "times.txt").write_text(self.soon())
        var = self.var / "ground/passes/rehearsal-short"
        self.var.mkdir(parents=True, exist_ok=True)
        # While the suite comes up.
        process = self.program("pass", "run", str(self.plan), "--rehearse")
        wait_until(lambda: processes_of(var), DEADLINE_S, "the simulated spacecraft runs")
        second = self.ground_run("pass", "run", str(self.plan), "--rehearse")
        self.assertEqual(second.returncode, 2, second.stdout + second.stderr)
        self.assertIn("is being flown by another srfs-ground", second.stderr)
        self.interrupt(process, var)
        # In a pass.
        process = self.program("pass", "run", str(self.plan), "--rehearse")
        for line in process.stdout:
            if "rehearsal_pass" in line:
                break
        self.interrupt(process, var)

    def interrupt(self, process, var):
        process.send_signal(signal.SIGINT)
        said, _ = process.communicate(timeout=DEADLINE_S)
        self.assertEqual(process.returncode, 1, said)
        self.assertEqual(processes_of(var), {})

    def soon(self):
        rise, end = (datetime.now(timezone.utc) + timedelta(minutes=m) for m in (60, 68))
        return f"{rise:%Y-%m-%dT%H:%M:%SZ} {end:%Y-%m-%dT%H:%M:%SZ}\n"


if __name__ == "__main__":
    unittest.main()
