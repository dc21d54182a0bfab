# SPDX-FileCopyrightText: 2026 SRFS contributors
# SPDX-License-Identifier: Apache-2.0
"""One boot of the guest of python/srfs/vm/watchdog.py: the suite over Linux' watchdog device, until the watchdog resets the machine.

First boot: everything stops and nobody feeds any more. Second boot: what the boot record says of it. The boot record lies in /run/vm, which is
the host's, so it outlives the reset; one JSON object a line goes there too. The rest of VAR/state is in memory: a file of the host's costs
milliseconds.
"""

import argparse
import collections
import json
import os
import pathlib
import signal
import subprocess
import sys
import tempfile
import time

from srfs.flight import deployments, mission
from srfs.flight.deployments import NODES
from srfs.flight.processes import PATIENCE, wait_until
from srfs.program import MissionError

KEPT = pathlib.Path("/run/vm/kept")
TIMEOUT_S = 20  # starts and discovery take seconds on an emulated processor
MODULES = {"softdog": ["softdog", "nowayout=1"], "i6300esb": ["i6300esb", "nowayout=1"]}
BIN = pathlib.Path(os.environ["SRFS_BIN"])
PATIENCE_S = 90 * PATIENCE
RESET_DEADLINE_S = 10 * TIMEOUT_S


def report(**fields):
    line = json.dumps(fields)
    print(line, flush=True)
    with open(KEPT / "report", "a") as file:
        file.write(line + "\n")
        file.flush()
        os.fsync(file.fileno())


def prepare(driver, folder):
    """Makes a VAR whose boot record outlives the reset, and the deployment that uses the watchdog device."""
    for words in (["vcan", "echo=1"], ["can-raw"], MODULES[driver]):
        subprocess.run(["modprobe", *words], check=True)
    for words in (["add", "vcan0", "type", "vcan"], ["set", "vcan0", "up"]):
        subprocess.run(["ip", "link", *words], check=True)
    var = folder / "var"
    boot = var / "state" / "boot"
    boot.mkdir(parents=True)
    (KEPT / "boot").mkdir(exist_ok=True)
    # Nodes are confined to VAR, and a symbolic link would lead out of it.
    subprocess.run(["mount", "--bind", KEPT / "boot", boot], check=True)
    # Only the watchdog is under test. Without the ring, its time-out need not be longer than a recovery by the ring.
    deployment = deployments.read("vcan")
    assert "ring" not in deployment
    deployment["devices"]["watchdog"] = "dev:/dev/watchdog0"
    deployments.node(deployment, "timing")["parameters"]["watchdog_timeout_s"] = TIMEOUT_S
    return var, deployments.write(deployment, folder / "vcan.yaml")


def boot_of(ground):
    """Waits until the watchdog was fed. Returns the fields of timing's housekeeping; None if none came."""
    packet = ground.housekeeping("timing", PATIENCE_S, 0, lambda f: f["watchdog_feeds"] > 0)
    return packet and packet["fields"]


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("driver", choices=MODULES)
    driver = parser.parse_args().driver
    KEPT.mkdir(exist_ok=True)
    first = not (KEPT / "report").exists()
    folder = pathlib.Path(tempfile.mkdtemp(prefix="srfs-watchdog-"))
    var, deployment = prepare(driver, folder)
    flight = mission.Mission(var, deployment, BIN, print)
    try:
        flight.start()
    except MissionError:
        mission.show_logs(var, file=sys.stdout)
        raise
    ground = flight.ground()
    fields = boot_of(ground)
    if fields is None:
        heard = collections.Counter(m.get("structure") or m["type"] for m in ground.messages)
        print(f"no housekeeping of timing came; the ground heard {dict(heard)}, its log: {ground.log_path.read_text()!r}")
        mission.show_logs(var, file=sys.stdout)
        return 1
    log = (var / "log" / "timing.log").read_text()
    told = {name: fields[name] for name in ("boot_count", "reset_cause", "watchdog_timeout_s")}
    report(boot=1 if first else 2, kernel=pathlib.Path("/proc/sys/kernel/random/boot_id").read_text().strip(), uptime_s=time.monotonic(),
           nowayout=" nowayout" in log, **told)  # fmt: skip
    if not first:
        return 0
    if driver == "softdog":
        # After a reset, softdog cannot report that it was the cause. So timing writes to the boot record when a reset is imminent.
        subprocess.run([BIN / "srfs", "lifecycle", "timing", "deactivate", "--deadline", str(PATIENCE_S * 1000),
                        "--deployment", deployment, "--var", var], check=True)  # fmt: skip
        records = (KEPT / "boot").glob
        wait_until(lambda: any("withheld 1" in record.read_text() for record in records("record_?")), PATIENCE_S,
                           "the boot record says that nobody feeds")  # fmt: skip
    # On a slow machine a payload may have been fenced in its slot, and without a ring it is not restarted.
    pids = {node: pid for node in NODES if (pid := flight.node_pid(node))}
    for pid in pids.values():
        os.kill(pid, signal.SIGSTOP)
    report(stopped=list(pids), uptime_s=time.monotonic())
    time.sleep(RESET_DEADLINE_S)  # the reset interrupts this
    report(survived_s=RESET_DEADLINE_S)
    return 1


if __name__ == "__main__":
    sys.exit(main())
