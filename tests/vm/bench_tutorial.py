# SPDX-FileCopyrightText: 2026 SRFS contributors
# SPDX-License-Identifier: Apache-2.0
"""The page of python/srfs/vm/bench_tutorial.py in its guest. Everything it writes is in the guest's memory.

Before the first section that needs hardware, the adapters are plugged in (their drivers are loaded). Two things are not as on a bench: sim.yaml
has longer times, a slower line and fewer nodes, because the processor is emulated, and sudo is a script, because there is only root.
"""

import os
import pathlib
import subprocess
import sys
import tempfile
import time

from srfs import ROOT, tutorial
from srfs.flight import deployments, mission
from srfs.flight.processes import PATIENCE

PAGE = "docs/tutorial/from_simulation_to_bench.md"
CAMERA = ["vivid", "n_devs=1", "node_types=0x1", "num_inputs=1", "input_types=0", "num_outputs=0"]
DRIVERS = (["kvaser_pci"], ["can-raw"], ["xhci_pci"], ["ftdi_sio"], CAMERA)
DEVICES = ("/dev/ttyUSB0", "/dev/ttyUSB1", "/sys/class/net/can0", "/sys/class/net/can1", "/dev/video0")
BAUD = 38400  # what the emulated adapters carry
STEP_PATIENCE_S = 60 * PATIENCE


def slow_simulation(sim, file, image_lane=()):
    """Writes a sim.yaml for an emulated processor: sim's devices, vcan's nodes as far as the page uses them, and long times."""
    slow = deployments.read("vcan")
    nodes = [deployments.node(slow, name) for name in ("timing", "can_switcher", "payload_eps", "ttc")]
    nodes += [deployments.node(sim, name) for name in image_lane]
    nodes[0]["parameters"]["tick_period_ms"] = 2000
    nodes[2]["parameters"]["answer_timeout_ms"] = 1000
    slots = [{"payload": "payload_eps", "allotted_ms": 1500, "overrun_ms": 4000, "reset_ms": 1000}]
    modes = {**slow["modes"], "causes": []}  # they watch other payloads, too
    link = {**slow["link"], "baud": BAUD}
    changed = {"deployment": "sim", "devices": sim["devices"], "link": link, "modes": modes, "nodes": nodes, "slots": slots}
    deployments.write({**slow, **changed}, file)


def plug_in():
    for words in DRIVERS:
        subprocess.run(["modprobe", *words], check=True)
    end = time.monotonic() + STEP_PATIENCE_S
    while missing := [device for device in DEVICES if not os.path.exists(device)]:
        if time.monotonic() > end:
            raise tutorial.TutorialError(f"QEMU and the kernel gave no {missing}")
        time.sleep(0.1)


def shell_of(home):
    """Where sudo only runs its command."""
    programs = home / "programs"
    programs.mkdir()
    (programs / "sudo").write_text('#!/bin/sh\nexec "$@"\n')
    (programs / "sudo").chmod(0o755)
    return tutorial.Shell(ROOT, {**os.environ, "HOME": str(home), "PATH": f"{programs}:{os.environ['PATH']}"})


def follow(shell, home):
    """Does the steps. Returns how many of those need hardware."""
    sim = deployments.read("sim")
    slow_simulation(sim, deployments.FOLDER / "sim.yaml")
    text = (ROOT / PAGE).read_text()
    without = {step.line for step in tutorial.steps_of(PAGE, text)}
    on_hardware = 0
    for step in tutorial.steps_of(PAGE, text, hardware=True):
        if step.line not in without:
            if on_hardware == 0:
                plug_in()
            on_hardware += 1
        if isinstance(step, tutorial.Edit) and step.path == "~/bench/camera.yaml":
            slow_simulation(sim, home / "bench/sim.yaml", ("image_acquisition", "image_processing"))
        began = time.monotonic()
        if isinstance(step, tutorial.Commands):
            shell.do(PAGE, step, STEP_PATIENCE_S)
        else:
            tutorial.apply_edit(PAGE, step, ROOT, home)
        print(f"{PAGE}:{step.line}: {time.monotonic() - began:.1f} s", flush=True)
    return on_hardware


def main():
    if os.environ.get("SRFS_IN_GUEST") != "1":
        print("only in the guest of python/srfs/vm/bench_tutorial.py: it changes the tree", file=sys.stderr)
        return 2
    home = pathlib.Path(tempfile.mkdtemp(prefix="srfs-bench-"))
    shell = shell_of(home)
    try:
        passed, failed = follow(shell, home), 0
        if passed == 0:
            print(f"{PAGE} has no section that needs hardware")
            failed = 1
    except tutorial.TutorialError as error:
        print(error)
        for var in ("var", "can", "camera"):
            mission.show_logs(home / "bench" / var, file=sys.stdout)
        passed, failed = 0, 1
    shell.end()
    print(f"{passed} passed, {failed} failed")
    return int(failed != 0)


if __name__ == "__main__":
    sys.exit(main())
