# SPDX-FileCopyrightText: 2026 SRFS contributors
# SPDX-License-Identifier: Apache-2.0
"""The operator's page without a spacecraft: python3 -m srfs.web play RECORD serves it with a record of the stream, measure RECORD measures it.
A record: srfs-ground --json listen > RECORD."""

import argparse
import json
import os
import pathlib
import threading
import time

from srfs.program import run_program
from srfs.report import percentile
from srfs.web.browser import browser, wait_for
from srfs.web.double import Double, Server

MEASURE_VIEWS = ("overview", "parameters", "plots?p=payload_adcs.rate_deg_s,payload_adcs.pointing_error_deg&p=payload_eps.battery_voltage_v")


def parse():
    parser = argparse.ArgumentParser(prog="srfs.web", description="The operator's page with a double of its server.")
    parser.add_argument("action", choices=("play", "measure"))
    parser.add_argument("record", type=pathlib.Path, help="JSON lines of srfs-ground --json listen")
    parser.add_argument("--speed", type=float, default=1.0, help="times as fast as it was (default: 1; measure: 20)")
    parser.add_argument("--port", type=int, default=8191)
    parser.add_argument("--seconds", type=float, default=20, help="of each view that is measured")
    return parser.parse_args()


def cpu_seconds(pids):
    """CPU time that these processes have used."""
    ticks = os.sysconf("SC_CLK_TCK")
    total = 0
    for pid in pids:
        try:
            fields = pathlib.Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()
            total += (int(fields[11]) + int(fields[12])) / ticks
        except OSError:
            pass
    return total


def family(root):
    """A process and all its descendants."""
    children = {}
    for stat in pathlib.Path("/proc").glob("[0-9]*/stat"):
        try:
            children.setdefault(int(stat.read_text().rpartition(")")[2].split()[1]), []).append(int(stat.parent.name))
        except (OSError, ValueError):
            pass
    found, waiting = set(), [root]
    while waiting:
        pid = waiting.pop()
        found.add(pid)
        waiting += children.get(pid, [])
    return found


def measure(double, server, seconds):
    """CPU of the whole browser and the time from the arrival of a packet to its painting, view by view."""
    summary = {"packets_per_s": None, "series": sum(len(v["fields"]) for v in double.values.values()), "views": {}}
    with browser(1920, 1080) as driver:
        begin = time.monotonic()
        driver.get(f"{server.url}#token=double")
        wait_for(lambda: driver.execute_script("return document.body.classList.contains('ready') && document.querySelector('main .panel') !== null"), "the page", 60)
        summary["first_sight_s"] = round(time.monotonic() - begin, 2)
        for view in MEASURE_VIEWS:
            driver.execute_script("location.hash = arguments[0]", f"#/{view}")
            time.sleep(3)
            driver.execute_script("srfs.model.latencies.length = 0")
            pids = family(driver.service.process.pid)
            packets, cpu, begin = double.next_id, cpu_seconds(pids), time.monotonic()
            time.sleep(seconds)
            took = time.monotonic() - begin
            summary["packets_per_s"] = round((double.next_id - packets) / took, 1)
            latencies = driver.execute_script("return srfs.model.latencies")
            summary["views"][view] = {"browser_cpu_percent": round(100 * (cpu_seconds(pids) - cpu) / took, 1), "painted_ms_p50": round(percentile(latencies, 0.5), 1), "painted_ms_p99": round(percentile(latencies, 0.99), 1), "packets": len(latencies)}
    return summary


def main():
    options = parse()
    double, ended = Double(), threading.Event()
    speed = options.speed if options.speed != 1 or options.action == "play" else 20.0
    with Server(double, ("127.0.0.1", options.port) if options.action == "play" else None) as server:
        threading.Thread(target=double.play, args=(options.record, speed, ended), daemon=True).start()
        try:
            if options.action == "measure":
                time.sleep(5)
                print(json.dumps({"speed": speed, **measure(double, server, options.seconds)}, indent=2))
            else:
                print(f"{server.url}#token=double   (Ctrl-C ends it)", flush=True)
                threading.Event().wait()
        except KeyboardInterrupt:
            pass
        finally:
            ended.set()
    return 0


if __name__ == "__main__":
    run_program("web", main)
