# SPDX-FileCopyrightText: 2026 SRFS contributors
# SPDX-License-Identifier: Apache-2.0
"""./run bench: measures, as a table or one JSON object."""

import argparse
import json
import sys

from srfs import program
from srfs.measures import can, detector, flight, ground, imaging, link, ros, time_discipline

MEASURES = {"ros": ros, "mission": flight, "can": can, "link": link, "ground": ground, "time": time_discipline, "image": detector, "imaging": imaging}


def main():
    parser = argparse.ArgumentParser(prog="./run bench")
    parser.add_argument("what", nargs="*", choices=[[], *MEASURES], metavar="|".join(MEASURES), help="what to measure; default: everything")
    parser.add_argument("--fifo", action="store_true", help="bench can, imaging: timing, switcher and payloads (imaging: ttc too) under SCHED_FIFO, as on a board")
    parser.add_argument("--json", action="store_true", help="print one JSON object")
    program.add_bin(parser)
    for measure in MEASURES.values():
        measure.add_options(parser)
    options = parser.parse_args()
    results = {}
    for name, measure in MEASURES.items():
        if options.what and name not in options.what:
            continue
        results[name] = measure.measure(options.bin, options, lambda text: print(text, file=sys.stderr, flush=True))
        if not options.json:
            measure.show(results[name])
    if options.json:
        print(json.dumps(results))
    return 0 if all(MEASURES[name].is_sound(result) for name, result in results.items()) else 1


if __name__ == "__main__":
    program.run_program("bench", main)
