# SPDX-FileCopyrightText: 2026 SRFS contributors
# SPDX-License-Identifier: Apache-2.0
"""The paper's Fig. 13 with the real processes: how long the mission's topics take from publisher to subscriber, idle and beside image processing.

The subscriber is a process of its own that receives as a node does (tests/bench/bench_topics.cpp), under SCHED_FIFO with the priority of a
payload. Housekeeping is real-time, the image lane has one CPU and gives way (varied). Latency: from the DDS source time stamp, which ROS 2 takes
as that of the publication, to the moment at which the callback would begin. Topics: tick, task flags, bus status, activity and
telemetry of the payloads, telemetry of timing, can_switcher and ttc, telecommands and their reports; three telecommands in two seconds are sent.

The paper's shape: some ms; above 10 ms is rare in idle; nothing above 20 ms while images are processed. Judged: every topic was heard and no
sample lost, images were captured and searched, no node was restarted; 99 % below 10 ms, and below 20 ms all on a kernel with PREEMPT_RT, 99.9 %
elsewhere: such a kernel, and the host of a virtual machine, let any task wait now and then. The project's own goals (GOALS_MS) are reported as
met or missed.
"""

import csv
import json
import os
import subprocess

from srfs.experiments.experiment import Experiment
from srfs.flight import deployments
from srfs.flight.deployments import PAYLOADS
from srfs.flight.machine import described, machine, may_be_real_time, stolen_s
from srfs.measures import imaging
from srfs.program import MissionError
from srfs.report import check, percentile, pyplot, quantiles, verdict

TALKERS = ("timing", "can_switcher", "ttc", *PAYLOADS)  # nodes whose telemetry is listened to
PHASE_S = 60  # imaging.TASKS last for little more
SETTLE_S = 2.0
IDLE, IMAGING = PHASES = ("idle", "imaging")
LABELS = {IDLE: "light load: housekeeping alone", IMAGING: "heavy load: images captured five times a second and searched"}
PRIORITY = deployments.realtime()[PAYLOADS[0]]["priority"]  # of the subscriber
TELECOMMANDS = ("adcs.set_mode mode=point", "eps.switch_load load=2 state=on", "thermal.set_setpoint heater=1 setpoint_k=291.5")
TELECOMMAND_PERIOD_S = 2 / 3
LINES_MS = (10, 20)  # the paper's
GOALS_MS = {"p50": 0.15, "p99": 1, "max": 5}
LEAST_MS = 0.0051  # of the drawing
LARGEST_CLOCK_STEP_US = 1000
# A payload's topics count together.
GROUPS = {"/timing/tick": "tick", "/can/task_flags": "task flags", "/can/bus_status": "bus status", "/telecommand": "telecommands",
          "/telecommand_report": "telecommand reports", "activity": "activity", "telemetry": "telemetry"}  # fmt: skip


def group(topic):
    return GROUPS.get(topic) or GROUPS[topic.rsplit("/", 1)[1]]


def spread(latencies_ms):
    """Quantiles in ms, and how many were later than the paper's lines."""
    return {"samples": len(latencies_ms), **quantiles(latencies_ms, "p50 p99 p99_9 max", digits=4, suffix="_ms"), **{f"later_than_{line}_ms": sum(1 for x in latencies_ms if x > line) for line in LINES_MS}}


def judge_phase(name, phase, realtime_kernel):
    label = LABELS[name]
    silent = [topic for topic, of in phase["topics"].items() if of["samples"] == 0]
    late, very_late = (phase[f"later_than_{line}_ms"] for line in LINES_MS)
    return [
        check(not silent and phase["samples"], f"{label}: every topic was heard" + (f", but not {', '.join(silent)}" if silent else "")),
        check(phase["lost"] == 0 and phase["malformed"] == 0, f"{label}: no sample lost ({phase['lost']})"),
        check(abs(phase["clock_moved_us"]) < LARGEST_CLOCK_STEP_US, f"{label}: the system's clock made no step"),
        check(late <= 0.01 * phase["samples"], f"{label}: later than {LINES_MS[0]} ms is rare ({late} of {phase['samples']})"),
        check(very_late <= (0 if realtime_kernel else 0.001 * phase["samples"]),
              f"{label}: {'nothing' if realtime_kernel else 'at most one in a thousand'} later than {LINES_MS[1]} ms ({very_late})"),
    ]  # fmt: skip


