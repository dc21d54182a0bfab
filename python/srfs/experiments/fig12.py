# SPDX-FileCopyrightText: 2026 SRFS contributors
# SPDX-License-Identifier: Apache-2.0
"""The paper's Fig. 12: how late Linux wakes a task of 1 ms and priority 99, by cyclictest, one thread a CPU. No flight of the suite.

Three phases: idle, every CPU computing (stress-ng), idle with power management off (governor performance, frequency locked at the
highest, no deep idle states). The first two leave power management alone, which cyclictest by itself does not.

The paper's shape, on PREEMPT_RT: wake-ups are late by microseconds, by less than 500 us at most, under load too; what is worse in idle is
power management's and goes with it. Judged in each phase: the wake-ups that were due came, 99 % of them within 500 us; on a kernel with
PREEMPT_RT, which alone promises it, every one. A phase that this machine does not allow is reported with the reason, and not judged.
"""

import contextlib
import os
import pathlib
import shutil
import subprocess
import tempfile
import textwrap

from srfs.experiments.experiment import Experiment
from srfs.flight.machine import described, machine, may_be_real_time, read, stolen_s, stress_ng
from srfs.program import MissingProgram, MissionError
from srfs.report import check, pyplot

PHASE_S = 60
PRIORITY = 99
INTERVAL_US = 1000
BOUND_US = 500  # the paper's
LARGEST_US = 20000  # of the histogram; what is later is counted, and the maximum known
QUANTILES = {"p50": 0.5, "p99": 0.99, "p99_9": 0.999}
IDLE, LOAD, LOCKED = PHASES = ("idle", "load", "idle_locked")
LABELS = {IDLE: "no load", LOAD: "full load (stress-ng)", LOCKED: "no load, governor performance and frequency locked"}
CPUS = pathlib.Path("/sys/devices/system/cpu")
# Waits until this process is gone or closes the pipe, however it ends, then writes each value into its file.
PUT_BACK = 'read -r _; while [ $# -gt 1 ]; do printf %s "$2" > "$1"; shift 2; done'


class NotPossible(MissionError):
    """Why this machine does not allow a phase."""


def require_cyclictest():
    if shutil.which("cyclictest") is None:
        raise MissingProgram("cyclictest", "rt-tests")
    if not may_be_real_time():
        raise NotPossible("this process may not use SCHED_FIFO (root or CAP_SYS_NICE)")


# --- cyclictest -------------------------------------------------------------------------------------------------------

def parse_histogram(text):
    """What cyclictest -h prints: {"counts": [per thread {us: wake-ups}], "later": [wake-ups past the histogram], "max_us": [of each thread]}."""
    counts, later, maxima = [], [], []
    for line in text.splitlines():
        name, _, values = line.partition(":")
        if line.startswith("# Histogram Overflows"):
            later = [int(word) for word in values.split()]
        elif line.startswith("# Max Latencies"):
            maxima = [int(word) for word in values.split()]
        elif name.split() and name.split()[0].isdigit():
            us, *wakeups = map(int, line.split())
            counts = counts or [{} for _ in wakeups]
            for thread, n in enumerate(wakeups):
                if n:
                    counts[thread][us] = n
    return {"counts": counts, "later": later, "max_us": maxima}


def quantile(counts, later, q):
    """The q-quantile in us; None: there is none, or it lies past the histogram."""
    left = int(q * (sum(counts.values()) + later))
    for us, n in sorted(counts.items()):
        if left < n:
            return us
        left -= n
    return None


def together(found):
    """One histogram of all threads, and what lies past it."""
    merged = {}
    for counts in found["counts"]:
        for us, n in counts.items():
            merged[us] = merged.get(us, 0) + n
    return merged, sum(found["later"])


def summarize(found):
    counts, later = together(found)
    within = sum(n for us, n in counts.items() if us <= BOUND_US)
    wakeups = sum(counts.values()) + later
    return {"wakeups": wakeups, **{f"{name}_us": quantile(counts, later, q) for name, q in QUANTILES.items()}, "max_us": max(found["max_us"], default=None),
            "max_us_of_each_cpu": found["max_us"], "later_than_500_us": wakeups - within}  # fmt: skip


