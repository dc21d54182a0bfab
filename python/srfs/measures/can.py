# SPDX-FileCopyrightText: 2026 SRFS contributors
# SPDX-License-Identifier: Apache-2.0
"""./run bench can: how the CAN bus is shared, measured on the flying suite, and ISO-TP on the paced hub.

Each tick period is flown alone. What is published is stamped by the publisher, frames by the hub: all on CLOCK_MONOTONIC.
"""

import bisect
import json
import statistics
import time

from srfs.flight import deployments, mission
from srfs.flight.deployments import PAYLOADS
from srfs.flight.processes import output, wait_until
from srfs.record import can_frames, timeline
from srfs.record.rotation import Rotation
from srfs.report import quantiles, verdict

TICK_PERIODS_MS = (1, 10, 100, 1000)
SHORTEST_FRAME_NS = 131 * 2000  # 8 octets, 29-bit identifier, no stuff bit, 500 kbit/s: when it began at the latest
SWITCH_GOAL_US = {"p50": 500, "p99": 2000}
ISOTP_GOAL = 0.95
PROCESSING_MS = 10  # of a measurement, where parallelism is measured: about twice a slot


def deployment(tick_ms, fifo=False, processing_ms=0):
    """sim with another tick; fifo: the tick's way to the frame under SCHED_FIFO; processing_ms: longer processing."""
    sim = deployments.read("sim")
    deployments.node(sim, "timing")["parameters"]["tick_period_ms"] = tick_ms
    for payload in PAYLOADS:
        deployments.node(sim, payload)["parameters"]["processing_time_ms"] = processing_ms
    if fifo:
        scheduling = deployments.realtime()
        deployments.scheduled(sim, {node: scheduling[node] for node in ("timing", "can_switcher", *PAYLOADS)})
    return sim


def listen(flight, deadline_s=20):
    """A recorder and the rotation that it hears, once all payloads have had the bus."""
    recorder, rotation = flight.recorder(), Rotation()
    recorder.on_message(rotation.on_message)
    wait_until(lambda: len(rotation.slots()) == len(PAYLOADS), deadline_s, "slots of all payloads")
    return recorder, rotation


def spread(values_ns):
    """{p50, p99, max} in us."""
    return quantiles(values_ns, "p50 p99 max", 1000, 1)


def switch_times(slots, ticks, frames):
    """Tick to flag, flag to first frame, and both, in ns, of the slots with a frame. Pure.

    slots   in order: [{cycle, holder, published}]
    ticks   {cycle: time published}
    frames  [(time of the end, payload, ...)] in order
    """
    times = [at for at, *_ in frames]
    flag, frame, whole = [], [], []
    for slot, after in zip(slots, slots[1:] + [None]):
        tick = ticks.get(slot["cycle"])
        first = bisect.bisect_left(times, slot["published"])
        if tick is None or first == len(times) or (after and times[first] >= after["published"]) or frames[first][1] != slot["holder"]:
            continue
        began = times[first] - SHORTEST_FRAME_NS
        flag.append(slot["published"] - tick)
        frame.append(began - slot["published"])
        whole.append(began - tick)
    return flag, frame, whole


def fly(bin_dir, tick_ms, duration_s, fifo=False):
    with mission.short_flight(bin_dir, deployment(tick_ms, fifo)) as flight:
        _, rotation = listen(flight)

        def busy():
            return flight.control({"query": "counters"})["can"]["busy_us"], time.monotonic()

        busy_before, began = busy()
        time.sleep(duration_s)
        busy_after, ended = busy()
        slots = [s for s in rotation.recorded_slots() if began * 1e9 <= s["published"] <= ended * 1e9]
        frames = can_frames.computer_frames(flight.can_log(int(ended * 1e9)))
        ticks = dict(rotation.published_ticks())
        overlaps, undecided = rotation.overlaps(), rotation.undecided()
    used = [s for s in slots if s["holder"] and s["status"] == "released"]
    flag, frame, whole = switch_times([s for s in slots if s["holder"]], ticks, frames)
    waits = [b["published"] - a["released"] for a, b in zip(slots, slots[1:]) if a["holder"] and b["holder"] and a["released"]]
    return {
        "tick_ms": tick_ms,
        "slots": len(slots),
        "slots_per_s": round(len(slots) / (ended - began), 2),
        "used": len(used),
        "bus_utilisation": round((busy_after - busy_before) / 1e6 / (ended - began), 4),
        "overlaps": overlaps,
        "ends_lost_by_the_recorder": undecided,
        "slot_start_behind_tick_us": spread(flag),
        "slot_start_jitter_us": round(statistics.pstdev(flag) / 1000, 1) if flag else None,
        "flag_to_first_frame_us": spread(frame),
        "switch_us": spread(whole),
        "release_to_next_flag_us": spread(waits),
    }


