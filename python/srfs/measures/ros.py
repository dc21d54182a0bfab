# SPDX-FileCopyrightText: 2026 SRFS contributors
# SPDX-License-Identifier: Apache-2.0
"""The measures of lib/ros: runs bench_ros, judges what it found against the goals, shows and draws it."""

import contextlib
import datetime
import json
import os
import pathlib
import signal
import subprocess

from srfs.flight.machine import RT_PRIORITY, load_average, machine, may_be_real_time, stress_ng
from srfs.program import MissingProgram, MissionError
from srfs.report import pyplot, save, table

MIB = 1 << 20


# --- measuring -------------------------------------------------------------------------------------------------------

def bench_ros(bin_dir, *arguments, timeout=300):
    """One subject. What it started ends with it, also when this is interrupted. The load is the machine's just before."""
    before = load_average()
    command = [str(bin_dir / "bench_ros"), *map(str, arguments)]
    with subprocess.Popen(command, stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
                          start_new_session=True) as run:
        try:
            out, err = run.communicate(timeout=timeout)
        except BaseException:
            with contextlib.suppress(ProcessLookupError):
                os.killpg(run.pid, signal.SIGKILL)
            raise
    if run.returncode != 0:
        raise MissionError(f"bench_ros {arguments[0]}: {err.strip()}")
    return {**json.loads(out), "command": " ".join(["bench_ros", *map(str, arguments)]), "load_before": before, "load_after": load_average()}


def under_stress(bin_dir, options):
    """64 octets with every CPU busy, both ends real-time."""
    if not may_be_real_time():
        return {"skipped": "this process may not use SCHED_FIFO (root or CAP_SYS_NICE)"}
    try:
        with stress_ng(f"--cpu {os.cpu_count()}"):
            return bench_ros(bin_dir, "latency", "--rounds", options.rounds, "--fifo", RT_PRIORITY)
    except MissingProgram as why:
        return {"skipped": str(why)}


MEASURES = {
    "latency": lambda b, o: bench_ros(b, "latency", "--rounds", o.rounds),
    "latency_pinned": lambda b, o: bench_ros(b, "latency", "--rounds", o.rounds, "--pinned"),
    "latency_under_load": under_stress,
    "image_1_mib": lambda b, o: bench_ros(b, "image", "--octets", MIB, "--images", o.images),
    "image_4_mib": lambda b, o: bench_ros(b, "image", "--octets", 4 * MIB, "--images", o.images),
    "start": lambda b, o: bench_ros(b, "start", "--rounds", o.starts, timeout=900),
    "idle": lambda b, o: bench_ros(b, "idle", "--duration", o.idle_s),
    "ring": lambda b, o: bench_ros(b, "ring", "--duration", o.idle_s),
    "cycles": lambda b, o: bench_ros(b, "cycles", "--cycles", o.cycles, timeout=120 + 5 * o.cycles),
}


def add_options(parser):
    parser.add_argument("--only", nargs="+", choices=MEASURES, metavar="NAME", help="bench ros: only these of " + ", ".join(MEASURES))
    parser.add_argument("--rounds", type=int, default=3000, metavar="N", help="bench ros: rounds of the latency measurements")
    parser.add_argument("--images", type=int, default=200, metavar="N", help="bench ros: images of each size, ten per second")
    parser.add_argument("--starts", type=int, default=40, metavar="N")
    parser.add_argument("--idle-s", type=int, default=60, metavar="S", help="bench ros: length of idle and ring")
    parser.add_argument("--cycles", type=int, default=1000, metavar="N", help="bench ros: number of kill -9 and restart; about 0.6 s each")
    parser.add_argument("--out", type=pathlib.Path, metavar="DIR", help="bench ros: also write ros.json, ros.svg and ros.png to this folder")


def measure(bin_dir, options, say):
    results = {"time": datetime.datetime.now(datetime.timezone.utc).isoformat(timespec="seconds"), "machine": machine(), "load": load_average(),
               "measures": {}}
    for name, run in MEASURES.items():
        if options.only and name not in options.only:
            continue
        say(f"measuring {name}")
        results["measures"][name] = run(bin_dir, options)
    results["verdicts"] = verdicts(results["measures"])
    if options.out:
        write(results, options.out, say)
    return results


