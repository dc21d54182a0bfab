# SPDX-FileCopyrightText: 2026 SRFS contributors
# SPDX-License-Identifier: Apache-2.0
"""The strangers campaign: participants outside the suite flood its topics. No node is restarted, no slot is lost, the tick is on time.

The flood takes CPU time beside what it sends. So the suite also flies beside as many programs that only compute. On a board the nodes go before
other programs: --realtime.
Times are those of the nodes themselves (tick due, flag published), so that a recorder that is late changes nothing.
"""

import contextlib
import json
import select
import subprocess

from srfs.flight.deployments import NODES, PAYLOADS
from srfs.flight.processes import kib_of
from srfs.record.rotation import Rotation
from srfs.report import all_ok, check, check_none, quantiles, show_checks, write_messages

ROLES = ("huge", "random", "events")
TIMES_SLOWER = 2  # goal: p99 of tick to flag, beside that of the calm
MORE_KIB = 1024  # goal: what a node keeps of a flood
LEAST_TICKS = 5  # with their flags, of a phase that is judged
BEGIN_S = 60  # for them, and until the strangers have sent something
SETTLE_S = 15  # a sample left unfinished is given up after 10 s


class Phase:
    """What the suite did in one part of the flight."""

    def __init__(self, name):
        self.name = name
        self.rotation = Rotation()
        self.due = {}  # cycle -> when its tick was due
        self.flags = {}  # cycle -> when its flag was published

    def on_message(self, message):
        self.rotation.on_message(message)
        if message["type"] == "tick":
            self.due[message["cycle"]] = message["due_ns"]
        elif message["type"] == "flags" and message["holder"]:
            self.flags.setdefault(message["cycle"], message["published_ns"])

    def tick_to_flag_us(self):
        flags = self.flags.copy()
        return [(flags[cycle] - due) / 1000 for cycle, due in self.due.copy().items() if cycle in flags]

    def lost_slots(self):
        """Slots that were neither used nor handed back, and ticks without a slot and without cause."""
        return sum(len(self.rotation.failed_slots(payload)) for payload in PAYLOADS) + len(self.rotation.skips())


class Strangers:
    def __init__(self, flight, signals, bin_dir, say):
        self.flight, self.signals, self.say = flight, signals, say
        self.program = bin_dir / "stranger"
        self.phases, self.memory, self.sent, self.messages = [], {}, {}, []

    def run(self, seconds, settle_s=SETTLE_S, roles=ROLES):
        self.flight.recorder().on_message(self._on_message)
        self._observe("calm", seconds)
        with contextlib.ExitStack() as stack:
            for _ in roles:
                stack.enter_context(Burner())
            self._observe("busy", seconds)
        self._remember("before")
        with contextlib.ExitStack() as stack:
            floods = {role: stack.enter_context(Flood(self.program, self.flight.domain, role)) for role in roles}
            self.signals.wait_until(lambda: all(flood.sends() for flood in floods.values()), BEGIN_S, "the strangers send")
            self._observe("flood", seconds)
            self._remember("during")
        self.sent = {role: flood.sent for role, flood in floods.items()}
        self._begin("afterwards", settle_s)
        self.signals.pause(settle_s)
        self._remember("after")
        self.restarts = self.flight.restarts()

    def _on_message(self, message):
        self.messages.append(message)
        if self.phases:
            self.phases[-1].on_message(message)

    def _begin(self, name, seconds):
        self.say(f"{name}: {seconds:.0f} s")
        self.phases.append(Phase(name))

    def _observe(self, name, seconds):
        self._begin(name, seconds)
        self.signals.pause(seconds)
        self.signals.wait_until(lambda: len(self.phases[-1].tick_to_flag_us()) >= LEAST_TICKS, BEGIN_S, f"{LEAST_TICKS} ticks were recorded")

    def _remember(self, when):
        """Resident memory of each node in KiB, free memory of malloc() included."""
        self.memory[when] = {node: kib_of(f"/proc/{self.flight.node_pid(node)}/status", "VmRSS") for node in NODES}

    def judge(self):
        calm, busy, flood = (quantiles(phase.tick_to_flag_us(), "p50 p99 max", digits=0) for phase in self.phases[:3])
        before, after = self.memory["before"], self.memory["after"]
        grown = {node: after[node] - before[node] for node in NODES if after[node] and before[node]}
        lost = {phase.name: phase.lost_slots() for phase in self.phases}
        checks = [
            check(self.restarts == 0, f"no node is restarted: {self.restarts}"),
            check_none([f"{role}: nothing sent" for role, count in self.sent.items() if not count], "the strangers were heard of", len(self.sent)),
        ]
        goals = [
            {"what": f"no slot is lost in the flood: {lost['flood']}; {lost['busy']} beside programs that compute", "met": lost["flood"] == 0},
            {"what": f"p99 of tick due to flag published: {flood['p99']} us; {calm['p99']} us in the calm, {busy['p99']} us beside programs that compute",
             "met": flood["p99"] <= TIMES_SLOWER * calm["p99"]},
            {"what": f"memory of a node back within {MORE_KIB} KiB: {max(grown.values())} KiB more", "met": max(grown.values()) <= MORE_KIB},
        ]  # fmt: skip
        return {"checks": checks, "goals": goals, "ok": all_ok(checks), "restarts": self.restarts, "lost_slots": lost, "sent": self.sent,
                "tick_to_flag_us": {phase.name: {**quantiles(phase.tick_to_flag_us(), "p50 p99 max", digits=0), "ticks": len(phase.due)} for phase in self.phases},
                "memory_kib": self.memory, "grown_kib": grown}  # fmt: skip

    def write(self, out, summary):
        write_messages(out / "record.jsonl", self.messages)
        (out / "strangers.json").write_text(json.dumps(summary, indent=1) + "\n")


class Burner:
    """A program that only computes, until the end of the block."""

    def __enter__(self):
        self._process = subprocess.Popen(["/bin/sh", "-c", "while :; do :; done"], stdin=subprocess.DEVNULL)

    def __exit__(self, kind, value, traceback):
        self._process.kill()
        self._process.wait()


class Flood:
    """One stranger, until the end of the block."""

    def __init__(self, program, domain, role):
        self._process = subprocess.Popen([program, str(domain), role], stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, text=True)
        self.sent = None  # samples, once it has ended

    def __enter__(self):
        return self

    def sends(self):
        """It tells how much it has sent."""
        return self._process.poll() is None and bool(select.select([self._process.stdout], [], [], 0)[0])

    def __exit__(self, kind, value, traceback):
        self._process.terminate()
        lines = self._process.communicate()[0].split()
        self.sent = int(lines[-1]) if lines else 0


def show(summary):
    show_checks(summary["checks"])
    for goal in summary["goals"]:
        print(f"  {'met   ' if goal['met'] else 'MISSED'}  {goal['what']}")
    for name, figures in summary["tick_to_flag_us"].items():
        print(f"  {name:10} tick to flag, us: p50 {figures['p50']}, p99 {figures['p99']}, max {figures['max']}; {figures['ticks']} ticks, "
              f"{summary['lost_slots'][name]} slots lost")  # fmt: skip
    print("  sent: " + ", ".join(f"{role} {count}" for role, count in summary["sent"].items()))
    for when, memory in summary["memory_kib"].items():
        print(f"  memory {when:7} KiB: " + ", ".join(f"{node} {kib}" for node, kib in memory.items()))
