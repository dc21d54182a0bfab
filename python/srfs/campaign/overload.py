# SPDX-FileCopyrightText: 2026 SRFS contributors
# SPDX-License-Identifier: Apache-2.0
"""The overload campaign: the mission beside programs that take the CPUs. A node that waits for a CPU is not restarted; a dead one is still found."""

import dataclasses
import json
import shutil
import subprocess
import sys
import tempfile
import time

from srfs.campaign import faults
from srfs.campaign.campaign import TELECOMMANDS
from srfs.flight.deployments import NODES, PAYLOADS
from srfs.flight.machine import stress_ng
from srfs.report import all_ok, check_none

LOAD = "--cpu 16"  # options of stress-ng
HEAVY_LOAD = "--cpu 48 --io 4 --vm 2"
FLOOD = "--cpu 60"
FOUND_WITHIN_S = 5.0
BACK_WITHIN_S = 3.0
FRESH_S = 5.0  # maximum age of an answer under load
INJECTED = ("kill", "segfault", "stop", "loop", "deadlock", "worker")
CLASSES = (*(dataclasses.replace(fault, p50_s=FOUND_WITHIN_S, max_s=FOUND_WITHIN_S, bound_s=60) for fault in faults.CLASSES if fault.name in INJECTED),
           faults.HOG_CLASS)  # fmt: skip
DEMO_DEADLINE_S = 900


def busy(load):
    """stress-ng beside the mission until the end of the block, each worker a competitor of its own."""
    return stress_ng(load, each_alone=True)


class Overload(faults.FaultCampaign):
    """Faults beside LOAD, one of the suite's own processes that takes the CPUs, and an overload that ends."""

    def __init__(self, flight, wrappers, signals, seed, say):
        super().__init__(flight, wrappers, signals, seed, say, CLASSES, FRESH_S)
        self.starved = []  # (node, detail reported by the ring)
        self.back_s = None

    def on_record(self, message):
        if message["type"] == "liveness" and message["verdict"] == "starved":
            self.starved.append((message["subject"], message["detail"]))
        super().on_record(message)

    def flood(self, seconds):
        """Runs an overload for so many seconds. No node is restarted, and soon after its end all nodes work as before."""
        self.wait_until_steady()
        trial = faults.Trial("overload", NODES, "none")
        before = self._pids()
        begin = time.monotonic_ns()
        with busy(FLOOD):
            self.signals.pause(seconds)
        trial.begin = time.monotonic_ns()
        self.overloads.append((begin, trial.begin))
        self.fresh_ns = 400_000_000
        self.signals.wait_until(lambda: self._is_steady() and self._answers_since(trial.begin), faults.STEADY_DEADLINE_S,
                                "all nodes Active and answering after the overload")  # fmt: skip
        self.back_s = (time.monotonic_ns() - trial.begin) / 1e9
        self.fresh_ns = int(FRESH_S * 1e9)
        trial.false_restarts = self._changed(before)
        self.trials.append(trial)
        return trial

    def _answers_since(self, begin):
        """Whether, since `begin`, every node answered a check and each payload released a slot and completed a telecommand."""
        with self._lock:
            checked = all(alive[2] > begin for alive in self._alive.values())
        used = {m["payload"] for m in self.messages[-200:] if m["type"] == "bus" and m["status"] == "released" and m["said_ns"] > begin}
        return checked and used >= set(PAYLOADS) and self._commanded_since(begin) >= set(PAYLOADS)

    def _commanded_since(self, begin):
        """Payloads that have completed a telecommand since `begin`."""
        payload_of = {line.split()[0]: payload for payload, lines in TELECOMMANDS.items() for line in lines}
        return {payload_of.get(m["command"]) for m in self.messages[-400:] if m["type"] == "tc_stage" and m["stage"] == "completed" and m["at_ns"] > begin}

    def calm(self, seconds):
        """Runs for so many seconds with LOAD only, which the caller has started. Any restart in this time is false."""
        self.wait_until_steady()
        trial = faults.Trial("soak", NODES, "none", begin=time.monotonic_ns())
        before = self._pids()
        self.signals.pause(seconds)
        trial.false_restarts = self._changed(before)
        self.trials.append(trial)
        return trial