def watch_work(bin_dir, tick_ms, duration_s):
    """How the bus is used while every measurement takes PROCESSING_MS to process, from what the payloads say they do."""
    line = timeline.Timeline(PAYLOADS)
    with mission.short_flight(bin_dir, deployment(tick_ms, processing_ms=PROCESSING_MS)) as flight:
        recorder, _ = listen(flight)
        recorder.on_message(line.on_message)
        begin = time.monotonic_ns()
        time.sleep(duration_s)
        end = time.monotonic_ns()
    return {"tick_ms": tick_ms, **timeline.use_of_the_bus(line.intervals(begin, end), line.heartbeats(begin, end), begin, end)}


def measure_parallelism(bin_dir, duration_s):
    """Ticks of 1 ms, and ticks so far apart that a payload has processed its data when the next one gets the bus."""
    as_run = watch_work(bin_dir, 1, duration_s)
    tick_ms = timeline.next_tick_period_ms(as_run["slot_ms"] + as_run["processing_ms"] + 1)
    sequence = watch_work(bin_dir, tick_ms, duration_s)
    return {"processing_ms": PROCESSING_MS, "as_run": as_run, "strict_sequence": sequence, "parallelism": timeline.parallelism(as_run, sequence)}


def add_options(parser):
    parser.add_argument("--slots-for", type=float, default=30, metavar="S", help="bench can: time at each tick period")


def measure(bin_dir, options, say):
    duration_s, fifo = options.slots_for, options.fifo
    rows = []
    for tick_ms in TICK_PERIODS_MS:
        say(f"bench can: ticks of {tick_ms} ms, {duration_s:.0f} s")
        rows.append(fly(bin_dir, tick_ms, duration_s, fifo))
    say("bench can: parallelism of bus and processing")
    parallel = measure_parallelism(bin_dir, duration_s)
    say("bench can: ISO-TP on the paced hub")
    isotp = json.loads(output(bin_dir / "bench_can", "isotp", timeout_s=300))
    return {"rotation": rows, "scheduling": "fifo" if fifo else "other", "parallelism": parallel, "isotp": isotp}


def is_sound(result):
    """Nothing that no load excuses went wrong."""
    return all(row["overlaps"] == 0 and row["slots"] > 0 for row in result["rotation"]) and result["isotp"]["failed"] == 0


def show(result):
    head = ("tick ms", "slots/s", "bus %", "tick-flag us p50 p99", "jitter us", "flag-frame us p50 p99", "switch us p50 p99 max", "release-flag us p50")
    print("  " + " | ".join(head))
    for row in result["rotation"]:
        flag, frame, switch = row["slot_start_behind_tick_us"], row["flag_to_first_frame_us"], row["switch_us"]
        print(f"  {row['tick_ms']:7} | {row['slots_per_s']:7.2f} | {100 * row['bus_utilisation']:5.2f} | {flag['p50']} {flag['p99']} | {row['slot_start_jitter_us']}"
              f" | {frame['p50']} {frame['p99']} | {switch['p50']} {switch['p99']} {switch['max']} | {row['release_to_next_flag_us']['p50']}")  # fmt: skip
        for name, goal in SWITCH_GOAL_US.items():
            if switch[name] is not None and switch[name] > goal:
                print(f"           missed: the switch took {switch[name]} us at {name}, the goal is {goal}")
    parallel = result["parallelism"]
    run, sequence = parallel["as_run"], parallel["strict_sequence"]
    print(f"  parallelism {parallel['parallelism']}: with {parallel['processing_ms']} ms of processing {run['slots_per_s']} slots/s, bus taken {100 * run['bus_utilisation']:.1f} % "
          f"of the time; in strict sequence {sequence['slots_per_s']} slots/s and {100 * sequence['bus_utilisation']:.1f} % measured with ticks of {sequence['tick_ms']} ms, "
          f"{run['slots_per_s_sequential']} slots/s and {100 * run['bus_utilisation_sequential']:.1f} % by the sum of {run['slot_ms']} ms slot and {run['processing_ms']} ms processing")  # fmt: skip
    isotp = result["isotp"]
    print(f"  ISO-TP: {isotp['payload_octets_per_s']:.0f} of {isotp['ideal_octets_per_s']:.0f} octets/s, ratio {isotp['ratio']:.3f} (goal {ISOTP_GOAL}: {verdict(isotp['ratio'] >= ISOTP_GOAL)}), "
          f"stuff bits {100 * isotp['stuff_share']:.1f} %, {isotp['messages']} messages, {isotp['failed']} failed")  # fmt: skip
