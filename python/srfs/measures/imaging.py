# SPDX-FileCopyrightText: 2026 SRFS contributors
# SPDX-License-Identifier: Apache-2.0
"""./run bench imaging: what imaging flat out, and compiling on board, do to the rest of the suite.

Three flights, one after the other: the same telecommands at the same rate, without a load; while frames of 1920 x 1080 pixels are captured five
times a second and those of the task before are searched for streaks; while packages of sources are built, one after the other, whose self-test
fails, so that nothing is swapped. Latencies are those of the nodes themselves.
"""

import contextlib
import threading
import time

from srfs import ROOT
from srfs.flight import deployments, mission
from srfs.measures.can import listen, spread
from srfs.program import MissionError
from srfs.report import verdict

FRAMES = 25  # of a task
INTERVAL_MS = 200
TASKS = 15  # one fewer than ttc takes
PING_PERIOD_S = 0.1
READY_S = 30
PROCESSING_STEP = 101
RATIO_GOALS = {"accept_us": 2, "tick_late_us": 1.3, "flag_us": 1.3}  # p99 beside a load over p99 without
LOADS = ("idle", "imaging", "building")
UPDATE_S = 120


def deployment(fifo):
    sim = deployments.read("sim")
    return deployments.scheduled(sim, deployments.realtime()) if fifo else sim


def begin_imaging(ground, frames=FRAMES):
    """As many tasks as ttc takes, enough for the whole flight. @return once one is captured while another is processed"""
    lines = [ground.send(f"tc image.capture task={task} exposure_us=50000 frames={frames} interval_ms={INTERVAL_MS} method=streak") for task in range(1, TASKS + 1)]
    first = ground.wait_for(lambda m: m["type"] == "tc_stage" and m["line"] == lines[0] and (m["final"] or m.get("step", 0) >= PROCESSING_STEP), READY_S)
    if first is None or first["final"]:
        raise MissionError(f"imaging does not begin: {first}")


class Building:
    """Packages of payload_thermal, one after the other in a session's telecommands, until the end of the block."""

    def __init__(self, flight, ground):
        self.flight, self.ground = flight, ground
        self.built = 0
        self._enough = threading.Event()
        self._thread = threading.Thread(target=self._run)

    def __enter__(self):
        self._begin(1)
        self._thread.start()
        return self

    def __exit__(self, *failure):
        self._enough.set()
        self._thread.join()

    def _begin(self, counter):
        sources, files = self.flight.var / "sources", self.flight.var / "files"
        sources.mkdir(exist_ok=True)
        files.mkdir(exist_ok=True)
        text = (ROOT / "examples" / "payload_idle" / "main.cpp").read_text()
        (sources / "main.cpp").write_text(text.replace("int main(int argc, char** argv) {\n", "int main(int argc, char** argv) {\n  return 6;\n") + f"// {counter}\n")
        self.flight.ground_tool("package", "make", "--node", "payload_thermal", "--kind", "replace", "--counter", counter, "--sources", sources, "--option=-O2", "--self-test", 3,
                                "--probation", 60, "--key", self.flight.var / "ground" / "package_test.seed", "-o", files / f"{counter}.pkg")  # fmt: skip
        outcome = self.ground.command(f"tc package.install file={counter}.pkg", UPDATE_S)
        if (outcome or {}).get("stage") != "completed":
            raise MissionError(f"package.install: {outcome}")

    def _run(self):
        for counter in range(2, 100):
            failed = self.ground.wait_for(lambda m, file=f"{counter - 1}.pkg": m.get("event") == "update.failed" and file in m["text"], UPDATE_S)
            if failed is None or self._enough.is_set():
                return
            self.built += 1
            self._begin(counter)


