# SPDX-FileCopyrightText: 2026 SRFS contributors
# SPDX-License-Identifier: Apache-2.0
"""This machine, as far as figures depend on it, and programs beside a flight that take its CPUs."""

import contextlib
import gzip
import os
import pathlib
import platform
import re
import shutil
import signal
import subprocess
import tempfile

from srfs.flight.lateness import cpu_times
from srfs.program import MissingProgram

RT_PRIORITY = 50  # as a deployment gives it to timing


def read(path):
    try:
        return pathlib.Path(path).read_text().strip()
    except OSError:
        return None


def preemption(version, realtime, mode, configuration, command_line):
    """The kernel's preemption model. Pure.

    version        uname -v, with the word PREEMPT_RT, PREEMPT_DYNAMIC, PREEMPT or none of them
    realtime       /sys/kernel/realtime
    mode           of PREEMPT_DYNAMIC now: /sys/kernel/debug/sched/preempt, "none (voluntary) full"
    configuration  the kernel's, with the mode it starts in; command_line may change that
    All but the first may be None.
    """
    if realtime == "1" or "PREEMPT_RT" in version:
        return "PREEMPT_RT"
    if "PREEMPT_DYNAMIC" not in version:
        return "PREEMPT" if "PREEMPT" in version else "PREEMPT_NONE or PREEMPT_VOLUNTARY"
    now = re.search(r"\((\w+)\)", mode or "") or re.search(r"\bpreempt=(\w+)", command_line or "")
    configured = re.search(r"^CONFIG_PREEMPT_(NONE|VOLUNTARY|LAZY)=y$", configuration or "", re.M)
    known = now or configured
    return f"PREEMPT_DYNAMIC ({known[1].lower() if known else 'mode unknown'})"


def kernel_configuration():
    with contextlib.suppress(OSError):
        return gzip.decompress(pathlib.Path("/proc/config.gz").read_bytes()).decode()
    return read(f"/boot/config-{platform.release()}")


def virtualisation():
    """What this machine is a guest of; None: none."""
    if "hypervisor" not in (read("/proc/cpuinfo") or ""):
        return None
    with contextlib.suppress(OSError):
        run = subprocess.run(["systemd-detect-virt", "--vm"], stdin=subprocess.DEVNULL, capture_output=True, text=True)
        if run.returncode == 0:
            return run.stdout.strip()
    return "virtual machine"


def machine():
    """What the figures depend on."""
    cpu = re.search(r"^model name\s*:\s*(.*)$", read("/proc/cpuinfo") or "", re.M)
    model = preemption(platform.version(), read("/sys/kernel/realtime"), read("/sys/kernel/debug/sched/preempt"), kernel_configuration(),
                       read("/proc/cmdline"))  # fmt: skip
    return {"cpus": os.cpu_count(), "cpu": cpu[1] if cpu else platform.machine(), "kernel": platform.release(), "kernel_version": platform.version(),
            "preemption": model, "virtual": virtualisation(), "governor": read("/sys/devices/system/cpu/cpu0/cpufreq/scaling_governor"),
            "clocksource": read("/sys/devices/system/clocksource/clocksource0/current_clocksource"),
            "rmem_max": int(read("/proc/sys/net/core/rmem_max") or 0)}  # fmt: skip


def described(machine):
    """One line that says what it ran on."""
    where = f", virtual ({machine['virtual']})" if machine["virtual"] else ""
    return f"Linux {machine['kernel']}, {machine['preemption']}; {machine['cpus']} x {machine['cpu']}{where}; clock {machine['clocksource']}"


def load_average():
    return [round(x, 2) for x in os.getloadavg()]


def stolen_s():
    """CPU time that the host gave to others since the boot, of all CPUs."""
    return cpu_times(read("/proc/stat"))[0] / os.sysconf("SC_CLK_TCK")


def may_be_real_time():
    try:
        before = os.sched_getscheduler(0), os.sched_getparam(0)
        os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(RT_PRIORITY))
        os.sched_setscheduler(0, *before)
        return True
    except PermissionError:
        return False


@contextlib.contextmanager
def stress_ng(options, each_alone=False):
    """Runs `stress-ng OPTIONS` until the end of the block. Yields is_running().

    each_alone: each worker has its own session: a kernel that shares CPU time among sessions (autogroup, as in Debian) would treat all
    workers of one session as a single competitor, which is no load.
    """
    if not shutil.which("stress-ng"):
        raise MissingProgram("stress-ng")
    workers = [options.split()]
    if each_alone:
        workers = [[what, "1"] for what, count in zip(workers[0][::2], workers[0][1::2]) for _ in range(int(count))]
    with tempfile.TemporaryDirectory() as folder, contextlib.ExitStack() as stack:
        loads = []
        for worker in workers:
            loads.append(subprocess.Popen(["stress-ng", *worker, "--quiet"], cwd=folder, stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL,
                                          stderr=subprocess.DEVNULL, start_new_session=True))  # fmt: skip
            stack.callback(_end_session, loads[-1])
        yield lambda: all(load.poll() is None for load in loads)


def _end_session(process):
    with contextlib.suppress(ProcessLookupError):
        os.killpg(process.pid, signal.SIGKILL)
    process.wait()
