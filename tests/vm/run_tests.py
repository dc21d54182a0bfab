# SPDX-FileCopyrightText: 2026 SRFS contributors
# SPDX-License-Identifier: Apache-2.0
"""Runs the tests that need root and a kernel with CAN, on the kernel that runs. ./run vm-test starts it, in a virtual machine if need be.

The last line is "N passed, M failed"; exit code 0 when nothing failed.
"""

import argparse
import json
import os
import pathlib
import subprocess
import sys
import tempfile
import unittest

HERE = pathlib.Path(__file__).resolve().parent
MODULES = ("vxcan", "can-raw", "can-isotp", "sch_tbf", "uhid", "hid-mcp2221", "pps_parport")
PARALLEL_PORT = ["parport_pc", "io=0x378", "irq=7"]  # QEMU's port, from which pps_parport gets its pulses
# Two capture devices, of the single- and of the multi-planar API, each a webcam and nothing else.
VIVID = ["vivid", "n_devs=2", "multiplanar=1,2", "node_types=0x1,0x1", "num_inputs=1,1", "input_types=0,0", "num_outputs=0,0"]
CAN_DEADLINE_S = 1200


def load_modules():
    # echo=1: a sent frame comes back when it leaves the interface, as with a real controller.
    for words in (["vcan", "echo=1"], VIVID, PARALLEL_PORT, *([module] for module in MODULES)):
        subprocess.run(["modprobe", *words], check=False)  # built-in or missing modules show in the tests


def can_tests(program, full):
    """Runs the GoogleTest program. Returns (passed, failed)."""
    with tempfile.TemporaryDirectory(prefix="srfs-vm-") as folder:
        report = pathlib.Path(folder, "report.json")
        repeat = ["--gtest_repeat=5", "--gtest_shuffle"] if full else []
        try:
            code = subprocess.run([program, "--gtest_brief=0", f"--gtest_output=json:{report}", *repeat], stdin=subprocess.DEVNULL,
                                  timeout=CAN_DEADLINE_S, check=False).returncode  # fmt: skip
        except subprocess.TimeoutExpired:
            print(f"{program}: not done within {CAN_DEADLINE_S} s")
            code = -1
        try:
            told = json.loads(report.read_text())
        except (OSError, ValueError):
            return 0, 1
    failed = max(told["failures"] + told.get("errors", 0), int(code != 0))  # with repetitions, the report covers only the last
    return told["tests"] - told.get("disabled", 0) - failed, failed


def python_tests(module):
    suite = unittest.defaultTestLoader.loadTestsFromName(module)
    result = unittest.TextTestRunner(stream=sys.stdout, verbosity=2).run(suite)
    failed = len(result.failures) + len(result.errors)
    return max(result.testsRun - failed, 0), failed


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--build", type=pathlib.Path, default=HERE.parents[1] / "build-release", metavar="DIR", help="default: %(default)s")
    parser.add_argument("--full", action="store_true", help="everything several times, in random order")
    parser.add_argument("--only", choices=("can", "mission", "storage"),
                        help="SocketCAN, ISO-TP, GPIO, pulses and camera, the mission, or failing storage, alone")  # fmt: skip
    options = parser.parse_args()
    os.environ["SRFS_BIN"] = str(options.build / "bin")
    os.environ["SRFS_VM_FULL"] = str(int(options.full))
    sys.stdout.reconfigure(line_buffering=True)
    if options.only != "storage":
        load_modules()
    counts = []
    if options.only in (None, "can"):
        counts.append(can_tests(str(options.build / "tests" / "vm_test_can"), options.full))
    if options.only in (None, "mission"):
        counts.append(python_tests("test_mission"))
    # Never on the disks of a real machine.
    if os.environ.get("SRFS_IN_GUEST") == "1" and options.only == "storage":
        counts.append(python_tests("test_storage"))
    passed, failed = (sum(column) for column in zip(*counts))
    print(f"{passed} passed, {failed} failed")
    return int(failed != 0)


if __name__ == "__main__":
    sys.exit(main())
