# SPDX-FileCopyrightText: 2026 SRFS contributors
# SPDX-License-Identifier: Apache-2.0
"""Linux' watchdog devices really reset the machine: the suite in a virtual machine, stopped as a whole, comes up again after the reset.

softdog: the kernel's own timer resets. i6300esb: QEMU plays the chip, which also tells the next boot that it was the cause. Twice two
boots, a minute each. The last line is "N passed, M failed".

Exit codes: 0 all passed, 1 some failed, 2 cannot be done here.
"""

import argparse
import json
import os
import pathlib
import sys
import tempfile

from srfs import ROOT
from srfs.report import check, conclude
from srfs.vm import guest

DEVICES = {"softdog": (), "i6300esb": ("-device", "i6300esb")}
DEADLINE_S = 420


class Options:
    kernel = "amd64"
    cpus = 2
    memory_mib = 3072
    deadline = DEADLINE_S
    keep = False


def judge(driver, code, lines):
    """The checks of the reports of both boots."""
    boots = [line for line in lines if "boot" in line]
    first, second = boots if len(boots) == 2 else ({}, {})
    return [
        check(code == 0 and len(boots) == 2, f"{driver}: two boots of the machine, the second ended well"),
        check(bool(first) and first["kernel"] != second["kernel"], f"{driver}: it was reset, not merely restarted"),
        check(any("timing" in line.get("stopped", ()) for line in lines), f"{driver}: timing and all other nodes were stopped before"),
        check(bool(first) and first["nowayout"] and second["nowayout"], f"{driver}: no process could disarm it (nowayout)"),
        check(bool(first) and first["watchdog_timeout_s"] == 20, f"{driver}: its time-out is the requested one"),
        check(bool(first) and second["boot_count"] == first["boot_count"] + 1, f"{driver}: the boot is counted"),
        check(bool(first) and second["reset_cause"] == "watchdog", f"{driver}: the reset cause is the watchdog"),
    ]


def fly(driver, build):
    command = guest.python("watchdog_flight.py", driver, SRFS_BIN=build / "bin")
    with tempfile.TemporaryDirectory(prefix="srfs-watchdog-") as folder:
        report = pathlib.Path(folder, "report")
        code = guest.run(command, Options, guest.say, DEVICES[driver], may_reset=True, keep_file=("kept/report", report))
        lines = [json.loads(line) for line in report.read_text().splitlines()] if report.exists() else []
    return judge(driver, code, lines)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--build", type=pathlib.Path, default=ROOT / "build-release", metavar="DIR", help="default: %(default)s")
    parser.add_argument("--only", choices=DEVICES, help="test only this device")
    options = parser.parse_args()
    os.chdir(ROOT)

    def run():
        checks = [check for driver in ([options.only] if options.only else DEVICES) for check in fly(driver, options.build.absolute())]
        return conclude(checks)

    return guest.exit_code_of(run)


if __name__ == "__main__":
    sys.exit(main())