# --- judging ---------------------------------------------------------------------------------------------------------

def row(measure, what, value, peer, goal, met, hard=False):
    """One line of the table. hard: no matter of how busy the machine is."""
    return {"measure": measure, "what": what, "value": value, "raw": peer, "goal": goal, "met": bool(met), "hard": hard}


def rounded(value, digits):
    return None if value is None else round(value, digits)


def latency_rows(name, result):
    for kind, ours, raw in (("topic, one way", result["topic"]["srfs"]["one_way"], result["topic"]["raw"]["one_way"]),
                            ("service round trip", result["service"]["srfs"], result["service"]["raw"])):
        for quantile, most in (("p50", 1.15), ("p99", 1.3)):
            ratio = ours[quantile] / raw[quantile]
            yield row(name, f"{kind}, {quantile}, us", rounded(ours[quantile], 1), rounded(raw[quantile], 1), f"<= {most}x raw: {ratio:.2f}x",
                      ratio <= most)


def load_rows(name, result):
    ours, raw = result["topic"]["srfs"]["one_way"], result["topic"]["raw"]["one_way"]
    for quantile, most in (("p99", 1000), ("max", 5000)):
        yield row(name, f"topic, one way, {quantile}, us", rounded(ours[quantile], 1), rounded(raw[quantile], 1), f"<= {most}", ours[quantile] <= most)


def image_rows(name, result):
    ours, raw = result["srfs"], result["raw"]
    ratio = ours["p50"] / raw["p50"]
    yield row(name, "one way, p50, us", rounded(ours["p50"], 0), rounded(raw["p50"], 0), f"<= 1.1x raw: {ratio:.2f}x", ratio <= 1.1)
    yield row(name, "one way, p99, us", rounded(ours["p99"], 0), rounded(raw["p99"], 0), "", True)
    yield row(name, f"lost of {ours['sent']}", ours["lost"], raw["lost"], "0", ours["lost"] == 0, hard=True)


def start_rows(name, result):
    for quantile, most in (("p50", 60), ("p90", 150), ("max", None)):
        value = result["srfs"][quantile]
        yield row(name, f"exec to get_state answered, {quantile}, ms", rounded(value, 1), rounded(result["raw"][quantile], 1),
                  f"<= {most}" if most else "", most is None or value <= most)
    yield row(name, f"never answered of {result['srfs']['samples'] + result['unanswered']}", result["unanswered"], None, "0",
              result["unanswered"] == 0, hard=True)


def idle_rows(name, result):
    ours, raw = result["srfs"], result["raw"]
    yield row(name, "PSS of a node, largest, MiB", rounded(ours["pss_mib"]["max"], 2), rounded(raw["pss_mib"]["max"], 2), "<= 7",
              ours["pss_mib"]["max"] <= 7)
    yield row(name, f"CPU of {result['nodes']} nodes, % of one", rounded(ours["cpu_percent_together"], 2), rounded(raw["cpu_percent_together"], 2),
              f"<= 1.2x raw: {result['ratio_cpu']:.2f}x", result["ratio_cpu"] <= 1.2)


def ring_rows(name, result):
    yield row(name, f"checks of {result['nodes']} nodes, one each {result['period_ms']} ms: CPU, % of one", rounded(result["ring_cpu_percent"], 2),
              rounded(result["raw_cpu_percent"], 2), f"<= 1.5x raw: {result['ratio']:.2f}x", result["ratio"] <= 1.5)
    together = result["cpu_percent_together"]
    yield row(name, "the whole processes, % of one", rounded(together["ring"], 2), rounded(together["raw"], 2), "", True)
    evidence = result["evidence"]["percent_together"]
    yield row(name, "evidence of who had a CPU, % of one", rounded(evidence, 3), None, "<= 0.3", evidence <= 0.3)
    answered = result["raw_requests"]["answered"] / max(1, result["raw_requests"]["asked"])
    rate = result["nodes"] * 1000 / result["period_ms"]
    yield row(name, "checks answered in a second", rounded(result["heard"]["checks_answered_per_s"], 1), rounded(answered * rate, 1), f">= {0.95 * rate:.0f}",
              result["heard"]["checks_answered_per_s"] >= 0.95 * rate and answered >= 0.95)
    yield row(name, "nobody was restarted", "yes" if result["nobody_died"] else "no", None, "yes", result["nobody_died"], hard=True)


