# SPDX-FileCopyrightText: 2026 SRFS contributors
# SPDX-License-Identifier: Apache-2.0
"""./run bench link: codecs, packet store, downlink throughput and telecommand rate of the ground link.

Throughput is what a flying suite sends through the line of the simulator, which carries ten bits an octet and no faster, as the ground
tool receives it: all packets in the middle of a transfer, live telemetry included. The bound is what the line can carry after framing and
coding: the data fields of its CADUs, back to back.
"""

import contextlib
import json
import re
import signal
import time
from pathlib import Path

from srfs.flight import deployments, mission
from srfs.flight.processes import output, send_signal, wait_until
from srfs.program import MissionError
from srfs.report import quantiles

BAUDS = (921600, 115200)
FRAME, CADU, DATA_FIELD = 223, 259, 187  # octets at interleave 1: frame; marker, frame and parity; without header, security fields, OCF and FECF
THROUGHPUT_GOAL = 0.97
ACCEPTANCE_GOAL_US = 5000
STORED_FROM = "2026-01-01T00:00:00Z"
STORED_TO = "2026-01-02T00:00:00Z"
PACKET_OCTETS = 120
FRAME_LOSS = 0.1
BAD_FILE_OCTETS, BAD_FILE_BAUD, BAD_FILE_DEATHS, BAD_FILE_GOAL = 200_000, 115200, 5, 1.5
MONITORS_GOAL = 1  # % of a core
PARTS = ("codecs", "noise", "store", "monitors", "wear", "downlink", "telecommands", "bad_line")


def add_options(parser):
    parser.add_argument("--link-parts", nargs="+", choices=PARTS, default=PARTS, metavar="PART", help=f"bench link: some of {', '.join(PARTS)}")
    parser.add_argument("--link-s", type=float, default=25, metavar="S", help="bench link: length of each retrieval, file and telecommand run")


def capacity(baud):
    """Octets of packets a second that the line can carry."""
    return baud / 10 * DATA_FIELD / CADU


LEAST_S = BAD_FILE_OCTETS / (capacity(BAD_FILE_BAUD) * (1 - FRAME_LOSS))


def deployment(baud):
    """sim with another line rate."""
    sim = deployments.read("sim")
    sim["link"]["baud"] = baud
    return sim


def pinged(flight):
    """The operator's session, once the spacecraft has answered."""
    ground = flight.ground()
    ground.command("ping", 10)
    return ground


def written_octets(pids):
    """Octets that processes had written to the medium, whole pages of the file cache included, as the kernel counts them; {name: octets}."""
    return {name: int(re.search(r"^write_bytes: (\d+)", Path(f"/proc/{pid}/io").read_text(), re.M)[1]) for name, pid in pids.items()}


def wear(bin_dir, duration_s):
    """What an undisturbed flight writes in a day: the records of the stores, and what all nodes cause on the medium of this folder."""
    with mission.short_flight(bin_dir, parent=Path.cwd()) as flight:
        stores = flight.var / "store"
        pids = {node["name"]: flight.node_pid(node["name"]) for node in flight.status()}

        def look():
            return time.monotonic(), sum(f.stat().st_size for f in stores.rglob("*.seg")), written_octets(pids)

        time.sleep(5)  # the start is not the flight
        begin, stored, written = look()
        time.sleep(duration_s)
        end, stored_then, written_then = look()
    days = (end - begin) / 86400
    return {
        "stored_mib_per_day": round((stored_then - stored) / days / 2**20, 1),
        "medium_mib_per_day": round(sum(written_then[n] - written[n] for n in pids) / days / 2**20, 1),
        "medium_mib_per_day_by_node": {n: round((written_then[n] - written[n]) / days / 2**20, 1) for n in pids},
    }


class Passage:
    """What passed through the line between two readings of the ground tool's counters, taken during a transfer."""

    def __init__(self, ground):
        self._ground = ground
        self._looks = []

    def look(self):
        stats = self._ground.stats()
        if stats:
            self._looks.append((time.monotonic(), stats["packet_octets"], stats["lost_frames"]))

    def measures(self, baud):
        """Octets of all packets as a share of the capacity; frames lost."""
        if len(self._looks) < 2:
            return {"share": None, "lost_frames": None}
        (begin, first, _), (end, last, lost) = self._looks[0], self._looks[-1]
        return {"share": round((last - first) / (end - begin) / capacity(baud), 4), "lost_frames": lost}


def transfer(ground, duration_s, is_over):
    """Waits for the end of a transfer of about so long; @return what passed in its middle, and its end."""
    passage = Passage(ground)
    time.sleep(0.1 * duration_s)
    passage.look()
    time.sleep(0.8 * duration_s)
    passage.look()
    return passage, ground.wait_for(is_over, 3 * duration_s + 60)


