# SPDX-FileCopyrightText: 2026 SRFS contributors
# SPDX-License-Identifier: Apache-2.0
"""Runs every command line of README.md and the how-to pages as written, against one flight. The table below lists the exceptions with their
reasons. For the tutorials, see test_tutorials.py.

Placeholders are replaced: times, NODE, FILE. tests/unit/docs checks names, ./run and tests.
"""

import dataclasses
import os
import re
import shutil
import signal
import subprocess
import time
import unittest
from datetime import datetime, timedelta, timezone

from support import BIN, SystemTest

from srfs import ROOT

DOCUMENTS = ("README.md", *(str(p.relative_to(ROOT)) for p in sorted((ROOT / "docs/how-to").glob("*.md"))))
PROGRAMS = r"(?:sudo )?(?:build-release/bin/\S+|\$ground|srfs|python3) "
LINE_LIMIT_S = 300  # for a line that hangs; what the image lane does waits for the CPU time that others leave


def utc(seconds_from_now):
    return (datetime.now(timezone.utc) + timedelta(seconds=seconds_from_now)).strftime("%Y-%m-%dT%H:%M:%SZ")


@dataclasses.dataclass
class Rule:
    """How to run a line that cannot run as written."""

    pattern: str
    skipped: str = ""  # reason
    replaced: tuple = ()  # (pattern, text or function without arguments)
    codes: tuple = (0,)
    interrupted_s: float = 0  # Ctrl-C after this
    says: str = ""  # pattern that the output must match
    then: str = ""  # command that restores the state
    stays: bool = False  # runs beside the other lines of its document


NOW = ((r"2026-\S+Z --to 2026-\S+Z", lambda: f"{utc(-20)} --to {utc(0)}"),)
RULES = (
    Rule(r"srfs-ground serve$", stays=True),
    Rule(r"srfs-ground console$", codes=(2,), says="it needs a terminal"),  # test_console.py
    Rule(r"srfs-ground serve --web$", replaced=((r"--web", "--help"),)),  # the server of this document runs; test_web.py
    Rule(r"srfs-ground (listen|files|bridge|watch.*)$", interrupted_s=2, codes=(0, 130)),
    Rule(r"srfs-ground retrieve", replaced=NOW),
    Rule(r"pass run .*--wait$", interrupted_s=3, codes=(1,)),  # the next pass is hours away
    Rule(r"pass run .*--rehearse", skipped="tests/system/test_pass.py"),  # a second simulation
    Rule(r"srfs doctor", replaced=((r"^sudo ", ""),), codes=(0, 1)),  # machines differ
    Rule(r"srfs echo", replaced=((r"$", " --count 2"),), says=r'"cycle":'),
    Rule(r"srfs diagnostics$", interrupted_s=2),
    Rule(r"srfs graph \w", replaced=((r"$", " --wait 10000"),), says="/can_switcher"),
    Rule(r"srfs run ", skipped="tests/system/test_ros_tools.py"),
    Rule(r"record --duration", replaced=((r"duration 5", "duration 1"),)),
    Rule(r'"fault": "silent"', then="""build-release/bin/hw_sim --control '{"peripheral": "eps", "fault": "none"}'"""),
    Rule(r"state=on --at 2026-", replaced=((r"2026-\S+Z", lambda: utc(3600)),), says="scheduled"),
    Rule(r"--at \+30s --wait", replaced=((r"\+30s", "+2s"),)),
    Rule(r"schedule delete", replaced=((r"17 3", "{scheduled}"),)),
    Rule(r"schedule shift", replaced=((r" 17 3", ""),)),
    Rule(r"schedule disable", then="build-release/bin/srfs-ground schedule enable"),
    Rule(r"task=6 start=", replaced=((r"2026-\S+Z", lambda: utc(3600)), (r" --wait", ""))),
    Rule(r"task=7 .*--at", replaced=((r"2026-\S+Z", lambda: utc(90000)),), says="scheduled"),
    # A whole frame takes half a minute on the line, so the test reads it from the outbox.
    Rule(r"srfs-product var/ground/files/strip", replaced=((r"var/ground/files", "var/files/outbox"),)),
    Rule(r"srfs-detect .*frame_", skipped="tests/system/test_detect.py"),  # frames on the ground
    Rule(r"srfs-ground beacon$", codes=(0, 1), says="beacon"),  # one comes each 10 s
    Rule(r"archive (prune|rebuild)", codes=(2,), says="another srfs-ground owns this folder"),  # the server of the page still runs
    Rule(r"param restore payload_eps 3", replaced=((r"3$", "1"),)),
    Rule(r"ring.restore_orders|param (history|restore) NODE", skipped="tests/system/test_command_path.py"),  # nothing is set aside here
    Rule(r"lifecycle payload_eps deactivate", then="build-release/bin/srfs lifecycle payload_eps activate"),
    Rule(r"srfs restart", skipped="tests/system/test_watchdog.py"),
    Rule(r"node.send_report", replaced=((r"NODE", "payload_eps"),), codes=(1,), says="no_report"),  # no node died
    Rule(r"ring.hold", replaced=((r"NODE", "payload_thermal"),), then="build-release/bin/srfs ring release payload_thermal"),
    Rule(r"node.set_log_level", replaced=((r"NODE", "payload_eps"),)),
    Rule(r"versions add payload_eps FILE", replaced=((r"FILE", str(BIN / "payload_eps_node")),)),
    Rule(r"package_test.seed -o payload_eps_1|\$ground package install|\$ground tc (package|node|eps)", skipped="tests/system/test_update.py"),
    Rule(r"tc rescue\.|put deployment.yaml|srfs rescue prepare", skipped="tests/system/test_rescue.py"),  # the suite runs
    Rule(r"remote abort", codes=(1,), says="unknown|no such|not"),
)


