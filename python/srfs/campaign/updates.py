# SPDX-FileCopyrightText: 2026 SRFS contributors
# SPDX-License-Identifier: Apache-2.0
"""The `updates` campaign: installs packages of sources one after the other, a third of them bad in different ways, and kills processes at random.

Invariants after each update:
- exactly one process of the node works, in the version that the table lists,
- a bad version never stays,
- a good version that was not killed in its probation runs,
- the update leaves nothing behind.
"""

import collections
import contextlib
import os
import pathlib
import random
import signal
import threading
import time

from srfs import ROOT
from srfs.flight.processes import command_line, pids, send_signal
from srfs.program import Interrupted, MissionError
from srfs.report import all_ok, check, quantiles, show_checks

NODE = "payload_thermal"
SOURCE = ROOT / "examples" / "payload_idle" / "main.cpp"
BEGIN = "int main(int argc, char** argv) {\n"
UPDATE_DEADLINE_S = 240
STEADY_DEADLINE_S = 60
KILLED = ("maintenance", NODE, "payload_eps", "ttc")
LATEST_KILL_S = 12
UNKNOWN_MS = 2**32 - 1

UNLESS_TESTED = """#include <cstdlib>
#include <string_view>
#include <thread>
""" + BEGIN + """  bool test = false;
  for (int i = 0; i < argc; ++i) test = test || std::string_view(argv[i]) == "--self-test";
  if (!test) %s
"""  # fmt: skip
FORKS = "#include <unistd.h>\n" + BEGIN + "  while (true) fork();\n"
EATS = "#include <cstdlib>\n#include <cstring>\n" + BEGIN + "  for (std::size_t i = 0; i < 100000; ++i) std::memset(std::malloc(1 << 20), 1, 1 << 20);\n"
TEMPLATES = "template <int N> struct A { A<N + 1> more; };\nA<0> endless;\n"

# Kind of bad package -> (change of the source, step in which the update must fail)
WAYS = {
    "no C++": (lambda text: text + "\nthis is no C++;\n", "build"),
    "endless templates": (lambda text: text + TEMPLATES, "build"),
    "endless includes": (lambda text: '#include "main.cpp"\n' + text, "build"),
    "fails its self-test": (lambda text: text.replace(BEGIN, BEGIN + "  return 6;\n"), "self_test"),
    "crashes in its self-test": (lambda text: text.replace(BEGIN, BEGIN + "  __builtin_trap();\n"), "self_test"),
    "hangs in its self-test": (lambda text: text.replace(BEGIN, BEGIN + "  while (true) asm volatile(\"\");\n"), "self_test"),
    "forks in its self-test": (lambda text: text.replace(BEGIN, FORKS), "self_test"),
    "eats memory in its self-test": (lambda text: text.replace(BEGIN, EATS), "self_test"),
    "dies after its activation": (lambda text: text.replace(BEGIN, UNLESS_TESTED % "std::thread([] { std::this_thread::sleep_for(std::chrono::milliseconds(600)); std::abort(); }).detach();"), "probation"),
    "dies at its start": (lambda text: text.replace(BEGIN, UNLESS_TESTED % "return 3;"), "probation"),
    "hangs at its start": (lambda text: text.replace(BEGIN, UNLESS_TESTED % "while (true) std::this_thread::sleep_for(std::chrono::seconds(1));"), "probation"),
    "foreign signature": (None, "verify"),
    "old counter": (None, "verify"),
    "one bit of it is another": (None, "verify"),
}  # fmt: skip


def known(ms):
    return None if ms == UNKNOWN_MS else ms


