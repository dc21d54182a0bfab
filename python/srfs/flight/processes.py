# SPDX-FileCopyrightText: 2026 SRFS contributors
# SPDX-License-Identifier: Apache-2.0
"""Processes of this machine: which ones belong to a suite, waiting for them with patience, ending them; the signals of this one."""

import contextlib
import fcntl
import os
import pathlib
import queue
import select
import signal
import struct
import subprocess
import time

from srfs.flight.lateness import ProcessWait
from srfs.program import Interrupted, MissionError

# SRFS_PATIENCE: this machine (an emulated one) is so many times slower than a usual one, and so much longer is waited.
PATIENCE = int(os.environ.get("SRFS_PATIENCE", "1"))
STOP_PATIENCE_S = 5 * PATIENCE  # without the time in which a process waits for a CPU; ten times as long in all
MOST_PATIENCE = 10


def output(*command, timeout_s=200, **options):
    """The standard output of a program that must succeed."""
    run = subprocess.run([*map(str, command)], stdin=subprocess.DEVNULL, capture_output=True, text=True, timeout=timeout_s, **options)
    if run.returncode != 0:
        called = " ".join([os.path.basename(command[0]), *map(str, command[1:3])])
        raise MissionError(f"{called}: exit code {run.returncode}: {(run.stderr.strip() or run.stdout.strip())[-4000:]}")
    return run.stdout


def pids():
    return [int(name) for name in os.listdir("/proc") if name.isdigit()]


def lock_owner(path):
    """Pid that holds the record lock of a node's lock file, as the kernel reports it; None when no process does. A shared lock is nobody's."""
    whole_file = struct.pack("hhqqi4x", fcntl.F_RDLCK, os.SEEK_SET, 0, 0, 0)
    try:
        with open(path, "r+b") as file:
            kind, _, _, _, pid = struct.unpack("hhqqi4x", fcntl.fcntl(file, fcntl.F_GETLK, whole_file))
    except OSError:
        return None
    return None if kind == fcntl.F_UNLCK else pid


def is_flocked(path):
    try:
        with open(path, "r+b") as file:
            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        return True
    except OSError:
        return False
    return False


def command_line(pid):
    try:
        return pathlib.Path(f"/proc/{pid}/cmdline").read_bytes().decode(errors="replace").split("\0")
    except OSError:
        return []


def processes_of(var):
    """{pid: program} of the simulator and the nodes that run for this VAR folder."""
    found = {}
    for pid in pids():
        words = command_line(pid)
        program = os.path.basename(words[0]) if words else ""
        place = words.index("--var") + 1 if "--var" in words else len(words)
        in_slot = bool(words) and words[0].startswith(f"{var}/versions/")
        if (program == "hw_sim" or program.endswith("_node") or in_slot) and words[place : place + 1] == [str(var)]:
            found[pid] = program
    return found


def kib_of(file, name):
    """The value of a line like `Pss: 123 kB` in a file of /proc; None: the process has ended."""
    with contextlib.suppress(OSError, StopIteration):
        lines = pathlib.Path(file).read_text().splitlines()
        return int(next(line for line in lines if line.startswith(f"{name}:")).split()[1])
    return None


def send_signal(pid, number):
    """To the process that has this pid now, if there is one; None: to none."""
    with contextlib.suppress(ProcessLookupError):
        if pid is not None:
            os.kill(pid, number)


def end_processes(pids, patience_s=STOP_PATIENCE_S):
    """SIGTERM, then SIGKILL for those still there. Returns the pids that needed SIGKILL."""
    handles = {}
    for pid in pids:
        with contextlib.suppress(ProcessLookupError):
            handles[pid] = os.pidfd_open(pid)
            signal.pidfd_send_signal(handles[pid], signal.SIGTERM)
            signal.pidfd_send_signal(handles[pid], signal.SIGCONT)
    killed = []
    begin = time.monotonic()
    for pid, handle in handles.items():
        if not has_ended(handle, pid, patience_s, begin):
            killed.append(pid)
            with contextlib.suppress(ProcessLookupError):
                signal.pidfd_send_signal(handle, signal.SIGKILL)
            select.select([handle], [], [], 2)
        os.close(handle)
    return killed