def fly(bin_dir, name, duration_s, fifo):
    with mission.short_flight(bin_dir, deployment(fifo)) as flight, contextlib.ExitStack() as load:
        recorder, rotation = listen(flight, READY_S)
        ground = flight.ground()
        if name == "imaging":
            begin_imaging(ground)
        building = load.enter_context(Building(flight, ground)) if name == "building" else None
        frames_before = frames(flight.var)
        begin, position, pings = time.monotonic_ns(), recorder.position(), []
        while time.monotonic_ns() - begin < duration_s * 1e9:
            pings.append(ground.send("ping"))
            time.sleep(PING_PERIOD_S)
        end = time.monotonic_ns()
        built = building.built if building else 0
        frames_after = frames(flight.var)
        lost_pings = sum(1 for line in pings if (ground.outcome(line, READY_S) or {}).get("stage") != "completed")
        ttc, switcher = (ground.fresh(structure, READY_S) for structure in ("ttc", "can_switcher"))
        ticks = recorder.select(lambda m: m["type"] == "tick" and begin <= m["published_ns"] <= end, position)
        slots = [s for s in rotation.recorded_slots() if begin <= s["published"] <= end and s["holder"]]
        restarts = flight.restarts()
    return {
        "seconds": round((end - begin) / 1e9, 1),
        "telecommands": len(pings),
        "telecommands_lost": lost_pings,
        "accept_us": {q: ttc[f"acceptance_latency_{q}_us"] for q in ("p50", "p99", "max")},
        "tick_late_us": spread([m["published_ns"] - m["due_ns"] for m in ticks]),
        "flag_us": {q: switcher[f"flag_latency_{q}_us"] for q in ("p50", "p99", "max")},
        "slots": len(slots),
        "slots_lost": sum(1 for s in slots if s["status"] not in ("released", "not used")),
        "frames_per_s": round((frames_after["captured"] - frames_before["captured"]) / ((end - begin) / 1e9), 2),
        "processed_per_s": round((frames_after["processed"] - frames_before["processed"]) / ((end - begin) / 1e9), 2),
        "packages_built": built,
        "restarts": restarts,
    }


def frames(var):
    """On the disk: stored ones, and those of them that carry the mark of having been searched."""
    folder = var / "images" / "frames"
    return {"captured": len(list(folder.glob("*/*.fits"))), "processed": sum(len(list(folder.glob(f"*/*.{mark}"))) for mark in ("detected", "nothing"))}


def add_options(parser):
    parser.add_argument("--imaging-for", type=float, default=60, metavar="S", help="bench imaging: time of each of its three flights, at most 70")


def measure(bin_dir, options, say):
    result = {"scheduling": "fifo" if options.fifo else "other"}
    programs = mission.installed(bin_dir)  # what compiles on board needs headers and libraries
    for name in LOADS:
        say(f"bench imaging: {name}, {options.imaging_for:.0f} s")
        result[name] = fly(programs, name, options.imaging_for, options.fifo)
    for name in LOADS[1:]:
        result[f"ratio_p99_{name}"] = {key: round(result[name][key]["p99"] / max(1, result["idle"][key]["p99"]), 2) for key in ("accept_us", "tick_late_us", "flag_us")}
    return result


def is_sound(result):
    """Nothing that no load excuses."""
    return all(result[name]["telecommands_lost"] == 0 and result[name]["restarts"] == 0 for name in LOADS)


def show(result):
    for name in LOADS:
        row = result[name]
        print(f"  {name}: telecommand to 1,1 {row['accept_us']}, tick behind its time {row['tick_late_us']}, tick to flag {row['flag_us']} us; {row['slots_lost']} of {row['slots']} slots lost; "
              f"{row['telecommands_lost']} of {row['telecommands']} telecommands lost; {row['frames_per_s']} frames/s captured, {row['processed_per_s']} processed, {row['packages_built']} packages built")  # fmt: skip
    for name in LOADS[1:]:
        judged = [f"{key} {ratio} ({verdict(ratio <= RATIO_GOALS[key])}, goal {RATIO_GOALS[key]})" for key, ratio in result[f"ratio_p99_{name}"].items()]
        lost = result[name]["slots_lost"]
        print(f"  p99 while {name} over idle: {', '.join(judged)}; slots lost {lost} ({verdict(lost == 0)})")
