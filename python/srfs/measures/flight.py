# SPDX-FileCopyrightText: 2026 SRFS contributors
# SPDX-License-Identifier: Apache-2.0
"""./run bench mission: the measures of a demo flight."""

import json
import sys
import tempfile

from srfs import demo
from srfs.flight.processes import StopSignals
from srfs.report import Display


def add_options(parser):
    parser.add_argument("--duration", type=float, default=110, metavar="S", help="bench mission: length of the flight; 110 s have more than 1000 ticks")


def measure(bin_dir, options, say):
    with tempfile.TemporaryDirectory(prefix="srfs-bench-") as folder:
        flown = demo.parse(["--var", f"{folder}/var", "--bin", str(bin_dir), "--duration", str(options.duration)])
        return demo.fly(flown, Display(quiet=True), StopSignals())


def is_sound(summary):
    return summary["ok"]


def show(summary):
    for key, value in summary.get("measures", {}).items():
        if key == "next_slot_by_can_frame" and value:
            late = "".join(f"; {text}" for text in value["late"])
            print(f"  {key}: {value['in_next_slot']} of {value['checked']}, at most {value['longest_ms']:.0f} ms after the octets{late}")
        else:
            print(f"  {key}: {json.dumps(value)}")
    for failure in summary["failures"]:
        print(f"not as expected: {failure}", file=sys.stderr)
