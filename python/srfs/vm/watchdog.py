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
from srfs.vm import guest

SLOWER_IN_THE_GUEST = 6
DEVICES = {"softdog": (), "i6300esb": ("i6300esb",)}
DEADLINE_S = 420


class Options:
    kernel = "amd64"
    cpus = 2
    memory_mib = 3072
    deadline = DEADLINE_S
    keep = False


def judge(driver, code, lines):
    """[(what, ok)] of the reports of both boots."""
    boots = [line for line in lines if "boot" in line]
    first, second = boots if len(boots) == 2 else ({}, {})
    return [
        (f"{driver}: two boots of the machine, the second ended well", code == 0 and len(boots) == 2),
        (f"{driver}: it was reset, not merely restarted", bool(first) and first["kernel"] != second["kernel"]),
        (f"{driver}: timing and all other nodes were stopped before", any("timing" in line.get("stopped", ()) for line in lines)),
        (f"{driver}: no process could disarm it (nowayout)", bool(first) and first["nowayout"] and second["nowayout"]),
        (f"{driver}: its time-out is the requested one", bool(first) and first["watchdog_timeout_s"] == 20),
        (f"{driver}: the boot is counted", bool(first) and second["boot_count"] == first["boot_count"] + 1),
        (f"{driver}: the reset cause is the watchdog", bool(first) and second["reset_cause"] == "watchdog"),
    ]


def fly(driver, build):
    command = ["env", f"SRFS_PATIENCE={SLOWER_IN_THE_GUEST}", f"SRFS_BIN={build / 'bin'}", f"PYTHONPATH={ROOT / 'python'}", sys.executable, "-B",
               str(ROOT / "tests" / "vm" / "watchdog_flight.py"), driver]  # fmt: skip
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
    guest.interruptible()
    os.chdir(ROOT)
    results = []
    try:
        for driver in [options.only] if options.only else DEVICES:
            results += fly(driver, options.build.absolute())
    except guest.CannotRun as error:
        guest.say(str(error))
        return guest.EXIT_CANNOT
    except KeyboardInterrupt:
        guest.say("interrupted")
        return 130
    for what, ok in results:
        print(f"  {'ok    ' if ok else 'NOT OK'}  {what}")
    failed = sum(not ok for _, ok in results)
    print(f"{len(results) - failed} passed, {failed} failed")
    return int(failed != 0)


if __name__ == "__main__":
    sys.exit(main())
