# SPDX-FileCopyrightText: 2026 SRFS contributors
# SPDX-License-Identifier: Apache-2.0
"""./run bench: measures, as a table or one JSON object."""

import argparse
import json
import pathlib
import sys
import tempfile

from srfs import ROOT, demo
from srfs.flight import mission
from srfs.measures import can, detector, imaging, link, ros, time_discipline
from srfs.report.display import Display


def flight(bin_dir, duration_s):
    """The measures of a demo flight."""
    with tempfile.TemporaryDirectory(prefix="srfs-bench-") as folder:
        options = demo.parse(["--var", f"{folder}/var", "--bin", str(bin_dir), "--duration", str(duration_s)])
        return demo.fly(options, Display(quiet=True), mission.StopSignals())


def show_flight(summary):
    for key, value in summary.get("measures", {}).items():
        if key == "next_slot_by_can_frame" and value:
            late = "".join(f"; {text}" for text in value["late"])
            print(f"  {key}: {value['in_next_slot']} of {value['checked']}, at most {value['longest_ms']:.0f} ms after the octets{late}")
        else:
            print(f"  {key}: {json.dumps(value)}")
    for failure in summary["failures"]:
        print(f"not as expected: {failure}", file=sys.stderr)


def main():
    parser = argparse.ArgumentParser(prog="./run bench")
    parser.add_argument("what", nargs="*", choices=[[], "ros", "mission", "can", "link", "time", "image", "imaging"], metavar="ros|mission|can|link|time|image|imaging", help="what to measure; default: everything")
    parser.add_argument("--duration", type=float, default=110, metavar="S", help="bench mission: length of the flight; 110 s have more than 1000 ticks")
    parser.add_argument("--slots-for", type=float, default=30, metavar="S", help="bench can: time at each tick period")
    parser.add_argument("--fifo", action="store_true", help="bench can, imaging: timing, switcher and payloads (imaging: ttc too) under SCHED_FIFO, as on a board")
    parser.add_argument("--imaging-for", type=float, default=60, metavar="S", help="bench imaging: time of each of its three flights, at most 70")
    parser.add_argument("--seeds", type=int, default=20, metavar="N", help="bench time: number of seeds")
    parser.add_argument("--json", action="store_true", help="print one JSON object")
    parser.add_argument("--bin", type=pathlib.Path, default=ROOT / "build-release" / "bin", help=argparse.SUPPRESS)
    ros.add_options(parser)
    link.add_options(parser)
    detector.add_options(parser)
    options = parser.parse_args()
    wanted = options.what or ["ros", "mission", "can", "link", "time", "image", "imaging"]
    results = {}
    if "ros" in wanted:
        results["ros"] = ros.measure(options.bin, options, lambda text: print(text, file=sys.stderr, flush=True))
        if not options.json:
            ros.show(results["ros"])
        if options.out and (problem := ros.write(results["ros"], options.out)):
            print(f"bench: {problem}", file=sys.stderr)
    if "mission" in wanted:
        results["mission"] = flight(options.bin, options.duration)
        if not options.json:
            show_flight(results["mission"])
    if "can" in wanted:
        results["can"] = can.measure(options.bin, options.slots_for, lambda text: print(text, file=sys.stderr, flush=True), options.fifo)
        if not options.json:
            can.show(results["can"])
    if "link" in wanted:
        results["link"] = link.measure(options.bin, options, lambda text: print(text, file=sys.stderr, flush=True))
        if not options.json:
            link.show(results["link"])
    if "time" in wanted:
        results["time"] = time_discipline.measure(options.bin, options.seeds)
        if not options.json:
            time_discipline.show(results["time"])
    if "image" in wanted:
        results["image"] = detector.measure(options.bin, options, lambda text: print(text, file=sys.stderr, flush=True))
        if not options.json:
            detector.show(results["image"])
    if "imaging" in wanted:
        results["imaging"] = imaging.measure(options.bin, options, lambda text: print(text, file=sys.stderr, flush=True))
        if not options.json:
            imaging.show(results["imaging"])
    if options.json:
        print(json.dumps(results))
    sound = ("ros" not in results or ros.is_sound(results["ros"])) and ("can" not in results or can.is_sound(results["can"]))
    sound = sound and ("link" not in results or link.is_sound(results["link"]))
    sound = sound and ("time" not in results or time_discipline.is_sound(results["time"]))
    sound = sound and ("image" not in results or detector.is_sound(results["image"]))
    sound = sound and ("imaging" not in results or imaging.is_sound(results["imaging"]))
    return 0 if sound and results.get("mission", {"ok": True})["ok"] else 1


if __name__ == "__main__":
    mission.run_program("bench", main)
