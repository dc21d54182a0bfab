"""./run bench: measures, as a table or one JSON object."""

import argparse
import json
import pathlib
import subprocess
import sys
import tempfile

import demo
import mission
from display import Display, table


def ros(bin_dir):
    """Latency of lib/ros beside raw Fast DDS and UDP, threads free and pinned to one CPU a process."""
    results = {}
    for name, options in (("free", []), ("pinned", ["--pinned"])):
        run = subprocess.run([str(bin_dir / "bench_ros"), *options], stdin=subprocess.DEVNULL, capture_output=True, text=True, timeout=300)
        if run.returncode != 0:
            raise mission.MissionError(f"bench_ros: {run.stderr.strip()}")
        results[name] = json.loads(run.stdout)
    return results


def flight(bin_dir, duration_s):
    """The measures of a demo flight."""
    with tempfile.TemporaryDirectory(prefix="srfs-bench-") as folder:
        options = demo.parse(["--var", f"{folder}/var", "--bin", str(bin_dir), "--duration", str(duration_s)])
        return demo.fly(options, Display(quiet=True), mission.StopSignals())


def show_ros(results):
    rows = [["us, round trip", "p50", "p99", "max"]]
    for name, result in results.items():
        for path in ("srfs_topic", "raw_topic", "srfs_service", "raw_service", "udp"):
            rows.append([f"{path}, {name}", *(round(result[path][q], 1) for q in ("p50_us", "p99_us", "max_us"))])
        rows.append([f"ratio topic to raw, {name}", *(round(result["ratio_topic_to_raw"][q], 3) for q in ("p50", "p99")), ""])
        rows.append([f"ratio service to raw, {name}", *(round(result["ratio_service_to_raw"][q], 3) for q in ("p50", "p99")), ""])
    print(*table(rows), sep="\n")


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
    parser.add_argument("what", nargs="*", choices=[[], "ros", "mission"], metavar="ros|mission", help="default: everything")
    parser.add_argument("--duration", type=float, default=110, metavar="S", help="of the flight; 110 s have more than 1000 ticks")
    parser.add_argument("--json", action="store_true", help="one JSON object")
    parser.add_argument("--bin", type=pathlib.Path, default=mission.ROOT / "build-release" / "bin", help=argparse.SUPPRESS)
    options = parser.parse_args()
    wanted = options.what or ["ros", "mission"]
    results = {}
    if "ros" in wanted:
        results["ros"] = ros(options.bin)
        if not options.json:
            show_ros(results["ros"])
    if "mission" in wanted:
        results["mission"] = flight(options.bin, options.duration)
        if not options.json:
            show_flight(results["mission"])
    if options.json:
        print(json.dumps(results))
    return 0 if results.get("mission", {"ok": True})["ok"] else 1


if __name__ == "__main__":
    try:
        sys.exit(main())
    except mission.MissionError as error:
        print(f"bench: {error}", file=sys.stderr)
        sys.exit(error.code)
