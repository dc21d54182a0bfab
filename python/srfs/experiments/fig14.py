# SPDX-FileCopyrightText: 2026 SRFS contributors
# SPDX-License-Identifier: Apache-2.0
"""The paper's Fig. 14 with the real processes: which payload occupied the CAN bus when, which processed, which took a telecommand."""

import time

from srfs.experiments.experiment import StatesExperiment
from srfs.flight.deployments import PAYLOADS
from srfs.record import can_frames, timeline
from srfs.record.heartbeats import period_of
from srfs.record.timeline import MS
from srfs.report import check, percentile, pyplot

SETTLE_S = 2.0  # the slots before the recording are over, their processing too
LATE_MS = 270  # what payload2's peripheral takes longer in fig14b: its slots end half-way between two heartbeats of 250 ms
TELECOMMANDS = ("adcs.set_mode mode=point", "adcs.set_mode mode=detumble")
SEQUENTIAL_MARGIN_MS = 20  # between the end of the processing and the next heartbeat, where the work is done in strict sequence
DURATION_S = {"fig14a": 6.0, "fig14b": 8.0, "fig14c": 6.0, "fig14d": 8.0}
STATE_LABELS = ("off", "occupying CAN", "data processing", "other async commands")  # the paper's words, in the order of timeline.STATES
HEARTBEAT = {"color": "grey", "linewidth": 0.6, "linestyle": ":"}
BLOCKED = {"color": "red", "linewidth": 0.9, "linestyle": "--"}
TELECOMMAND = {"color": "red", "marker": "v", "markersize": 6, "linestyle": "none"}