def retrieval(bin_dir, baud, duration_s):
    """A retrieval of about so long from a store that was full before the flight, beside the live telemetry."""
    packets = int(capacity(baud) * duration_s / PACKET_OCTETS)

    def fill(var):
        output(bin_dir / "bench_link", "fill", var / "store" / "housekeeping", "--packets", packets)

    with mission.short_flight(bin_dir, deployment(baud), fill) as flight:
        ground = pinged(flight)
        line = ground.send(f"retrieve {STORED_FROM} {STORED_TO} housekeeping --timeout {int(4 * duration_s) + 30}")
        ground.wait_for(lambda m: m.get("vc") == 1, 10)
        passage, done = transfer(ground, duration_s, lambda m: m["type"] == "retrieval_done" and m.get("line") == line)
        received = len(ground.select(lambda m: m.get("vc") == 1))
    return {"baud": baud, "packets": packets, "received": received, "complete": bool(done and done["complete"]), **passage.measures(baud)}


def file_content(octets):
    return bytes(i * 2654435761 >> 13 & 0xFF for i in range(octets))


def put_into_outbox(flight, name, content):
    """As a node of the suite does it: whole, by renaming."""
    outbox = flight.var / "files" / "outbox"
    outbox.mkdir(parents=True, exist_ok=True)
    (outbox / f".{name}").write_bytes(content)
    (outbox / f".{name}").rename(outbox / name)


def file_down(bin_dir, baud, duration_s):
    """A file of about so long from the spacecraft's outbox, with its acknowledgements, beside the live telemetry."""
    octets = int(capacity(baud) * duration_s)
    content = file_content(octets)
    with mission.short_flight(bin_dir, deployment(baud)) as flight:
        ground = pinged(flight)
        put_into_outbox(flight, "bench.bin", content)

        def about_it(message):
            return message["type"] == "file" and message["direction"] == "down" and message["name"] == "bench.bin"

        ground.wait_for(about_it, 10)
        begin = time.monotonic()
        passage, end = transfer(ground, duration_s, lambda m: about_it(m) and m["event"] == "finished")
        elapsed = time.monotonic() - begin
        received = flight.var / "ground" / "files" / "bench.bin"
        same = received.is_file() and received.read_bytes() == content
    return {
        "baud": baud, "octets": octets, "identical": same, "success": bool(end and end.get("success")), **passage.measures(baud),
        "octets_of_the_file_per_s": round(octets / elapsed),
    }  # fmt: skip


def bad_file(bin_dir, deaths_max, loss):
    """Seconds for the file over a line with so much frame loss and so many deaths of either end; (elapsed, deaths, identical)."""
    content = file_content(BAD_FILE_OCTETS)
    with mission.short_flight(bin_dir, deployment(BAD_FILE_BAUD)) as flight:
        ground = pinged(flight)
        if loss:
            flight.control({"rs422": {"flip_probability": 1e-4 / 8, "burst_probability": loss / CADU}})
        received = flight.var / "ground" / "files" / "bad.bin"
        put_into_outbox(flight, "bad.bin", content)
        begin = time.monotonic()
        deaths = 0
        while time.monotonic() < begin + 20 * LEAST_S and not (received.is_file() and received.read_bytes() == content):
            if deaths < deaths_max and time.monotonic() > begin + (deaths + 1) * LEAST_S / (deaths_max + 1):
                deaths += 1
                send_signal(flight.node_pid("ttc"), signal.SIGKILL)
                ground.process.kill()
                ground.process.wait()
                ground = flight.ground()
            time.sleep(0.02)
        elapsed = time.monotonic() - begin
        return elapsed, deaths, received.is_file() and received.read_bytes() == content


def file_over_a_bad_line(bin_dir):
    """A file down over a line that loses one CADU of ten and flips one octet of 10^4, while ttc and the ground tool are killed, each five times.

    The least time is that of the file's octets in the data fields of the CADUs that arrive: protocol, live telemetry and restarts are on top. How much
    of it live telemetry takes is seen from the same file on a clean line.
    """
    clean_s, _, _ = bad_file(bin_dir, 0, 0)
    elapsed, deaths, identical = bad_file(bin_dir, BAD_FILE_DEATHS, FRAME_LOSS)
    return {"octets": BAD_FILE_OCTETS, "baud": BAD_FILE_BAUD, "deaths_of_each_end": deaths, "identical": identical,
            "elapsed_s": round(elapsed, 2), "least_s": round(LEAST_S, 2), "ratio": round(elapsed / LEAST_S, 3), "clean_s": round(clean_s, 2),
            "ratio_to_clean_and_loss": round(elapsed / (clean_s / (1 - FRAME_LOSS)), 3)}  # fmt: skip