GROWTH_KB = 64  # of one survivor in 1000 cycles; less is the allocator's noise (16 pages)


def cycle_rows(name, result):
    fresh = result["fresh_client"]
    grown = max(result["own_memory_growth_kb_in_1000"])
    yield row(name, f"lost links in {result['cycles']} cycles", result["lost_links"], None, "0", result["lost_links"] == 0, hard=True)
    counts = result["matched_counts_right_after_the_last"]
    yield row(name, "matched counts right afterwards", "yes" if counts else "no", None, "yes", counts, hard=True)
    yield row(name, "leaked files", len(result["leaked_files"]), None, "0", not result["leaked_files"], hard=True)
    yield row(name, "more descriptors in a survivor", max(result["descriptors_more"]), None, "0", max(result["descriptors_more"]) <= 0, hard=True)
    if result["cycles"] >= 200:  # pools reach their size in the first hundred
        yield row(name, "own memory of a survivor, kB more in 1000", rounded(grown, 0), None, f"<= {GROWTH_KB}", grown <= GROWTH_KB)
    yield row(name, "fresh client answered, p50, ms", rounded(fresh["srfs"]["p50"], 0), rounded(fresh["raw"]["p50"], 0), "", True)
    yield row(name, "fresh client answered, p99, ms", rounded(fresh["srfs"]["p99"], 0), rounded(fresh["raw"]["p99"], 0), "<= 300",
              fresh["srfs"]["p99"] <= 300)
    yield row(name, "fresh clients never answered", fresh["unanswered"], None, "0", fresh["unanswered"] == 0, hard=True)


ROWS = {"latency": latency_rows, "latency_pinned": latency_rows, "latency_under_load": load_rows, "image_1_mib": image_rows,
        "image_4_mib": image_rows, "start": start_rows, "idle": idle_rows, "ring": ring_rows, "cycles": cycle_rows}


def verdicts(measures):
    return [line for name, result in measures.items() if "skipped" not in result for line in ROWS[name](name, result)]


def is_sound(results):
    """Nothing was lost, left behind or unanswered. Times are not judged here: they are the machine's as well."""
    return all(line["met"] for line in results["verdicts"] if line["hard"])


# --- showing ---------------------------------------------------------------------------------------------------------

def show(results):
    m = results["machine"]
    print(f"{m['cpus']} CPUs ({m['cpu']}{', virtual' if m['virtual'] else ''}), Linux {m['kernel']}, governor {m['governor'] or 'unknown'}, "
          f"load average {results['load'][0]}")
    rows = [["measure", "", "srfs", "raw Fast DDS", "goal", ""]]
    last = None
    for line in results["verdicts"]:
        rows.append([line["measure"] if line["measure"] != last else "", line["what"], line["value"], line["raw"], line["goal"],
                     "" if not line["goal"] else "met" if line["met"] else "MISSED"])
        last = line["measure"]
    print(*table(rows), sep="\n")
    for name, result in results["measures"].items():
        if "skipped" in result:
            print(f"  {name} skipped: {result['skipped']}")


def bars(axis, title, unit, groups):
    """groups: {label: [(name, p50, p99 or None)...]}; bars to p50, whiskers to p99."""
    colours = {"srfs": "#1f77b4", "raw": "#ff7f0e", "udp": "#999999"}
    ticks = []
    for i, (label, values) in enumerate(groups.items()):
        width = 0.8 / len(values)
        for j, (name, p50, p99) in enumerate(values):
            x = i - 0.4 + (j + 0.5) * width
            axis.bar(x, p50, width * 0.9, color=colours[name], label=name if i == 0 else None)
            if p99 is not None:
                axis.plot([x, x], [p50, p99], color="black", linewidth=1, marker="_")
        ticks.append(label)
    axis.set_xticks(range(len(ticks)), ticks, fontsize=8)
    axis.set_title(title, fontsize=9, loc="left")
    axis.set_ylabel(unit, fontsize=8)
    axis.set_yscale("log")
    axis.grid(axis="y", alpha=0.3)


