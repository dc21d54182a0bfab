# SPDX-FileCopyrightText: 2026 SRFS contributors
# SPDX-License-Identifier: Apache-2.0
"""Nodes of the arm64 build talk to each other: timing, can_switcher and payload_eps, each a process of its own in QEMU's user-mode
emulation, over Fast DDS on the loopback interface. The simulated spacecraft around them runs on this machine itself: the emulation has no
pseudo-terminals.

The witness is the record of the simulated CAN bus. The payload wakes its peripheral only when a flag of the switcher reached it, the
switcher sets one only when a tick of timing reached it, and the next one only when the payload's report came back. Emulated threads are
slow and their times say nothing, so there is no ring, and slots are long. Exit code 0: the peripheral was woken in several slots.
"""

import argparse
import contextlib
import os
import pathlib
import shutil
import subprocess
import sys
import tempfile
import time

from srfs import ROOT
from srfs.flight import deployments, mission
from srfs.flight.processes import end_processes, wait_until
from srfs.program import MissionError

EMULATOR = "qemu-aarch64-static"
NODES = ("timing", "can_switcher", "payload_eps")
READY_DEADLINE_S = 60
STOP_PATIENCE_S = 20  # emulated
WAKE_UP = "18DA1201#0401"  # a single frame to the EPS: request 01 (docs/reference/icd_can.md)
WANTED = 5  # slots in which it was sent


def emulated():
    """vcan.yaml, whose times fit an emulated processor, on the simulated bus, with three of its nodes."""
    deployment = deployments.read("vcan")
    deployment["devices"]["can"] = "sim:run/can_hub.sock"
    deployment["nodes"] = [node for node in deployment["nodes"] if node["name"] in NODES]
    deployment["slots"] = [slot for slot in deployment["slots"] if slot["payload"] in NODES]
    deployment["dds"]["domain"] = 0  # a namespace of its own
    deployment["simulation"]["can_log"] = "log/can.log"
    return deployment


class Suite:
    """Processes of one deployment; `prefix` before a program of the board starts it under the emulator."""

    def __init__(self, sysroot, var, deployment):
        self.var, self.deployment = var, deployment
        shim = var / "multicast_if.so"
        subprocess.run(["aarch64-linux-gnu-gcc", "-shared", "-fPIC", "-O1", "-o", shim, ROOT / "tools/arm64/multicast_if.c"], check=True)
        self.prefix = [EMULATOR, "-L", str(sysroot), "-E", f"LD_PRELOAD={shim}"]
        self.running = []

    def start(self, name, *command):
        command = [*command, "--deployment", self.deployment, "--var", self.var]
        with open(self.var / "log" / f"{name}.log", "wb") as log:
            self.running.append(subprocess.Popen(list(map(str, command)), stdin=subprocess.DEVNULL, stdout=log, stderr=log))

    def end(self):
        end_processes([process.pid for process in reversed(self.running)], STOP_PATIENCE_S)
        for process in self.running:
            process.wait()


def fly(build, hw_sim, sysroot, folder, deadline_s):
    var = folder / "var"
    (var / "log").mkdir(parents=True)
    (var / "run").mkdir()
    deployment = folder / "emulated.yaml"
    deployments.write(emulated(), deployment)
    suite = Suite(sysroot, var, deployment)
    try:
        suite.start("hw_sim", hw_sim)
        wait_until((var / "run/hw_sim.ready").exists, READY_DEADLINE_S, "the simulated spacecraft is ready")
        (var / "run/dds_domain").write_text("0\n")
        for name in NODES:
            suite.start(name, *suite.prefix, build / f"bin/{name}_node", "--name", name, "--domain", "0")
        begin = time.monotonic()

        def wake_ups():
            with contextlib.suppress(OSError):
                return (var / "log/can.log").read_text().count(WAKE_UP)
            return 0

        try:
            wait_until(lambda: wake_ups() >= WANTED, deadline_s, f"{WANTED} slots", 0.2)
        except MissionError as error:
            print(f"arm64: {error}; the peripheral was woken {wake_ups()} times", file=sys.stderr)
            mission.show_logs(var, 10)
            return 1
        print(f"after {time.monotonic() - begin:.1f} s the peripheral was woken {wake_ups()} times")
        return 0
    finally:
        suite.end()
        mission.forget_memory(var)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--build", type=pathlib.Path, default=ROOT / "build-arm64")
    parser.add_argument("--hw-sim", type=pathlib.Path, default=ROOT / "build-release/bin/hw_sim", help="hw_sim for this machine")
    parser.add_argument("--sysroot", type=pathlib.Path,
                        default=pathlib.Path(os.environ.get("XDG_CACHE_HOME") or pathlib.Path.home() / ".cache") / "srfs/arm64/sysroot")  # fmt: skip
    parser.add_argument("--deadline", type=int, default=120, metavar="S")
    parser.add_argument("--inside", action="store_true", help=argparse.SUPPRESS)
    arguments = parser.parse_args()
    if not arguments.inside:
        # Loopback, processes and shared memory of its own: shared memory of another architecture's Fast DDS would crash it.
        inside = "ip link set lo up && mount -t tmpfs tmpfs /dev/shm && exec \"$@\""
        os.execvp("unshare", ["unshare", "--map-root-user", "--net", "--mount", "--pid", "--fork", "--kill-child", "--mount-proc", "sh", "-c", inside, "sh",
                              sys.executable, "-B", "-m", "srfs.arm64", *sys.argv[1:], "--inside"])  # fmt: skip
    with tempfile.TemporaryDirectory(prefix="srfs_arm64_") as folder:
        sys.exit(fly(arguments.build.absolute(), arguments.hw_sim.absolute(), arguments.sysroot, pathlib.Path(folder), arguments.deadline))


if __name__ == "__main__":
    main()