def telecommands(bin_dir, rate, duration_s):
    """Secured pings at a rate, each accepted, persisted and completed; the times are those that ttc keeps of itself."""
    with mission.short_flight(bin_dir) as flight:
        ground = pinged(flight)
        lines = []
        begin = time.monotonic()
        for i in range(int(rate * duration_s)):
            time.sleep(max(0.0, begin + i / rate - time.monotonic()))
            lines.append(ground.send("ping --timeout 20"))
        took = time.monotonic() - begin
        last = ground.outcome(lines[-1], 30) if lines else None
        finals = {}

        def all_ended():
            finals.update({m["line"]: m for m in ground.select(lambda m: m["type"] == "tc_stage" and m["final"])})
            return len(finals) >= len(lines)

        with contextlib.suppress(MissionError):  # the counts tell
            wait_until(all_ended, 20, "every telecommand ended", 0.2)
        round_trips = [m["elapsed_ms"] for m in ground.select(lambda m: m["type"] == "tc_stage" and m["stage"] == "accepted")]
        ttc = ground.fresh("ttc") or {}
    completed = sum(1 for line in lines if finals.get(line, {}).get("stage") == "completed")
    return {
        "rate_per_s": round(len(lines) / took, 1), "sent": len(lines), "completed": completed, "last": last and last.get("stage"),
        "acceptance_us": {q: ttc.get(f"acceptance_latency_{q}_us") for q in ("p50", "p99", "max")},
        "round_trip_ms": quantiles(round_trips),
    }  # fmt: skip


def measure(bin_dir, options, say):
    results = {}

    def program(*arguments):
        return json.loads(output(bin_dir / "bench_link", *arguments, timeout_s=None))

    if "codecs" in options.link_parts:
        say("link: codecs compared with libfec")
        results["codecs"] = program("codecs")
    if "noise" in options.link_parts:
        say("link: both directions under jamming and noise")
        results["noise"] = program("noise")
    if "store" in options.link_parts:
        say("link: a packet store of 64 MiB")
        results["store"] = program("store", "--folder", str(Path.cwd()))
    if "monitors" in options.link_parts:
        say("link: on-board monitoring with a full table")
        results["monitors"] = program("monitors")
    if "wear" in options.link_parts:
        say("link: what a flight writes")
        results["wear"] = wear(bin_dir, options.link_s)
    if "downlink" in options.link_parts:
        results["retrieval"], results["file"] = [], []
        for baud in BAUDS:
            say(f"link: retrieval of stored packets at {baud} baud")
            results["retrieval"].append(retrieval(bin_dir, baud, options.link_s))
            say(f"link: a file down at {baud} baud")
            results["file"].append(file_down(bin_dir, baud, options.link_s))
    if "bad_line" in options.link_parts:
        say("link: a file over a bad line between ends that are killed")
        results["bad_line"] = file_over_a_bad_line(bin_dir)
    if "telecommands" in options.link_parts:
        say("link: 100 telecommands a second")
        results["telecommands"] = telecommands(bin_dir, 100, options.link_s)
    return results


def verdict(met):
    return "met" if met else "MISSED"


def noise_rows(noise):
    if not noise:
        return
    for way, name, unit in (("down", "telemetry", "frame"), ("up", "telecommands", "frame")):
        for a in noise["acquisition"][way]:
            octets = a["octets"]
            ms = octets["max"] * 10 / BAUDS[-1] * 1000
            yield (f"{name}, {a['disturbance']}: octets to the next {unit}, p50 / p99 / max (max in ms at {BAUDS[-1]} baud)",
                   f"{octets['p50']:.0f} / {octets['p99']:.0f} / {octets['max']:.0f} ({ms:.0f})", "comes back", verdict(a["never"] == 0))  # fmt: skip
    for way, name in (("down", "CADUs"), ("up", "CLTUs"), ("up_long", "CLTUs")):
        for n in noise["noise"][way]:
            yield f"{name} of {n['unit_octets']} octets accepted at a bit error rate of {n['bit_error_rate']:g}", f"{n['accepted']} of {n['sent']}", "", ""