def judge_phase(name, phase, expected, realtime):
    """The checks of a phase that ran."""
    label, late, wakeups = LABELS[name], phase["later_than_500_us"], phase["wakeups"]
    checks = [
        check(wakeups >= 0.9 * expected, f"{label}: {wakeups} wake-ups of about {expected} that were due"),
        check(wakeups and late <= 0.01 * wakeups, f"{label}: 99 % of the wake-ups within {BOUND_US} us ({late} later)"),
    ]
    if realtime:
        checks.append(check(phase["max_us"] is not None and phase["max_us"] < BOUND_US, f"{label}: all wake-ups within {BOUND_US} us (at most {phase['max_us']} us)"))
    return checks


# --- power management -------------------------------------------------------------------------------------------------

class LockedFrequency:
    """Governor performance and the highest frequency on every CPU, between __enter__ and __exit__.

    A process of its own puts the values back when the pipe to this one closes: also when this one is killed.
    """

    def __init__(self, cpus=CPUS):
        self._folders = sorted(cpus.glob("cpu[0-9]*/cpufreq"))
        self._keeper = None

    def __enter__(self):
        if not self._folders:
            raise NotPossible("the kernel offers no frequency scaling (no cpufreq), as in most virtual machines")
        before = []
        for folder in self._folders:
            if "performance" not in (read(folder / "scaling_available_governors") or "").split():
                raise NotPossible(f"{folder} has no governor performance")
            for name in ("scaling_min_freq", "scaling_max_freq", "scaling_governor"):  # the lowest first: it never lies above the highest
                before += [str(folder / name), read(folder / name)]
        self._keeper = subprocess.Popen(["/bin/sh", "-c", PUT_BACK, "sh", *before], stdin=subprocess.PIPE, stdout=subprocess.DEVNULL,
                                        stderr=subprocess.DEVNULL, start_new_session=True)  # fmt: skip
        try:
            for folder in self._folders:
                highest = read(folder / "cpuinfo_max_freq")
                for name, value in (("scaling_governor", "performance"), ("scaling_max_freq", highest), ("scaling_min_freq", highest)):
                    (folder / name).write_text(value)
        except OSError as error:
            self.__exit__()
            raise NotPossible(f"the frequency cannot be locked: {error}") from None
        return self

    def __exit__(self, *_):
        self._keeper.stdin.close()
        self._keeper.wait()