class Updates:
    """One campaign."""

    def __init__(self, flight, signals, count, seed, say):
        self.flight = flight
        self.signals = signals
        self.count = count
        self.say = say
        self.random = random.Random(seed)
        self.counter = 0
        self.trials = []
        self.work = flight.var / "campaign"
        self.work.mkdir(exist_ok=True)
        self.seed_file = flight.var / "ground" / "package_test.seed"

    # --- packages -----------------------------------------------------------------------------------------------------

    def package(self, text, key=None):
        self.counter += 1
        sources = self.work / "sources"
        sources.mkdir(exist_ok=True)
        (sources / "main.cpp").write_text(text)
        out = self.flight.var / "files" / f"{self.counter}.pkg"
        out.parent.mkdir(exist_ok=True)
        command = ["package", "make", "--node", NODE, "--kind", "replace", "--counter", self.counter, "--sources", sources, "--option=-O0",
                   "--self-test", 3, "--probation", 3600, "--key", key or self.seed_file, "-o", out]  # fmt: skip
        self.flight.ground_tool(*command)
        return out

    def make(self, way):
        text = SOURCE.read_text() + f"// {self.counter + 1}\n"
        if way is None:
            return self.package(text)
        change, _ = WAYS[way]
        if change:
            return self.package(change(text))
        if way == "foreign signature":
            foreign = self.work / "foreign.seed"
            if not foreign.exists():
                self.flight.ground_tool("package", "keygen", foreign, self.work / "foreign.pub")
            return self.package(text, foreign)
        if way == "old counter" and self.counter > 0:
            self.counter -= 2 if self.counter > 1 else 1
            package = self.package(text)
            self.counter += 1
            return package
        package = self.package(text)
        octets = bytearray(package.read_bytes())
        octets[self.random.randrange(10, len(octets))] ^= 1 << self.random.randrange(8)
        package.write_bytes(octets)
        return package

    # --- state ------------------------------------------------------------------------------------------------------

    def table(self):
        return self.flight.versions(NODE)

    def processes(self):
        """The pids of the node's processes."""
        found = []
        for pid in pids():
            words = command_line(pid)
            if "--name" in words and "--self-test" not in words and words[words.index("--name") + 1] == NODE and str(self.flight.var) in words:
                found.append(pid)
        return found

    def is_steady(self):
        """Whether all nodes are active and one process of the updated node runs the table's active version."""
        nodes = {n["name"]: n["state"] for n in self.flight.status()}
        table = self.table()
        return all(state == "active" for state in nodes.values()) and table["running"] == table["active"] and len(self.processes()) == 1

    def left(self):
        """Counts what an update may leave behind. None of these numbers may grow."""
        with contextlib.suppress(OSError, TypeError):
            descriptors = len(os.listdir(f"/proc/{self.flight.node_pid('maintenance')}/fd"))
        lanes = [pid for pid in pids() if command_line(pid)[:1] == [self.flight.program("srfs-lane")]]
        return {
            "lanes": len(lanes),
            "mounts": len(pathlib.Path("/proc/self/mounts").read_text().splitlines()),
            "work folder": int((self.flight.var / "update" / "job").exists()) + int((self.flight.var / "update" / "lane" / "job").exists()),
            "files of versions": len(list((self.flight.var / "versions" / NODE).glob("*"))) if (self.flight.var / "versions" / NODE).exists() else 0,
            "descriptors of maintenance": descriptors,
        }

    # --- one update ---------------------------------------------------------------------------------------------------

    def kill_later(self):
        """In half of the updates, kills one of the processes at a random instant."""
        if self.random.random() < 0.5:
            return None, None
        victim = self.random.choice(KILLED)
        wait = self.random.uniform(0, LATEST_KILL_S)

        timer = threading.Timer(wait, lambda: send_signal(self.flight.node_pid(victim), signal.SIGKILL))
        timer.start()
        return f"{victim} killed after {wait:.1f} s", timer

    def status(self, ground):
        since = ground.position()
        ground.send("tc package.report")
        packet = ground.housekeeping("update_status", 5, since)
        return packet and packet["fields"]

    def trial(self, ground, way):
        before = self.table()
        package = self.make(way)
        begun = time.monotonic()
        kill, timer = self.kill_later()
        outcome = None
        while outcome is None or outcome.get("stage") not in ("completed", "failed"):  # a telecommand may time out while ttc is down
            outcome = ground.command(f"tc package.install file={package.name}", 60)
            if time.monotonic() - begun > UPDATE_DEADLINE_S:
                raise MissionError(f"package.install: {outcome}")
        refused = outcome["stage"] == "failed"
        status = {}
        if not refused:

            def over():
                status.update(self.status(ground) or {})
                return status.get("file") == package.name and status.get("step") in ("installed", "candidate", "failed", "cancelled")

            self.signals.wait_until(over, UPDATE_DEADLINE_S, f"update {self.counter} is over", 0.1)
        if timer:
            timer.join()
        took = time.monotonic() - begun
        end = WAYS[way][1] if way else None
        if end == "probation" and status.get("step") == "installed":
            self.signals.wait_until(lambda: self.table()["active"] != status["version"], STEADY_DEADLINE_S, "the bad version is rolled back", 0.1)
        self.signals.wait_until(self.is_steady, STEADY_DEADLINE_S, f"after update {self.counter} everybody works", 0.1)
        after = self.table()
        problems = []
        rolled_back = after["active"] == before["last_good"] and status.get("step") != "candidate"
        if way is None:
            fell = kill and (NODE in kill or "maintenance" in kill)
            if refused and outcome.get("name") != "update_under_way":
                problems.append(f"a good package was refused: {outcome.get('name')}")
            if not refused and after["active"] != status.get("version") and not fell:
                problems.append(f"a good package does not run: {status}")
        else:
            if end == "verify" and not refused:
                problems.append(f"{way}: not refused")
            if not rolled_back:
                problems.append(f"{way}: version {after['active']} runs, {before['last_good']} was the last good one")
        left = self.left()
        if left["lanes"] or left["work folder"]:
            problems.append(f"left behind: {left}")
        self.trials.append({"way": way or "good", "kill": kill, "took_s": round(took, 2), "refused": outcome.get("name") if refused else None,
                            "step": status.get("step"), "failed_in": status.get("failed_in"), "reason": status.get("reason"), "starts": status.get("starts"),
                            "build_ms": known(status.get("build_ms")), "outage_ms": known(status.get("outage_ms")), "active": after["active"], "problems": problems, "left": left})  # fmt: skip
        if way is None and after["active"] == status.get("version"):  # the next update can roll back to it
            self.flight.srfs("versions", "confirm", NODE, str(after["active"]))
        return self.trials[-1]

    def run(self):
        ground = self.flight.ground()
        ways = list(WAYS)
        for number in range(1, self.count + 1):
            if number % 8 == 1 and number > 1:  # a session's records must not grow without bound
                self.flight.hang_up(ground)
                ground = self.flight.ground()
            way = ways[(number // 3 - 1) % len(ways)] if number % 3 == 0 else None
            try:
                trial = self.trial(ground, way)
            except MissionError as error:
                if isinstance(error, Interrupted):
                    raise
                trial = {"way": way or "good", "problems": [str(error)], "took_s": 0, "kill": None}
                self.trials.append(trial)
            text = f"{trial.get('step') or trial.get('refused')}" + (f" in {trial['failed_in']}" if trial.get("failed_in") not in (None, "none") else "")
            self.say(f"{number} of {self.count}: {trial['way']}: {text} after {trial['took_s']} s" + (f"; {trial['kill']}" if trial["kill"] else "")
                     + (f"; PROBLEM: {'; '.join(trial['problems'])}" if trial["problems"] else ""))  # fmt: skip

    # --- judgement ----------------------------------------------------------------------------------------------------

    def judge(self):
        trials = self.trials
        lefts = [t["left"] for t in trials if "left" in t]
        grown = {what: lefts[-1][what] - lefts[len(lefts) // 4][what] for what in ("mounts", "descriptors of maintenance")} if lefts else {}
        outages = [t["outage_ms"] for t in trials if t.get("outage_ms") is not None]
        builds = [t["build_ms"] for t in trials if t.get("build_ms") and t.get("step") == "installed"]
        judged = [
            check(not any(t["problems"] for t in trials), f"after each update exactly one working version, the right one ({sum(not t['problems'] for t in trials)} of {len(trials)})"),
            check(all(growth <= 2 for growth in grown.values()), f"nothing leaks: {grown}"),
        ]  # fmt: skip
        return {
            "updates": len(trials),
            "ways": dict(collections.Counter(t["way"] for t in trials)),
            "killed": sum(bool(t["kill"]) for t in trials),
            "begun_again": sum((t.get("starts") or 1) > 1 for t in trials),
            "outage_ms": quantiles(outages, "p50 max") if outages else None,
            "build_ms": quantiles(builds, "p50 max") if builds else None,
            "trials": trials,
            "checks": judged,
            "ok": all_ok(judged),
        }


def show(summary):
    show_checks(summary["checks"])
    print(f"  {summary['updates']} updates, {summary['updates'] - summary['ways'].get('good', 0)} of them bad, {summary['killed']} with a process killed, "
          f"{summary['begun_again']} begun again; build {summary['build_ms']}, outage {summary['outage_ms']}")  # fmt: skip
    for t in summary["trials"]:
        if t["problems"]:
            print(f"    {t['way']} ({t['kill']}): {'; '.join(t['problems'])}")