def rows(results):
    """(measure, value, goal, verdict) of what was measured."""
    codecs = results.get("codecs")
    if codecs:
        for name in ("encode", "decode_0_errors", "decode_1_errors", "decode_8_errors", "decode_16_errors"):
            ratio = codecs[name]["ratio"]["p50"]
            yield (f"RS(255,223) {name.replace('_', ' ')}, speed to libfec's (us a word)",
                   f"{ratio:.2f}x ({codecs[name]['ours_us']['p50']:.2f})", "1.0x", verdict(ratio >= 1))  # fmt: skip
        for cadu in codecs["cadu"]:
            yield (f"frame to CADU, back, interleave {cadu['interleave']}, us",
                   f"{cadu['frame_to_cadu_us']['p50']:.1f}, {cadu['cadu_to_frame_us']['p50']:.1f}", "", "")  # fmt: skip
        yield ("packet of 100 octets to secured CLTU, back, us",
               f"{codecs['cltu']['packet_to_cltu_us']['p50']:.1f}, {codecs['cltu']['cltu_to_packet_us']['p50']:.1f}", "", "")  # fmt: skip
        seal = codecs["seal"]
        yield ("a TM frame without seal, sealed; verified again, us",
               f"{seal['frame_us']['p50']:.2f}, {seal['sealed_frame_us']['p50']:.2f}; {seal['verify_us']['p50']:.2f}", "", "")  # fmt: skip
    yield from noise_rows(results.get("noise"))
    store = results.get("store")
    if store:
        overhead = store["overhead_octets_a_record"]
        yield "overhead of a stored record, octets", f"{overhead:.2f}", "24", verdict(round(overhead, 1) <= 24)
        yield ("recovery of 64 MiB with damage, p50 / max, ms", f"{store['recovery_damaged_ms']['p50']:.0f} / {store['recovery_damaged_ms']['max']:.0f}",
               "200", verdict(store["recovery_damaged_ms"]["p50"] <= 200))  # fmt: skip
        yield "records lost of those damages", f"{store['records_lost']} of {store['damages']}", "no other", verdict(store["records_lost"] <= store["damages"])
        yield "commit with fdatasync, p50 / p99, ms", f"{store['commit_ms']['p50']:.2f} / {store['commit_ms']['p99']:.2f}", "", ""
    monitors = results.get("monitors")
    if monitors:
        yield (f"on-board monitoring, {monitors['definitions']} definitions, {monitors['checks_a_second']:.0f} checks a second: % of a core",
               f"{monitors['core_percent']:.3f}", f"{MONITORS_GOAL}", verdict(monitors["core_percent"] <= MONITORS_GOAL))  # fmt: skip
        yield "the same, ns a check; us for a change of the table", f"{monitors['ns_a_check']:.0f}; {monitors['table_change_us']:.0f}", "", ""
    if "wear" in results:
        yield "written to the stores in a day of flight, MiB", f"{results['wear']['stored_mib_per_day']}", "", ""
        yield "the same on the medium, whole blocks, all nodes, MiB", f"{results['wear']['medium_mib_per_day']}", "", ""
    for what in ("retrieval", "file"):
        for r in results.get(what, []):
            value = "-" if r["share"] is None else f"{r['share']:.3f}"
            yield f"{what} at {r['baud']} baud: packets, of what the line can carry", value, f"{THROUGHPUT_GOAL}", verdict((r["share"] or 0) >= THROUGHPUT_GOAL)
    bad = results.get("bad_line")
    if bad:
        yield (f"file of {bad['octets']} octets, 10 % of CADUs lost, {bad['deaths_of_each_end']} deaths of each end: time, of the least", f"{bad['ratio']:.2f}",
               f"{BAD_FILE_GOAL}", verdict(bad["identical"] and bad["ratio"] <= BAD_FILE_GOAL))  # fmt: skip
        yield "the same, of the time on a clean line (live telemetry in it) and the loss", f"{bad['ratio_to_clean_and_loss']:.2f}", f"{BAD_FILE_GOAL}", ""
    t = results.get("telecommands")
    if t:
        yield f"telecommands at {t['rate_per_s']} a second, completed", f"{t['completed']} of {t['sent']}", "all", verdict(t["completed"] == t["sent"])
        p99 = t["acceptance_us"]["p99"]
        yield "last octet read to 1,1, p50 / p99, us", f"{t['acceptance_us']['p50']} / {p99}", f"p99 {ACCEPTANCE_GOAL_US}", verdict(p99 is not None and p99 <= ACCEPTANCE_GOAL_US)


def show(results):
    print("The ground link")
    for name, value, goal, met in rows(results):
        print(f"  {name:<64} {value:>22}  {goal:>9}  {met}")


def is_sound(results):
    """What no load excuses: nothing lost, nothing altered."""
    transfers = [r["complete"] and r["received"] >= r["packets"] for r in results.get("retrieval", [])] + [
        r["identical"] for r in [*results.get("file", []), *([results["bad_line"]] if "bad_line" in results else [])]
    ]
    t = results.get("telecommands")
    return all(transfers) and (t is None or t["completed"] == t["sent"])