class Fig12(Experiment):
    TITLES = {"fig12": "scheduling latency (cyclictest, 1 ms, priority 99): idle, under load, idle without power management"}
    COLUMNS = ("phase", "cpu", "latency_us", "wakeups")

    def __init__(self, *flight):
        super().__init__(*flight)
        self.phase_s = PHASE_S
        self.found = {}  # phase -> what parse_histogram returns
        self.not_possible = {}  # phase -> why
        self.stolen_s = {}

    def run(self):
        self.machine = machine()
        # Every CPU computes; it ends by itself should this process be killed.
        load = f"--cpu {os.cpu_count()} --timeout {self.phase_s + 30:.0f}s"
        surroundings = {IDLE: contextlib.nullcontext, LOAD: lambda: stress_ng(load), LOCKED: LockedFrequency}
        for phase in PHASES:
            try:
                require_cyclictest()
                with surroundings[phase]():
                    self.say(f"{LABELS[phase]}: {self.phase_s:g} s")
                    stolen = stolen_s()
                    self.found[phase] = self.cyclictest(power_management=phase != LOCKED)
                    self.stolen_s[phase] = round(stolen_s() - stolen, 2)
            except (NotPossible, MissingProgram) as why:
                self.not_possible[phase] = str(why)
                self.say(f"{LABELS[phase]}: not possible here: {why}")

    def cyclictest(self, power_management):
        """@return its histogram"""
        command = ["cyclictest", "-m", f"-p{PRIORITY}", f"-i{INTERVAL_US}", "-t", "-a", "-q", f"-h{LARGEST_US}", f"-D{max(1, round(self.phase_s))}"]
        with tempfile.TemporaryFile("w+") as out, tempfile.TemporaryFile("w+") as problem:
            with subprocess.Popen(command + ["--default-system"] * power_management, stdin=subprocess.DEVNULL, stdout=out, stderr=problem) as run:
                try:
                    self.signals.wait_until(lambda: run.poll() is not None, self.phase_s + 30, "cyclictest ends", 0.1)
                finally:
                    run.terminate()
            out.seek(0)
            problem.seek(0)
            if run.returncode != 0:
                raise MissionError(f"cyclictest ended with {run.returncode}: {problem.read().strip()}")
            return parse_histogram(out.read())

    # --- judgement ----------------------------------------------------------------------------------------------------

    def judge(self):
        phases = {name: {**summarize(found), "stolen_cpu_s": self.stolen_s[name]} for name, found in self.found.items()}
        realtime = self.machine["preemption"] == "PREEMPT_RT"
        checks = []
        for name, phase in phases.items():
            expected = round(self.phase_s * 1e6 / INTERVAL_US) * len(self.found[name]["counts"])
            checks += judge_phase(name, phase, expected, realtime)
        return self.summary(checks, machine=self.machine, phase_s=self.phase_s, priority=PRIORITY, interval_us=INTERVAL_US, phases=phases, not_possible=self.not_possible)

    @staticmethod
    def text(summary):
        lines = [f"  {described(summary['machine'])}"]
        for name, phase in summary["phases"].items():
            lines.append(f"  {LABELS[name]}: p50 {phase['p50_us']} us, p99 {phase['p99_us']}, p99.9 {phase['p99_9_us']}, at most {phase['max_us']} us; "
                         f"{phase['later_than_500_us']} of {phase['wakeups']} later than {BOUND_US} us; the host took {phase['stolen_cpu_s']} s of CPU time")  # fmt: skip
        lines += [f"  {LABELS[name]}: not possible here: {why}" for name, why in summary["not_possible"].items()]
        return "\n".join(lines)

    # --- files --------------------------------------------------------------------------------------------------------

    def rows(self):
        for phase, found in self.found.items():
            for cpu, (counts, later) in enumerate(zip(found["counts"], found["later"])):
                yield from ([phase, cpu, us, n] for us, n in sorted(counts.items()))
                if later:
                    yield [phase, cpu, f">{LARGEST_US - 1}", later]

    def draw(self, folder):
        """SVG and PNG like the paper's figure: a histogram a phase, both axes logarithmic, a color a CPU."""
        figure, axes = pyplot().subplots(1, len(PHASES), figsize=(12, 4.2), sharey=True)
        longest = max([max(f["max_us"]) for f in self.found.values() if f["max_us"]], default=BOUND_US)
        for number, (axis, phase) in enumerate(zip(axes, PHASES)):
            axis.set_title(f"({'abc'[number]}) {LABELS[phase]}", fontsize=8)
            axis.set_xlabel("latency [us]")
            axis.set_xscale("log")
            axis.xaxis.set_major_formatter("{x:g}")
            axis.set_yscale("log")
            axis.set_xlim(1, 1.5 * max(longest, BOUND_US))
            if phase in self.not_possible:
                why = "\n".join(textwrap.wrap(self.not_possible[phase], 40))
                axis.text(0.5, 0.5, f"not possible here:\n{why}", transform=axis.transAxes, ha="center", fontsize=8)
                continue
            axis.axvline(BOUND_US, color="red", linewidth=0.9, linestyle="--", label=f"{BOUND_US} us")
            found = self.found[phase]
            for cpu, counts in enumerate(found["counts"]):
                us = sorted(counts)
                axis.plot(us, [counts[u] for u in us], ".", markersize=2.5, rasterized=True, label=f"CPU {cpu}, at most {found['max_us'][cpu]} us")
            axis.legend(fontsize=7, loc="upper right", markerscale=3)
        axes[0].set_ylabel("wake-ups")
        figure.suptitle(f"Fig. 12: scheduling latency; {described(self.machine)}", fontsize=10)
        self.save(figure, folder, 90)
