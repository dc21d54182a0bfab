# SPDX-FileCopyrightText: 2026 SRFS contributors
# SPDX-License-Identifier: Apache-2.0
"""The paper's Fig. 15 with the real processes: payload1 alone starts payload3, which starts payload2; then payload3 fails and is healed.

payload3 fails twice: killed (its process ends) and stopped (it hangs, SIGSTOP). Everything on CLOCK_MONOTONIC in ns.
"""

import signal
import threading
import time

from srfs.experiments.experiment import FIRST, RING, SECOND, THIRD, StatesExperiment
from srfs.flight.deployments import PAYLOADS
from srfs.flight.processes import send_signal
from srfs.program import MissionError
from srfs.record import ringline
from srfs.record.timeline import MS
from srfs.report import check, pyplot

QUIET_S = 3.0  # between two steps: what stands in the drawing
LOOK_S = 0.01


class Processes:
    """Looks all the time which process each payload has."""

    def __init__(self, flight):
        self._flight = flight
        self.changes = []  # (when, payload, pid or None)
        self._stop = threading.Event()
        self._thread = threading.Thread(target=self._look, daemon=True)
        self._thread.start()

    def _look(self):
        known = dict.fromkeys(PAYLOADS)
        while not self._stop.wait(LOOK_S):
            for payload in PAYLOADS:
                pid = self._flight.node_pid(payload)
                if pid != known[payload]:
                    self.changes.append((time.monotonic_ns(), payload, pid))
                    known[payload] = pid

    def end(self):
        self._stop.set()
        self._thread.join()


