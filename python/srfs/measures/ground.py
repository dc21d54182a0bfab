# SPDX-FileCopyrightText: 2026 SRFS contributors
# SPDX-License-Identifier: Apache-2.0
"""./run bench ground: the archive of the ground station, and how soon its commands are on the line.

The archive records a day of made telemetry at virtual speed: each housekeeping structure of the dictionary, 1.1 times as often as it says. That is ten
times what a flight sends live, where telemetry is thinned. The CPU time is that of recording alone, as a share of the time that the telemetry lasts;
the memory is that of a process with dictionary and archive.
"""

import json

from srfs.flight.processes import output

RSS_GOAL_MIB, INSERT_GOAL_PERCENT, QUERY_GOAL_MS, START_GOAL_MS = 60, 2, 100, 15
PARTS = ("archive", "start")


def add_options(parser):
    parser.add_argument("--ground-parts", nargs="+", choices=PARTS, default=PARTS, metavar="PART", help=f"bench ground: some of {', '.join(PARTS)}")
    parser.add_argument("--ground-hours", type=float, default=24, metavar="H", help="bench ground: hours of telemetry")
    parser.add_argument("--ground-rate", type=float, default=1.1, metavar="N", help="bench ground: times as often as the dictionary says")


def measure(bin_dir, options, say):
    results = {}
    if "archive" in options.ground_parts:
        say(f"ground: an archive of {options.ground_hours:g} h at {options.ground_rate:g} times the dictionary's rate")
        arguments = ("--hours", options.ground_hours, "--rate", options.ground_rate)
        results["archive"] = json.loads(output(bin_dir / "bench_ground", "archive", *arguments, timeout_s=None))
    if "start" in options.ground_parts:
        say("ground: the start of a command, by a server")
        results["start"] = json.loads(output(bin_dir / "bench_ground", "start", timeout_s=None))
    return results


def verdict(met):
    return "met" if met else "MISSED"


def archive_rows(archive):
    what = f"{archive['hours']:g} h of {archive['packets_a_second']:.0f} packets a second"
    yield f"{what}: RSS, MiB", f"{archive['rss_max_mib']:.1f}", f"< {RSS_GOAL_MIB}", verdict(archive["rss_max_mib"] < RSS_GOAL_MIB)
    insert = archive["insert_core_percent"]
    yield "the same: insertion, % of a core", f"{insert:.2f}", f"< {INSERT_GOAL_PERCENT}", verdict(insert < INSERT_GOAL_PERCENT)
    yield "the same: aggregates of minutes, % of a core", f"{archive['minutes_core_percent']:.2f}", "", ""
    yield "the same: size of the file, MiB", f"{archive['file_mib']:.0f}", "", ""
    query = archive["query_ms"]
    yield ("one parameter over that time, 2000 points, p50 / p99, ms", f"{query['p50']:.1f} / {query['p99']:.1f}",
           f"p99 < {QUERY_GOAL_MS}", verdict(query["p99"] < QUERY_GOAL_MS))  # fmt: skip


def start_rows(start):
    for name, what, goal in (("telecommand", "start of a command to the line", START_GOAL_MS), ("list", "list --json, to its end", None)):
        for key, which in ((f"{name}_ms", ""), (f"{name}_uncached_ms", ", without the cache")):
            times = start[key]
            judged = goal is not None and not which
            yield (f"{what}{which}, p50 / p99, ms", f"{times['p50']:.1f} / {times['p99']:.1f}", f"p50 {goal}" if judged else "",
                   verdict(times["p50"] <= goal) if judged else "")  # fmt: skip


def rows(results):
    """(measure, value, goal, verdict) of what was measured."""
    if "archive" in results:
        yield from archive_rows(results["archive"])
    if "start" in results:
        yield from start_rows(results["start"])


def show(results):
    print("The ground station")
    for name, value, goal, met in rows(results):
        print(f"  {name:<72} {value:>14}  {goal:>9}  {met}")


def is_sound(results):
    """What no load excuses: each history has values."""
    return results.get("archive", {"fewest_points": 1})["fewest_points"] > 0