def run_for(command, seconds, signals):
    """Runs a command for so long at most, less when the end of the campaign is asked for; then it is ended in order.

    Returns its exit code, what it said, and whether it was ended.
    """
    with tempfile.TemporaryFile("w+") as said:
        process = subprocess.Popen(command, stdin=subprocess.DEVNULL, stdout=said, stderr=subprocess.STDOUT)
        end = time.monotonic() + seconds
        while process.poll() is None and time.monotonic() < end and not signals.wait(0.2):
            pass
        ended = process.poll() is None
        if ended:
            process.terminate()
        code = process.wait()
        said.seek(0)
        return code, said.read(), ended


def fly_sim(options, out, seconds, signals, say):
    """Runs ./run sim for so many seconds beside LOAD. Returns its messages about nodes that ended or were restarted, and how it ended."""
    with busy(LOAD):
        signals.wait(2)  # the load starts before the suite
        command = [sys.executable, "-B", "-m", "srfs.sim", "--bin", str(options.bin), "--var", str(out / "sim")]
        code, said, _ = run_for(command, seconds, signals)
    lines = said.splitlines()
    restarts = [line for line in lines if line.startswith("! ")]
    say(f"./run sim for {seconds:.0f} s beside {LOAD}: exit code {code}, {len(restarts)} nodes restarted")
    return {"seconds": seconds, "code": code, "restarts": restarts, "end": lines[-3:]}


def failures_of(said):
    """What the demo's last line, a JSON object, has; what it said instead, when it has none."""
    lines = said.splitlines() or [""]
    try:
        return json.loads(lines[-1])["failures"]
    except (ValueError, KeyError, TypeError):
        return [said.strip()[-500:]]


def fly_demos(options, out, load, count, signals, say):
    """Runs the demo `count` times beside a load. Returns ok, seconds, failures and load of each run. The record of one that fails stays."""
    runs = []
    for number in range(1, count + 1):
        begin = time.monotonic()
        var = out / f"demo{number}"
        with busy(load):
            signals.wait(2)  # the load starts before the suite
            command = [sys.executable, "-B", "-m", "srfs.demo", "--bin", str(options.bin), "--var", str(var), "--json"]
            code, said, ended = run_for(command, DEMO_DEADLINE_S, signals)
        if signals.asked:
            say(f"ended by request in demo {number} of {count}")
            return runs
        ok = code == 0 and not ended
        failures = [f"not done within {DEMO_DEADLINE_S} s"] if ended else failures_of(said)
        runs.append({"ok": ok, "seconds": round(time.monotonic() - begin, 1), "failures": failures, "load": load})
        if ok:
            shutil.rmtree(var, ignore_errors=True)
        kept = "" if ok else f"; its record: {var}"
        say(f"demo {number} of {count} beside {runs[-1]['load']}: {'ok' if ok else failures} after {runs[-1]['seconds']} s{kept}")
    return runs


def summarize(campaign, demos, sim=None):
    """Like faults.summarize(), with this campaign's additional goals and checks."""
    summary = faults.summarize(campaign)
    took = [t.seconds("active") for t in campaign.trials if t.expected == "restart" and t.active]
    summary["goals"] = [{"what": f"found and Active again within {FOUND_WITHIN_S:.0f} s: {sum(s <= FOUND_WITHIN_S for s in took)} of {len(took)}",
                         "met": all(s <= FOUND_WITHIN_S for s in took)}]  # fmt: skip
    if campaign.back_s is not None:
        summary["goals"].append({"what": f"as before within {BACK_WITHIN_S:.0f} s of the end of an overload: {campaign.back_s:.1f} s",
                                 "met": campaign.back_s <= BACK_WITHIN_S})  # fmt: skip
    more = []
    if demos:
        bad = [f"beside {run['load']}: {'; '.join(run['failures'])[:300]}" for run in demos if not run["ok"]]
        more.append(check_none(bad, "the demo is as expected beside the load", len(demos)))
    if sim:
        more.append(check_none([*sim["restarts"], *(sim["end"] if sim["code"] else [])], "nobody is restarted in ./run sim, which ends in order", 1))
        summary["sim"] = sim
    summary["checks"] += more
    summary["ok"] = all_ok(summary["checks"])
    summary["starved"] = [f"{node} {detail}" for node, detail in campaign.starved]
    summary["back_s"] = campaign.back_s
    summary["demos"] = demos
    return summary