class Fig15(StatesExperiment):
    TITLES = {"fig15": "cyclic restart: payload1 starts payload3, payload3 starts payload2; payload3 fails and is healed"}
    DEPLOYMENT = "fig15"
    ONLY = (FIRST,)

    def __init__(self, *flight):
        super().__init__(*flight)
        self.line = ringline.RingLine()
        self.failures = []  # (what, when)

    def run(self):
        self.begin = time.monotonic_ns()
        self.at_first = {payload: self.flight.node_pid(payload) for payload in PAYLOADS}
        processes = Processes(self.flight)
        try:
            recorder = self.flight.recorder()
            recorder.on_message(self.line.on_message)
            self.say("payload1 runs alone")
            for observer, subject in zip(RING, RING[1:]):
                self.wait_until(lambda o=observer, s=subject: self.line.alive(o, s, self.begin), f"{subject} is Active, says {observer}")
                self.say(f"{subject} is Active")
            self.wait_until(lambda: self.line.alive(SECOND, FIRST, self.begin), "the ring is closed")
            self.signals.pause(QUIET_S)
            for what, number in (("killed", signal.SIGKILL), ("stopped", signal.SIGSTOP)):
                self.fail(what, number)
            self.at_last = {payload: self.flight.node_pid(payload) for payload in PAYLOADS}
        finally:
            processes.end()
        self.end = time.monotonic_ns()
        self.processes = processes.changes

    def fail(self, what, number):
        pid = self.flight.node_pid(THIRD)
        if pid is None:
            raise MissionError(f"{THIRD} does not run")
        at = time.monotonic_ns()
        send_signal(pid, number)
        self.failures.append((what, at))
        self.say(f"{THIRD} {what}")
        self.wait_until(lambda: self.flight.node_pid(THIRD) not in (None, pid) and self.line.alive(FIRST, THIRD, at, renewed=True),
                        f"{THIRD} is Active again")  # fmt: skip
        self.signals.pause(QUIET_S)

    # --- judgement ----------------------------------------------------------------------------------------------------

    def started(self, payload):
        """When a process of it was first seen; None: never."""
        return next((at for at, who, pid in self.processes if who == payload and pid is not None), None)

    def judge(self):
        line, begin = self.line, self.begin
        first_failure = self.failures[0][1]
        starts = {payload: self.started(payload) for payload in PAYLOADS}
        complete = None not in starts.values()
        steps = [ringline.step(line, observer, subject, None, begin, first_failure) for observer, subject in zip(RING, RING[1:])]
        ends = [at for _, at in self.failures[1:]] + [self.end]
        healings = [ringline.step(line, FIRST, THIRD, at, at, until) for (_, at), until in zip(self.failures, ends)]
        hung = healings[1]
        checks = [
            check(self.at_first[FIRST] and not self.at_first[SECOND] and not self.at_first[THIRD], "only payload1 runs at the beginning"),
            check(complete and starts[FIRST] < starts[THIRD] < starts[SECOND], "payload3 starts first, payload2 after it"),
            *(check(s["accused_misses"] >= 3, f"{s['observer']} starts {s['subject']} after {s['accused_misses']} checks without an answer") for s in steps),
            *(check(s["outcome"] == "restarted" and s["active_ns"], f"{s['observer']} started {s['subject']}, which became Active") for s in steps),
            *(check(s["outcome"] == "restarted" and s["active_ns"], f"payload3 {what}: payload1 restarts it, and it is Active again")
              for (what, _), s in zip(self.failures, healings)),
            check(hung["accused_misses"] >= 3, f"payload3 stopped: restarted after {hung['accused_misses']} checks without an answer"),
            check(not line.restarts_by_others(RING, begin), "every node is restarted only by the node that checks it"),
            check(all(self.at_last[p] and self.at_last[p] == self.first_pid(p) for p in (FIRST, SECOND)), "payload1 and payload2 are never restarted"),
        ]  # fmt: skip
        return self.summary(checks, recorded_s=round(self.seconds(self.end), 3), check_period_ms=line.period_ms(FIRST, THIRD),
                            starts={p: at and round(self.seconds(at), 3) for p, at in starts.items()},
                            raised=[self.times(s, starts.get(s["observer"])) for s in steps],
                            healed=[{"failure": what, **self.times(s, at)} for (what, at), s in zip(self.failures, healings)])  # fmt: skip

    def first_pid(self, payload):
        return next((pid for _, who, pid in self.processes if who == payload and pid is not None), None)

    def times(self, step, since):
        """Milliseconds from the failure (or the observer's start) to detection, restart and Active."""

        def after(at):
            return at and since and round((at - since) / MS, 1)

        return {"observer": step["observer"], "subject": step["subject"], "fault": step["fault"], "misses": step["accused_misses"],
                "detected_ms": after(step["accused_ns"]), "restarted_ms": after(step["outcome_ns"]), "active_ms": after(step["active_ns"])}  # fmt: skip

    @staticmethod
    def text(summary):
        lines = [f"  {r['observer']} raised {r['subject']}: Active {r['active_ms']} ms after its own start" for r in summary["raised"]]
        lines += [f"  {h['subject']} {h['failure']}: detected after {h['detected_ms']} ms, restarted {h['restarted_ms']}, Active {h['active_ms']}"
                  for h in summary["healed"]]  # fmt: skip
        return "\n".join(lines)

    # --- files --------------------------------------------------------------------------------------------------------

    def states(self):
        return ringline.states(self.line, self.processes, PAYLOADS, self.begin, self.end)

    def draw(self, folder):
        """SVG and PNG like the paper's figure: one panel for each payload with its state over time and which node restarted it when."""
        figure, axes = pyplot().subplots(len(PAYLOADS), 1, figsize=(11, 6), sharex=True)
        for number, (axis, payload) in enumerate(zip(axes, PAYLOADS), 1):
            self.draw_states(axis, number, payload, ringline.STATES, ringline.STATES)
            axis.set_ylim(-0.3, 2.9)
            for m in self.line.of(subject=payload, verdict="outcome"):
                axis.axvline(self.seconds(m["said_ns"]), color="green", linewidth=1, linestyle="--")
                axis.text(self.seconds(m["said_ns"]), 2.25, f"restarted by payload{PAYLOADS.index(m['observer']) + 1}", fontsize=7, color="green")
            if payload == THIRD:
                for what, at in self.failures:
                    axis.axvline(self.seconds(at), color="red", linewidth=1)
                    axis.text(self.seconds(at), 2.6, what, fontsize=7, color="red", ha="right")
        axes[-1].set_xlabel("time [s]")
        figure.suptitle("Fig. 15: cyclic restart", fontsize=11)
        self.save(figure, folder)