def judge_goals(phases):
    return [{"phase": name, "what": what, "goal_ms": goal, "value_ms": phase[f"{what}_ms"], "met": phase[f"{what}_ms"] is not None and phase[f"{what}_ms"] <= goal}
            for name, phase in phases.items() for what, goal in GOALS_MS.items()]  # fmt: skip


class Fig13(Experiment):
    """Latencies in ms; rows_of[phase]: (seconds since the phase's first sample, topic, latency)."""

    TITLES = {"fig13": "latency of publish-subscribe: the mission's topics, idle and beside image processing"}
    DEPLOYMENT = "sim"
    COLUMNS = ("phase", "topic", "published_s", "latency_ms")

    def __init__(self, *flight):
        super().__init__(*flight)
        self.phase_s = PHASE_S
        self.rows_of = {}
        self.said = {}  # phase -> what the subscriber and the machine counted

    @staticmethod
    def varied(deployment, folder):
        """The deployment with real-time housekeeping, and the image lane on the last CPU."""
        lane = {"policy": "other", "priority": 0, "background": True, "cpus": [max(os.sched_getaffinity(0))]}
        scheduling = {**deployments.realtime(), "image_acquisition": lane, "image_processing": lane}
        return deployments.write(deployments.scheduled(deployments.read(deployment), scheduling), folder / "fig13.yaml")

    def run(self):
        self.machine = machine()
        self.realtime = may_be_real_time()
        if not self.realtime:
            self.say("this process may not use SCHED_FIFO (root or CAP_SYS_NICE): everything runs with normal scheduling")
        ground = self.flight.ground()
        self.signals.pause(SETTLE_S)
        self.record(IDLE, ground)
        self.say("imaging begins")
        imaging.begin_imaging(ground, frames=min(imaging.FRAMES, 3 + round(self.phase_s)))  # soon, in a short run
        self.record(IMAGING, ground)
        self.restarts = sum(node["restarts"] for node in self.flight.status())

    def record(self, phase, ground):
        self.say(f"{LABELS[phase]}: {self.phase_s:g} s")
        file = self.flight.var / "log" / f"{phase}.csv"
        command = [self.flight.program("bench_topics"), "--domain", str(self.flight.domain), "--duration", str(self.phase_s), "--out", str(file),
                   "--payload", *PAYLOADS, "--node", *TALKERS, *(["--fifo", str(PRIORITY)] if self.realtime else [])]  # fmt: skip
        frames, stolen = imaging.frames(self.flight.var), stolen_s()
        with subprocess.Popen(command, stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as subscriber:
            try:
                sent = 0
                while subscriber.poll() is None:
                    ground.send(f"tc {TELECOMMANDS[sent % len(TELECOMMANDS)]}")
                    sent += 1
                    self.signals.pause(TELECOMMAND_PERIOD_S)
            finally:
                subscriber.terminate()
            out, problem = subscriber.communicate()
        if subscriber.returncode != 0:
            raise MissionError(f"bench_topics: {problem.strip()}")
        frames_now = imaging.frames(self.flight.var)
        self.said[phase] = {**json.loads(out), "telecommands": sent, "stolen_cpu_s": round(stolen_s() - stolen, 2),
                            **{f"frames_{key}": frames_now[key] - frames[key] for key in frames}}  # fmt: skip
        with open(file, newline="") as lines:
            read = [(row["topic"], int(row["published_ns"]), int(row["received_ns"])) for row in csv.DictReader(lines)]
        begin = min((published for _, published, _ in read), default=0)
        self.rows_of[phase] = [((published - begin) / 1e9, topic, (received - published) / 1e6) for topic, published, received in read]

    # --- judgement ----------------------------------------------------------------------------------------------------

    def judge(self):
        phases = {}
        for name, rows in self.rows_of.items():
            topics = {title: spread([latency for _, topic, latency in rows if group(topic) == title]) for title in GROUPS.values()}
            phases[name] = {**spread([latency for _, _, latency in rows]), "topics": topics, **{k: v for k, v in self.said[name].items() if k != "samples"}}
        imaging = phases[IMAGING]
        realtime_kernel = self.machine["preemption"] == "PREEMPT_RT"
        checks = [c for name, phase in phases.items() for c in judge_phase(name, phase, realtime_kernel)]
        checks += [
            check(imaging["frames_captured"] >= self.phase_s and imaging["frames_processed"] > 0,
                  f"images were processed all the time: {imaging['frames_captured']} captured, {imaging['frames_processed']} searched"),
            check(self.restarts == 0, f"no node was restarted ({self.restarts})"),
        ]  # fmt: skip
        scheduling = f"SCHED_FIFO, the subscriber {PRIORITY}" if self.realtime else "normal: SCHED_FIFO is not allowed"
        return self.summary(checks, machine=self.machine, scheduling=scheduling, phase_s=self.phase_s, phases=phases, goals=judge_goals(phases))

    @staticmethod
    def text(summary):
        lines = [f"  {described(summary['machine'])}; {summary['scheduling']}"]
        for name, phase in summary["phases"].items():
            lines.append(f"  {LABELS[name]}; the host took {phase['stolen_cpu_s']} s of CPU time")
            for title, of in (("all", phase), *phase["topics"].items()):
                lines.append(f"    {title:20} {of['samples']:6} samples: p50 {of['p50_ms']} ms, p99 {of['p99_ms']}, p99.9 {of['p99_9_ms']}, at most {of['max_ms']} ms")
        lines += [f"  goal {g['what']} <= {g['goal_ms']} ms, {g['phase']}: {g['value_ms']} ms, {verdict(g['met'])}" for g in summary["goals"]]
        return "\n".join(lines)

    # --- files --------------------------------------------------------------------------------------------------------

    def rows(self):
        for phase, recorded in self.rows_of.items():
            yield from ([phase, topic, f"{at:.6f}", f"{latency:.4f}"] for at, topic, latency in recorded)

    def draw(self, folder):
        """SVG and PNG like the paper's figure: latency over time and its histogram for each phase, with the lines of 10 and 20 ms."""
        figure, grid = pyplot().subplots(len(PHASES), 2, figsize=(11, 6.6), sharex="col", width_ratios=(3, 2))
        edges = [10 ** (k / 20) for k in range(-46, 30)]  # 0.005 to 28 ms, twenty bins a decade
        for number, phase in enumerate(PHASES):
            series, histogram = grid[number]
            for title in GROUPS.values():
                points = [(at, latency) for at, topic, latency in self.rows_of[phase] if group(topic) == title]
                series.plot(*zip(*points), ".", markersize=1.8, label=title, rasterized=True) if points else None
            latencies = [latency for _, _, latency in self.rows_of[phase]]
            histogram.hist([min(max(x, LEAST_MS), 0.999 * edges[-1]) for x in latencies], bins=edges, histtype="step", linewidth=1.1)
            for line in LINES_MS:
                series.axhline(line, color="red", linewidth=0.8, linestyle="--")
                histogram.axvline(line, color="red", linewidth=0.8, linestyle="--")
                series.text(0, line, f"{line} ms ", fontsize=7, color="red", va="bottom")
            series.set_yscale("log")
            series.set_ylim(LEAST_MS, 30)
            series.yaxis.set_major_formatter("{x:g}")
            series.set_ylabel("latency [ms]")
            histogram.set_xscale("log")
            histogram.set_yscale("log")
            histogram.set_xlim(LEAST_MS, 30)
            histogram.xaxis.set_major_formatter("{x:g}")
            histogram.set_ylim(bottom=0.7)
            histogram.set_ylabel("samples")
            series.set_title(f"({'ab'[number]}) {LABELS[phase]}", fontsize=9, loc="left")
            if latencies:
                p50, p99, most = (percentile(latencies, q) for q in (0.5, 0.99, 1.0))
                histogram.set_title(f"p50 {p50:.2g} ms, p99 {p99:.2g} ms, at most {most:.2g} ms", fontsize=9, loc="left")
        grid[-1][0].set_xlabel("time [s]")
        grid[-1][1].set_xlabel("latency [ms]")
        figure.legend(*grid[0][0].get_legend_handles_labels(), loc="lower center", ncol=len(GROUPS), fontsize=8, frameon=False, markerscale=5)
        figure.suptitle(f"Fig. 13: latency of publish-subscribe; {described(self.machine)}", fontsize=10)
        self.save(figure, folder, 90, rect=(0, 0.03, 1, 1))