class Fig14(StatesExperiment):
    TITLES = {
        "fig14a": "normal",
        "fig14b": "CAN bus blocked: payload2 uses it for longer than anticipated",
        "fig14c": "processing continues while the next payload has the bus",
        "fig14d": "telecommands to payload1",
    }
    DEPLOYMENT = "fig14"

    def __init__(self, *flight):
        super().__init__(*flight)
        self.line = timeline.Timeline(PAYLOADS)
        self.frames = {}
        self.sequential = None  # fig14c: (begin, end) of the recording in strict sequence

    def switcher(self, transition):
        self.flight.srfs_json("lifecycle", "can_switcher", transition)

    def run(self):
        self.switcher("deactivate")
        self.signals.pause(SETTLE_S)
        if self.name == "fig14b":
            self.flight.control({"peripheral": "eps", "fault": "late", "delay_ms": LATE_MS})
        recorder = self.flight.recorder()
        recorder.on_message(self.line.on_message)
        ground = self.flight.ground() if self.name == "fig14d" else None
        self.begin = time.monotonic_ns()
        self.say(f"recording {DURATION_S[self.name]:g} s")
        self.switcher("activate")
        end = time.monotonic() + DURATION_S[self.name]
        for k, text in enumerate(TELECOMMANDS if ground else ()):
            self.signals.pause(end - DURATION_S[self.name] + 2 + 2.5 * k - time.monotonic())
            # while the last payload has the bus: the first is idle then, and its next slot is the next one
            recorder.wait_for(lambda m: m["type"] == "bus" and m["status"] == "taken" and m["payload"] == PAYLOADS[-1], 2, recorder.position())
            self.say(f"telecommand {text}")
            ground.send(f"tc {text}")
        self.signals.pause(end - time.monotonic())
        self.end = time.monotonic_ns()
        if ground:
            self.frames = self.frames_of_telecommands()
        if self.name == "fig14c":
            self.sequential = self.record_in_strict_sequence()

    def record_in_strict_sequence(self):
        """The same work, with heartbeats so far apart that the processing of a payload is over when the next one gets the bus."""
        longest_ms = timeline.longest_work(self.line.intervals(self.begin, self.end)) / MS
        period_ms = timeline.next_tick_period_ms(longest_ms + SEQUENTIAL_MARGIN_MS)
        self.flight.srfs_json("param", "set", "timing", "tick_period_ms", period_ms)
        self.flight.srfs("param", "confirm", "timing")  # it would go back in the middle of a long recording
        self.signals.pause(SETTLE_S)
        begin = time.monotonic_ns()
        self.say(f"recording {DURATION_S[self.name]:g} s with a heartbeat of {period_ms} ms: strictly sequential")
        self.signals.pause(DURATION_S[self.name])
        return begin, time.monotonic_ns()

    def frames_of_telecommands(self):
        """{id: when its first frame was on the bus} from the record of the simulated bus."""
        frames = can_frames.command_frames(self.flight.can_log(until_ns=self.end - 500 * MS))
        found = {}
        for number, (target, at) in self.line.telecommands.items():
            times = [t for t in frames.get((target, number & 0xFFFFFFFF), []) if t >= at - timeline.PULSE_BOUND_NS]
            if times:
                found[number] = times[0]
        return found

    def judge(self):
        intervals = self.line.intervals(self.begin, self.end)
        beats = self.line.heartbeats(self.begin, self.end)
        switches = self.line.switches(self.begin, self.end)
        if self.name == "fig14b":
            checks = timeline.fig14b(intervals, switches, beats, PAYLOADS, self.end, "payload_eps")
        elif self.name == "fig14d":
            checks = timeline.fig14d(intervals, switches, beats, PAYLOADS, self.end, "payload_adcs", self.line.telecommands, self.line.completed,
                                     self.frames)  # fmt: skip
        else:
            checks = getattr(timeline, self.name)(intervals, switches, beats, PAYLOADS, self.end)
        use = timeline.use_of_the_bus(intervals, beats, self.begin, self.end)
        sequential = self.judge_strict_sequence(use, checks) if self.sequential else {}
        delays = [delay / MS for delay in timeline.delays(switches)]
        return self.summary(checks, recorded_s=round(self.seconds(self.end), 3), heartbeats=len(beats), heartbeat_ms=round(period_of(beats) / MS, 1),
                            heartbeat_to_bus_p50_ms=round(percentile(delays, 0.5) or 0, 3), **use, **sequential)  # fmt: skip

    @staticmethod
    def text(summary):
        sequential, measured = summary["bus_utilisation_sequential"], summary.get("strict_sequence_measured")
        return (f"  bus used {100 * summary['bus_utilisation']:.1f} % of the time"
                + (f", {100 * sequential:.1f} % if processing had to end first" if sequential else "")
                + (f" (measured {100 * measured['bus_utilisation']:.1f} %), parallelism {summary['parallelism']}" if measured else "")
                + f"; heartbeat to bus {summary['heartbeat_to_bus_p50_ms']} ms (p50)")  # fmt: skip

    def judge_strict_sequence(self, as_run, checks):
        """What the recording in strict sequence adds to the summary."""
        beats = self.line.heartbeats(*self.sequential)
        use = timeline.use_of_the_bus(self.line.intervals(*self.sequential), beats, *self.sequential)
        gain = timeline.parallelism(as_run, use)
        what = f"more of the bus is used than in strict sequence: {as_run['slots_per_s']} slots/s against {use['slots_per_s']}, measured"
        checks.append(check(gain and gain > 1, what))
        kept = ("slots", "slots_per_s", "bus_utilisation", "slot_ms", "processing_ms", "processing_beside_the_bus_ms")
        heartbeat_ms = round(period_of(beats) / MS, 1)
        return {"strict_sequence_measured": {"heartbeat_ms": heartbeat_ms, **{key: use[key] for key in kept}}, "parallelism": gain}

    # --- files --------------------------------------------------------------------------------------------------------

    def draw(self, folder):
        """SVG and PNG like the paper's figure: a panel a payload, its four states over time. Behind them whose turn on the bus it is."""
        plots = pyplot()
        from matplotlib import lines, patches

        intervals = self.line.intervals(self.begin, self.end)
        beats = self.line.heartbeats(self.begin, self.end)
        blocked = {t for _, inside in timeline.blocked_heartbeats(self.line.switches(self.begin, self.end), beats) for t in inside}
        figure, axes = plots.subplots(len(PAYLOADS), 1, figsize=(10, 6.4), sharex=True)
        for number, (axis, payload) in enumerate(zip(axes, PAYLOADS), 1):
            for i in timeline.of_state(intervals, timeline.OCCUPYING):
                color = f"C{PAYLOADS.index(i.payload)}"
                axis.axvspan(self.seconds(i.begin), self.seconds(i.end), color=color, alpha=0.3 if i.payload == payload else 0.1, linewidth=0)
            for beat in beats.values():
                axis.axvline(self.seconds(beat), **(BLOCKED if beat in blocked else HEARTBEAT))
            self.draw_states(axis, number, payload, timeline.STATES, STATE_LABELS, linewidth=1.6)
            times = [self.seconds(at) for target, at in self.line.telecommands.values() if target == payload]
            axis.plot(times, [len(timeline.STATES) - 0.75] * len(times), **TELECOMMAND)
            axis.set_xlim(0, self.seconds(self.end))
        axes[-1].set_xlabel("time [s]")
        legend = [patches.Patch(color=f"C{n}", alpha=0.3, label=f"payload{n + 1} has the bus") for n in range(len(PAYLOADS))]
        legend.append(lines.Line2D([], [], label="heartbeat", **HEARTBEAT))
        legend += [lines.Line2D([], [], label="heartbeat, switch blocked", **BLOCKED)] if blocked else []
        legend += [lines.Line2D([], [], label="telecommand", **TELECOMMAND)] if self.line.telecommands else []
        figure.legend(handles=legend, loc="lower center", ncol=len(legend), fontsize=8, frameon=False)
        figure.suptitle(f"Fig. 14{self.name[-1]}: {self.TITLES[self.name]}", fontsize=11)
        self.save(figure, folder, rect=(0, 0.04, 1, 1))
