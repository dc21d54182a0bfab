# SPDX-FileCopyrightText: 2026 SRFS contributors
# SPDX-License-Identifier: Apache-2.0
"""The tests that need a kernel with CAN (tests/vm): the suite and its SocketCAN driver against Linux' own CAN stack and can-utils, the GPIO
driver on a chip of the kernel's, pulses that the kernel stamps, the V4L2 driver on the kernel's virtual camera. --kernel rt: on Debian's
kernel with PREEMPT_RT, with a board's priorities and locked memory; about function, for an emulated processor has no latency worth a word.

Where this kernel can make a vcan interface (as root), they run directly, on interfaces of their own that are removed afterwards. Elsewhere
a virtual machine is booted with Debian's kernel, about 5 s; the first time its package is fetched (70 MB). About a minute then, --full 6.

Exit codes: 0 all passed, 1 some failed, 2 cannot be done here, 124 the virtual machine hung, 125 it reset itself.
"""

import argparse
import os
import pathlib
import subprocess
import sys

from srfs import ROOT
from srfs.vm import guest

DEADLINE_S = 600
FULL_DEADLINE_S = 3000


def kernel_has_can():
    """Whether a vcan interface can be made here: tried, because no list of modules shows it."""
    if os.geteuid() != 0:
        return False
    name = f"sv{os.getpid()}t"
    try:
        made = subprocess.run(["ip", "link", "add", name, "type", "vcan"], capture_output=True, check=False).returncode == 0
    except FileNotFoundError:
        return False
    if made:
        subprocess.run(["ip", "link", "del", name], check=True)
    return made


def parse():
    parser = argparse.ArgumentParser(prog="./run vm-test", description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--full", action="store_true", help="run everything several times, in random order")
    parser.add_argument("--only", choices=("can", "mission", "storage"),
                        help="run only SocketCAN, ISO-TP, GPIO, pulses and camera (can), only the mission, or only failing storage")  # fmt: skip
    parser.add_argument("--vm", action="store_true", help="use the virtual machine even if this kernel has CAN")
    parser.add_argument("--build", type=pathlib.Path, default=ROOT / "build-release", help=argparse.SUPPRESS)
    guest.add_options(parser, f"{DEADLINE_S}, with --full {FULL_DEADLINE_S}")
    parser.set_defaults(deadline=None)
    options = parser.parse_args()
    options.deadline = options.deadline or (FULL_DEADLINE_S if options.full else DEADLINE_S)
    return options


def run(options):
    arguments = ["--build", str(options.build.absolute()), *(["--full"] if options.full else []), *(["--only", options.only] if options.only else [])]
    if not options.vm and options.only != "storage" and options.kernel == "amd64" and kernel_has_can():
        print("this kernel has CAN: no virtual machine", flush=True)
        return subprocess.run(guest.python("run_tests.py", *arguments, SRFS_PATIENCE=os.environ.get("SRFS_PATIENCE", 1)), stdin=subprocess.DEVNULL, check=False).returncode
    return guest.run(guest.python("run_tests.py", *arguments, SRFS_IN_GUEST=1), options, guest.say)


def main():
    options = parse()
    return guest.exit_code_of(lambda: run(options))


if __name__ == "__main__":
    sys.exit(main())