def command_lines():
    """[(where, line)] of fenced and indented blocks, without comments."""
    found = []
    for document in DOCUMENTS:
        fenced = False
        joined = re.sub(r" \\\n\s*", lambda _: " ", (ROOT / document).read_text())
        for number, line in enumerate(joined.splitlines(), 1):
            fenced = not fenced if line.startswith("```") else fenced
            text = line if fenced else line[4:] if line.startswith("    ") else ""
            if re.match(PROGRAMS, text):
                found.append((f"{document}:{number}", re.sub(r"\s+#.*$", "", text)))
    return found


class DocumentedCommandsTest(SystemTest):
    def setUp(self):
        super().setUp()
        # The tree as a user has it, with the flight's folder in it. Sources are copied, because a package takes no links.
        self.tree = self.folder / "tree"
        (self.tree / "build-release").mkdir(parents=True)
        (self.tree / "build-release/bin").symlink_to(BIN)
        (self.tree / "var").symlink_to(self.var)
        for name in ("launch_config", "msgs"):
            (self.tree / name).symlink_to(ROOT / name)
        for name in ("examples", "mission/payload_eps"):
            shutil.copytree(ROOT / name, self.tree / name)
        (self.tree / "target_list.bin").write_bytes(bytes(2000))
        (self.tree / "pass.txt").write_text("ping\n")

    def run_line(self, line, rule):
        command = f"PATH={BIN}:$PATH; ground=build-release/bin/srfs-ground; {line}"
        process = subprocess.Popen(["bash", "-c", command], cwd=self.tree, stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=subprocess.STDOUT,
                                   text=True, errors="replace", start_new_session=True)  # fmt: skip
        try:
            output, _ = process.communicate(timeout=rule.interrupted_s or LINE_LIMIT_S)
            if rule.interrupted_s:
                return f"ended by itself: {output[-500:]}"
        except subprocess.TimeoutExpired:
            os.killpg(process.pid, signal.SIGINT)  # its own session: the shell and the program
            try:
                output, _ = process.communicate(timeout=10)
            except subprocess.TimeoutExpired:
                os.killpg(process.pid, signal.SIGKILL)
                process.communicate()
                return "is not ended by Ctrl-C"
            if not rule.interrupted_s:
                return f"still running after {LINE_LIMIT_S} s: {output[-500:]}"
        if process.returncode not in rule.codes and -process.returncode != signal.SIGINT:
            return f"exit code {process.returncode}: {output[-500:]}"
        if rule.says and not re.search(rule.says, output):
            return f"does not say '{rule.says}': {output[-500:]}"
        return None

    def start_beside(self, line):
        """Starts a line that runs beside the following ones; its first line of output says that it is ready."""
        command = f"PATH={BIN}:$PATH; exec {line}"
        process = subprocess.Popen(["bash", "-c", command], cwd=self.tree, stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, text=True)
        self.assertNotEqual(process.stdout.readline(), "", line)
        return process

    def end_beside(self, process):
        process.send_signal(signal.SIGINT)
        code = process.wait(timeout=10)
        process.stdout.close()
        return [] if code == 0 else [f"{process.args}: exit code {code}"]

    def as_run(self, line, rule):
        for pattern, text in rule.replaced:
            text = text() if callable(text) else text
            line = re.sub(pattern, lambda _, text=text: text, line, count=1)
        if "{scheduled}" in line:
            line = line.replace("{scheduled}", self.first_scheduled())
        return line

    def first_scheduled(self):
        listed = self.ground_run("--json", "schedule").stdout
        return " ".join(re.search(r'"apid":(\d+).*?"sequence":(\d+)', listed).groups())

    def test_every_line_does_what_it_says_on_one_flight(self):
        lines = command_lines()
        self.assertGreater(len(lines), 90)
        wrong, done, slowest = [], set(), []
        with self.flight():
            beside, document = None, ""
            for where, line in lines:
                if beside and document != where.partition(":")[0]:
                    wrong += self.end_beside(beside)
                    beside = None
                rule = next((r for r in RULES if re.search(r.pattern, line)), Rule(""))
                if rule.skipped:
                    continue
                if rule.stays:  # each document has its own
                    if not beside:
                        beside, document = self.start_beside(line), where.partition(":")[0]
                    continue
                if (line, bool(beside)) in done:
                    continue
                done.add((line, bool(beside)))
                begin = time.monotonic()
                problem = self.run_line(self.as_run(line, rule), rule)
                slowest.append((time.monotonic() - begin, line))
                if problem:
                    wrong.append(f"{where}: {line}: {problem}")
                if rule.then:
                    self.assertIsNone(self.run_line(rule.then, Rule("")), rule.then)
            if beside:
                wrong += self.end_beside(beside)
        print(f"{len(done)} lines, {sum(s for s, _ in slowest):.1f} s;", *(f"{s:.1f} s {line};" for s, line in sorted(slowest, reverse=True)[:5]))
        self.assertEqual(wrong, [], "\n".join(wrong))

    def test_each_exception_is_still_needed(self):
        lines = [line for _, line in command_lines()]
        self.assertEqual([rule.pattern for rule in RULES if not any(re.search(rule.pattern, line) for line in lines)], [])
        for rule in RULES:
            if rule.skipped:
                self.assertTrue((ROOT / rule.skipped).exists(), rule.skipped)


if __name__ == "__main__":
    unittest.main()