def panels(measures):
    """(title, unit, groups) of what was measured."""
    latency = {name: measures[name] for name in ("latency", "latency_pinned", "latency_under_load") if "topic" in measures.get(name, {})}
    if latency:
        yield "64 octets one way, p50 and p99", "us", {
            name.replace("latency", "free").replace("free_", ""): [(w, r["topic"][w]["one_way"]["p50"], r["topic"][w]["one_way"]["p99"])
                                                                  for w in ("srfs", "raw", "udp")] for name, r in latency.items()}
        yield "service round trip, p50 and p99", "us", {
            name.replace("latency", "free").replace("free_", ""): [(w, r["service"][w]["p50"], r["service"][w]["p99"]) for w in ("srfs", "raw")]
            for name, r in latency.items()}
    images = {name: r for name, r in measures.items() if name.startswith("image")}
    if images:
        yield "image one way, p50 and p99", "us", {n[6:].replace("_", " "): [(w, r[w]["p50"], r[w]["p99"]) for w in ("srfs", "raw")]
                                                   for n, r in images.items()}
    times = {}
    if "start" in measures:
        times["exec to answer"] = [(w, measures["start"][w]["p50"], measures["start"][w]["p99"]) for w in ("srfs", "raw")]
    if "cycles" in measures:
        fresh = measures["cycles"]["fresh_client"]
        times["fresh client"] = [(w, fresh[w]["p50"], fresh[w]["p99"]) for w in ("srfs", "raw")]
    if times:
        yield "start and match, p50 and p99", "ms", times
    if "idle" in measures:
        idle = measures["idle"]
        yield f"idle, {idle['nodes']} up", "MiB; % of a CPU", {
            "PSS of one": [(w, idle[w]["pss_mib"]["median"], None) for w in ("srfs", "raw")],
            "CPU of all": [(w, idle[w]["cpu_percent_together"], None) for w in ("srfs", "raw")]}
    if "ring" in measures:
        ring = measures["ring"]
        yield f"checks of {ring['nodes']} nodes, {ring['period_ms']} ms", "% of a CPU", {
            "CPU of all": [("srfs", ring["ring_cpu_percent"], None), ("raw", ring["raw_cpu_percent"], None)]}


def draw(results, out):
    """ros.svg and ros.png."""
    plots = pyplot()
    charts = list(panels(results["measures"]))
    with_memory = "cycles" in results["measures"]
    count = len(charts) + with_memory
    if count == 0:
        return
    columns = min(3, count)
    lines = -(-count // columns)
    figure, axes = plots.subplots(lines, columns, figsize=(4.2 * columns, 3 * lines), squeeze=False)
    axes = list(axes.flat)
    for axis, chart in zip(axes, charts):
        bars(axis, *chart)
    axes[0].legend(fontsize=8)
    if with_memory:
        axis = axes[len(charts)]
        for series in results["measures"]["cycles"]["series"]["own_memory_kb"]:
            axis.plot([p[0] for p in series], [p[1] / 1024 for p in series], linewidth=1)
        axis.set_title("own memory of each survivor over the cycles", fontsize=9, loc="left")
        axis.set_ylabel("MiB", fontsize=8)
        axis.set_ylim(bottom=0)
        axis.grid(alpha=0.3)
    for axis in axes[count:]:
        axis.axis("off")
    m = results["machine"]
    figure.suptitle(f"lib/ros beside raw Fast DDS, {results['time']}, {m['cpus']} CPUs, Linux {m['kernel']}, load {results['load'][0]}", fontsize=10)
    save(figure, out, "ros", 110)


def write(results, out, say):
    out.mkdir(parents=True, exist_ok=True)
    (out / "ros.json").write_text(json.dumps(results, indent=1) + "\n")
    try:
        draw(results, out)
    except ImportError:
        say("bench: python3-matplotlib is missing: no drawing")
