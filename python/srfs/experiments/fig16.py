# SPDX-FileCopyrightText: 2026 SRFS contributors
# SPDX-License-Identifier: Apache-2.0
"""The paper's Fig. 16 with the real processes: maintenance builds a payload3 that uses the CAN bus and puts it in place of one that does not.

The sources go up as a signed package over the ground link, are compiled on board by the build lane, tested, and started in place of
the old program; the ring of the payloads goes on. Everything on CLOCK_MONOTONIC in ns.
"""

import time

from srfs import ROOT
from srfs.experiments.experiment import FIRST, RING, SECOND, THIRD, StatesExperiment
from srfs.flight.deployments import PAYLOADS
from srfs.flight.ground import Lines
from srfs.program import MissionError
from srfs.record import ringline
from srfs.record.rotation import Rotation
from srfs.record.timeline import MS, OCCUPYING, STATES, Timeline
from srfs.report import check, pyplot

QUIET_S = 3.0
PACKAGE = ROOT / "examples" / "packages" / "payload_thermal.yaml"
SLOTS = 10  # that the new payload shall have used


class Fig16(StatesExperiment):
    TITLES = {"fig16": "system maintenance: payload3 without the CAN bus is replaced in flight by one with it, built on board from uplinked source"}
    DEPLOYMENT = "fig16"
    INSTALLED = True

    def __init__(self, *flight):
        super().__init__(*flight)
        self.ring = ringline.RingLine()
        self.line = Timeline(PAYLOADS)
        self.rotation = Rotation()
        self.steps = {}  # what the spacecraft reported of the update -> when it was heard
        self.installed = None

    def uses_the_bus(self, since=0):
        return sum(1 for at, who, state in list(self.line.changes) if who == THIRD and state == OCCUPYING and at >= since)

    def run(self):
        recorder = self.flight.recorder()
        for listener in (self.ring.on_message, self.line.on_message, self.rotation.on_message):
            recorder.on_message(listener)
        self.begin = time.monotonic_ns()
        for observer, subject in zip(RING, (*RING[1:], RING[0])):
            self.wait_until(lambda o=observer, s=subject: self.ring.alive(o, s, self.begin), f"{subject} is Active, says {observer}")
        self.pids = {payload: self.flight.node_pid(payload) for payload in PAYLOADS}
        self.signals.pause(QUIET_S)
        self.used_before = self.uses_the_bus()

        package = self.flight.var / "payload_thermal_1.pkg"
        self.flight.ground_tool("package", "make", "--manifest", PACKAGE, "--counter", 1, "--key", self.flight.var / "ground" / "package_test.seed", "-o", package)
        self.package_octets = package.stat().st_size
        self.say(f"the package has {self.package_octets} octets")
        self.ordered = time.monotonic_ns()
        self.install(package)
        self.at_last = {payload: self.flight.node_pid(payload) for payload in PAYLOADS}
        self.wait_until(lambda: self.uses_the_bus(self.ordered) >= SLOTS, f"the new {THIRD} uses the bus {SLOTS} times")
        self.signals.pause(QUIET_S)
        self.end = time.monotonic_ns()
        self.versions = self.flight.versions(THIRD)

    def install(self, package):
        """The operator's one command; what it prints is the account of the update."""
        lines = Lines(self.flight.ground_command("--json", "package", "install", package), self.flight.var / "log" / "install.log")

        def on_message(m):
            if m["type"] != "event" or not m["event"].startswith("update."):
                return
            what = m["event"].removeprefix("update.")
            if what == "log_queued":
                return
            what = m["fields"].get("step", what)
            self.steps.setdefault(what, time.monotonic_ns())
            self.say(f"update: {what}")

        lines.on_message(on_message)
        try:
            self.wait_until(lambda: lines.process.poll() is not None, "the package is installed", 900)
            lines._thread.join(5)
            if lines.process.returncode != 0:
                raise MissionError(f"srfs-ground package install ended with {lines.process.returncode}: see {lines.log_path}")
            self.installed = next((m["fields"] for m in lines.messages if m["type"] == "event" and m["event"] == "update.installed"), None)
        finally:
            lines.end()

    # --- judgement ----------------------------------------------------------------------------------------------------

    def outage_ms(self):
        """From the last answer of the old process to the first of the new one, as payload1 heard them."""
        answers = self.ring.of(self.begin, observer=FIRST, subject=THIRD, verdict="alive")
        pairs = [(a, b) for a, b in zip(answers, answers[1:]) if a["subject_incarnation"] != b["subject_incarnation"]]
        return round((pairs[0][1]["said_ns"] - pairs[0][0]["said_ns"]) / MS, 1) if pairs else None

    def lost_slots(self):
        return {p: sum(1 for slot in self.rotation.slots_of(p)[:-1] if slot["published"] >= self.begin and slot["status"] is None) for p in PAYLOADS}

    def judge(self):
        restarts = self.ring.of(self.begin, verdict="outcome", outcome="restarted")
        lost = self.lost_slots()
        slots = self.rotation.slots()
        running = self.versions.get("running")
        checks = [
            check(self.used_before == 0, "the old payload3 never had the CAN bus"),
            check(running == 1, f"payload3 runs version {running}, built on board"),
            check(self.uses_the_bus(self.ordered) >= SLOTS, f"the new payload3 used the CAN bus {self.uses_the_bus(self.ordered)} times"),
            check(not restarts, f"no ring restart interfered ({len(restarts)})"),
            check(self.at_last[THIRD] and self.at_last[THIRD] != self.pids[THIRD], "payload3 is another process"),
            check(all(self.at_last[p] == self.pids[p] for p in (FIRST, SECOND)), "payload1 and payload2 are the same processes"),
            check(sum(lost.values()) <= 1, f"CAN slots lost: {sum(lost.values())}, at most one"),
            check(slots[FIRST]["failed"] + slots[SECOND]["failed"] == 0, "no slot of payload1 or payload2 failed"),
        ]
        return self.summary(checks, recorded_s=round(self.seconds(self.end), 3), check_period_ms=self.ring.period_ms(FIRST, THIRD), package_octets=self.package_octets,
                            steps_s={step: round((at - self.ordered) / 1e9, 3) for step, at in self.steps.items()}, installed=self.installed,
                            outage_ms=self.outage_ms(), slots=slots, slots_lost=lost)  # fmt: skip

    @staticmethod
    def text(summary):
        steps = ", ".join(f"{step} {at} s" for step, at in summary["steps_s"].items())
        return (f"  package of {summary['package_octets']} octets; after the order: {steps}\n"
                f"  payload1 heard nothing from payload3 for {summary['outage_ms']} ms (a check each {summary['check_period_ms']} ms)")  # fmt: skip

    # --- files --------------------------------------------------------------------------------------------------------

    def draw(self, folder):
        """SVG and PNG like the paper's figure: a panel a payload with its state over time, the steps of maintenance, and the ring's checks of payload3."""
        swap = self.seconds(self.steps["swap"])
        figure, grid = pyplot().subplots(len(PAYLOADS) + 1, 2, figsize=(14, 8), sharex="col", sharey="row", width_ratios=(3, 2))
        for column in range(2):
            self.draw_column([row[column] for row in grid])
            grid[-1][column].set_xlabel("time [s]" if column == 0 else "time [s], the swap")
        grid[0][1].set_xlim(swap - 1.5, swap + 2.5)
        figure.suptitle("Fig. 16: a node is replaced from uplinked source", fontsize=11)
        self.save(figure, folder)

    def draw_column(self, axes):
        for number, (axis, payload) in enumerate(zip(axes, PAYLOADS), 1):
            self.draw_states(axis, number, payload, STATES, [s.replace("_", " ") for s in STATES], linewidth=0.8)
        axis = axes[-1]
        answers = self.ring.of(self.begin, self.end, observer=FIRST, subject=THIRD, verdict="alive")
        for incarnation in sorted({m["subject_incarnation"] for m in answers}):
            times = [self.seconds(m["said_ns"]) for m in answers if m["subject_incarnation"] == incarnation]
            axis.plot(times, [0] * len(times), "|", markersize=14, label=f"payload3 answers payload1, incarnation {incarnation}")
        named = -1e9
        for step, at in sorted(self.steps.items(), key=lambda s: s[1]):
            for each in axes:
                each.axvline(self.seconds(at), color="grey", linewidth=0.8, linestyle="--")
            if self.seconds(at) - named > 0.02:
                axis.text(self.seconds(at), 0.7, f" {step.replace('_', ' ')}", fontsize=8, rotation=60, va="bottom", clip_on=True)
                named = self.seconds(at)
        axis.set_ylim(-1.2, 2.4)
        axis.set_yticks([])
        axis.set_title("the ring and maintenance", fontsize=9, loc="left")
        axis.legend(fontsize=7, loc="lower left")