class Patience:
    """So many seconds from `begin` on, now unless given. Time in which the process `pid` waits for a CPU does not count, up to MOST_PATIENCE
    times as long; None: all counts."""

    def __init__(self, seconds, pid=None, begin=None):
        self.seconds, self.begin, self.waited_s = seconds, time.monotonic() if begin is None else begin, 0.0
        self._process = None if pid is None else ProcessWait(pid)

    def __enter__(self):
        return self

    def __exit__(self, *failure):
        if self._process:
            self._process.close()

    def elapsed_s(self):
        return time.monotonic() - self.begin

    def left_s(self):
        if self._process:
            self.waited_s += (self._process.read(time.monotonic_ns()) or 0) / 1e9
        return min(self.seconds + self.waited_s, MOST_PATIENCE * self.seconds) - self.elapsed_s()


def has_ended(handle, pid, patience_s, begin):
    """Waits for the end of a process (a pidfd) that was asked to end at `begin`."""
    with Patience(patience_s, pid, begin) as patience:
        while True:
            left_s = patience.left_s()
            if select.select([handle], [], [], min(max(left_s, 0), 0.1))[0]:
                return True
            if left_s <= 0:
                return False


def wait_until(condition, deadline_s, what, period_s=0.02, pid=None):
    """Waits until condition() is true and returns its value; MissionError after deadline_s, counted as Patience does for the process `pid`."""
    with Patience(deadline_s, pid) as patience:
        while True:
            value = condition()
            if value:
                return value
            if patience.left_s() < 0:
                waited_s = patience.waited_s
                waiting = f"; it waited for a CPU for {waited_s:.0f} s: close other programs and try again" if waited_s > deadline_s / 4 else ""
                raise MissionError(f"{what}: not within {patience.elapsed_s():.0f} s{waiting}")
            time.sleep(period_s)


def wait_while_it_goes_on(condition, progress, idle_s, what):
    """Waits until condition() is true and returns its value; MissionError when progress() has not changed for idle_s. For work whose amount is known and
    whose speed is the machine's."""
    seen, since = progress(), time.monotonic()
    while True:
        value = condition()
        if value:
            return value
        now, at = progress(), time.monotonic()
        if now != seen:
            seen, since = now, at
        if at - since > idle_s:
            raise MissionError(f"{what}: nothing new for {idle_s} s, the last was {seen}")
        time.sleep(0.1)


def stop_child(process):
    """Ends a child. Returns whether it ended by itself, or by SIGTERM."""
    if process.poll() is not None:
        return True
    killed = end_processes([process.pid])
    process.wait()
    return not killed


class StopSignals:
    """SIGINT and SIGTERM as something to look at: the first asks for an orderly end."""

    def __init__(self):
        self._asked = queue.SimpleQueue()
        self.asked = False
        for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
            signal.signal(number, self._on_signal)

    def _on_signal(self, number, frame):
        self.asked = True
        self._asked.put(number)

    def wait(self, seconds):
        """Waits; True as soon as the end was asked for."""
        with contextlib.suppress(queue.Empty):
            self._asked.get(timeout=seconds)
        return self.asked

    def check(self):
        """Interrupted when the end was asked for."""
        if self.asked:
            raise Interrupted

    def pause(self, seconds):
        """Waits so long; Interrupted when the end was or is asked for."""
        self.check()
        self.wait(max(0, seconds))
        self.check()

    def wait_until(self, condition, deadline_s, what, period_s=0.02):
        """As wait_until(); Interrupted when the end was or is asked for."""

        def looked():
            self.check()
            return condition()

        return wait_until(looked, deadline_s, what, period_s)
