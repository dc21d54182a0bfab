# SPDX-FileCopyrightText: 2026 SRFS contributors
# SPDX-License-Identifier: Apache-2.0
"""./run bench time: the time discipline on the simulated receiver, in simulated time; the worst of all seeds."""

import json

from srfs.flight.processes import output

RMS_GOAL_US, HOLDOVER_GOAL_US, INTERVAL_GOAL_PERCENT = 2.0, 1000.0, 1.0
COLUMNS = (
    ("rms_60_to_120_us", "rms 60-120 s, us", 2), ("rms_us", "rms from 60 s, us", 2), ("holdover_1h_us", "after 1 h of holdover, us", 0),
    ("holdover_1h_estimated_us", "estimated, us", 0), ("worst_interval_percent", "worst tick interval, %", 3),
)  # fmt: skip


def add_options(parser):
    parser.add_argument("--seeds", type=int, default=20, metavar="N", help="bench time: number of seeds")


def measure(bin_dir, options, say):
    return json.loads(output(bin_dir / "bench_time", "--seeds", options.seeds, timeout_s=None))


def show(cases):
    print(f"{'time discipline':28}" + "".join(f"{title:>28}" for _, title, _ in COLUMNS))
    for case in cases:
        print(f"  {case['name']:26}" + "".join(f"{case[key]:>28.{digits}f}" for key, _, digits in COLUMNS))


def is_sound(cases):
    """The goals, which are stated for a pulse with a jitter of 1 us and no more trouble."""
    plain = [case for case in cases if case["jitter_us"] <= 1 and case["name"] not in ("lost and false pulses", "two receivers")]
    return (
        all(case["locked_at_60"] and case["rms_us"] <= RMS_GOAL_US and case["holdover_1h_us"] <= HOLDOVER_GOAL_US for case in plain)
        and all(case["worst_interval_percent"] <= INTERVAL_GOAL_PERCENT + 1e-4 for case in cases)
    )  # fmt: skip
