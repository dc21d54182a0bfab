# SPDX-FileCopyrightText: 2026 SRFS contributors
# SPDX-License-Identifier: Apache-2.0
"""Whether this machine had time for the suite. Two witnesses, processes of their own, so that nothing the asking program does can delay them.

Lateness sleeps, and sees how much too late it wakes: what a hypervisor or the kernel takes from every process. It does not see that others
are busy as well, for a process that sleeps much goes first. Some of its threads keep to one CPU each, and count what a hypervisor takes there;
what they waited for a CPU that another thread had is none of it. Waiting reads how long each process of a suite was ready to run and had no CPU.
Standard library only.
"""

import contextlib
import json
import os
import select
import subprocess
import sys
import threading
import time

PERIOD_S = 0.005
LATE_S = 0.020  # what the nodes allow a callback; a peripheral has 25 ms for its answer
LOOK_S = 0.1  # how often the witness asks what was stolen
TICK_S = 0.01  # unit of /proc/stat (USER_HZ)
MOST_CPUS = 8  # that it sleeps on
MOST_LATE = 100_000  # intervals it notes, hours of a bad host; later ones are counted only
WAIT_LOOK_S = 0.2  # how often the other one reads what the processes waited
LEAST_WAIT_NS = 1_000_000  # what it notes
EVIDENCE_SHARE = 0.05  # of a longer time, which must have been waited to excuse anything


class Witness:
    """One witness, from its construction on. One that dies has seen nothing. Subclasses: what it is asked to do, and what nothing is."""

    ARGUMENTS = ()
    NOTHING = {}

    def __init__(self, *arguments):
        # Its own session: an interrupt at the terminal stops the asking process only, whose end ends this one.
        self._process = subprocess.Popen([sys.executable, "-B", "-S", __file__, *self.ARGUMENTS, *map(str, arguments)], stdin=subprocess.PIPE,
                                         stdout=subprocess.PIPE, text=True, start_new_session=True)  # fmt: skip
        self._seen = None

    def end(self):
        """What it saw."""
        if self._seen is None:
            try:
                self._seen = json.loads(self._process.communicate(timeout=60)[0])
            except (subprocess.TimeoutExpired, OSError, ValueError):
                self._process.kill()
                self._process.communicate()
                self._seen = dict(self.NOTHING)
        return self._seen

    def __enter__(self):
        return self

    def __exit__(self, kind, value, traceback):
        self.end()


class Lateness(Witness):
    """end(): {wakeups, late, longest_ms, stolen, late_at}: how often it woke, how often more than LATE_S too late, how late at most; which part
    of the CPU time the hypervisor took; [begin, end] of CLOCK_MONOTONIC in ns where it woke that late on any CPU, in one or in several goes
    within LOOK_S, or where as much of a CPU was taken."""

    NOTHING = {"wakeups": 0, "late": 0, "longest_ms": 0.0, "stolen": 0.0, "late_at": []}


class Waiting(Witness):
    """The processes with this VAR on their command line: hw_sim, the nodes, srfs. end(): {NAME: {waited_s, waits}} with the time that the
    thread of it that waited longest was ready to run and had no CPU, and [begin, end, waited] in ns of CLOCK_MONOTONIC where it had to wait.
    Empty where the kernel does not report it."""

    ARGUMENTS = ("--waiting",)


def waited_ns(seen, names, begin_ns, end_ns):
    """The longest time that one of the processes waited for a CPU between two times, as Waiting saw it."""
    longest = 0
    for name in names:
        longest = max(longest, sum(min(waited, min(end, end_ns) - max(begin, begin_ns))
                                   for begin, end, waited in seen.get(name, {}).get("waits", ()) if begin < end_ns and end > begin_ns))  # fmt: skip
    return longest


class Excuses:
    """What the machine's business costs is excused by what the witnesses measured meanwhile, and by nothing else."""

    def __init__(self, lateness, waiting):
        self.lateness = lateness
        self.waiting = waiting

    def find(self, names, begin_ns, end_ns):
        """Why something that needed these processes between two times may have come late, in words; None: no reason was measured."""
        least_ns = max(LATE_S * 1e9, EVIDENCE_SHARE * (end_ns - begin_ns))
        waited = {name: waited_ns(self.waiting, [name], begin_ns, end_ns) for name in names}
        name = max(waited, key=waited.get, default=None)
        if name and waited[name] >= least_ns:
            return f"{name} waited {waited[name] / 1e6:.0f} ms for a CPU"
        late_ns = sum(max(0, min(end, end_ns) - max(begin, begin_ns)) for begin, end in self.lateness["late_at"])
        return f"this machine stood still for {late_ns / 1e6:.0f} ms" if late_ns >= least_ns else None


def describe_waiting(seen):
    """What the processes waited, in words."""
    if not seen:
        return "how long processes waited for a CPU is unknown"
    most = sorted(seen, key=lambda name: -seen[name]["waited_s"])[:4]
    return "waited for a CPU: " + ", ".join(f"{name} {seen[name]['waited_s']:.1f} s" for name in most)


class ProcessWait:
    """How long a process was ready to run and had no CPU, from repeated readings. The kernel adds a wait when it ends; one that goes on is
    a runnable thread whose numbers stand still."""

    RENEW_NS = 2_000_000_000  # threads that come later are found then

    def __init__(self, pid):
        self.pid = pid
        self._threads = {}  # tid -> [schedstat, stat (descriptors), numbers, counted while it goes on]
        self._read_at = self._listed_at = None

    def read(self, now_ns):
        """The wait of its longest-waiting thread since the last reading, in ns; None when it has ended or the kernel does not report it."""
        if self._listed_at is None or now_ns - self._listed_at >= self.RENEW_NS:
            self._list(now_ns)
        longest, elapsed = 0, 0 if self._read_at is None else now_ns - self._read_at
        self._read_at = now_ns
        for tid, thread in list(self._threads.items()):
            try:
                numbers = os.pread(thread[0], 96, 0)
                state = os.pread(thread[1], 128, 0).rpartition(b")")[2][1:2] if numbers == thread[2] else b""
            except OSError:
                self._close(self._threads.pop(tid))
                continue
            if numbers != thread[2]:
                added = int(numbers.split()[1]) - int(thread[2].split()[1]) - thread[3]
                thread[2:] = numbers, 0
            else:
                added = elapsed if state == b"R" else 0
                thread[3] += added
            longest = max(longest, added)
        return longest if self._threads else None

    def _list(self, now_ns):
        self._listed_at = now_ns
        with contextlib.suppress(OSError):
            for tid in os.listdir(f"/proc/{self.pid}/task"):
                if tid in self._threads:
                    continue
                opened = []
                try:
                    for name in ("schedstat", "stat"):
                        opened.append(os.open(f"/proc/{self.pid}/task/{tid}/{name}", os.O_RDONLY | os.O_CLOEXEC))
                    numbers = os.pread(opened[0], 96, 0)
                    if int(tid) == self.pid and not any(map(int, numbers.split())):
                        raise OSError("a kernel that has the file and does not count")
                    self._threads[tid] = [*opened, numbers, 0]
                except OSError:
                    self._close(opened)

    @staticmethod
    def _close(descriptors):
        for descriptor in descriptors[:2]:
            os.close(descriptor)

    def close(self):
        for thread in self._threads.values():
            self._close(thread)
        self._threads = {}


def describe_lateness(seen):
    """What the witness saw, in words."""
    if not seen["wakeups"]:
        return "lateness of this machine unknown"
    return (f"this machine was more than {LATE_S * 1000:.0f} ms late {seen['late']} times, {seen['longest_ms']:.0f} ms at most; "
            f"{100 * seen['stolen']:.1f} % of its CPU time went to its host")  # fmt: skip


def cpu_times(text):
    """(stolen, all) CPU time in ticks, of the text of /proc/stat."""
    times = [int(word) for word in text.split("\n", 1)[0].split()[1:9]]  # guests' time, the ninth, is in the first
    return (times[7] if len(times) > 7 else 0), sum(times)


def _read_cpu_times():
    try:
        with open("/proc/stat") as stat:
            return cpu_times(stat.read())
    except (OSError, ValueError):
        return 0, 0


def watch(sleep, now=time.monotonic, read=_read_cpu_times, waited=lambda: 0.0):
    """Has sleep() sleep for PERIOD_S again and again until it returns True. What it sees has the form of Lateness.end().
    waited(): for how many s it has waited so far for a CPU that another thread had; this does not count as late."""
    wakeups, late, longest_s, late_at = 0, 0, 0.0, []

    def note(begin_s, end_s):
        begin, end = int(begin_s * 1e9), int(end_s * 1e9)
        if late_at and begin <= late_at[-1][1]:
            late_at[-1] = [min(begin, late_at[-1][0]), max(end, late_at[-1][1])]
        elif len(late_at) < MOST_LATE:
            late_at.append([begin, end])

    at_first = seen = read()
    asleep = looked = now()
    since_looked_s, waited_s = 0.0, waited()
    while not sleep():
        awake = now()
        before, waited_s = waited_s, waited()
        over_s = awake - asleep - PERIOD_S - (waited_s - before)
        wakeups += 1
        longest_s = max(longest_s, over_s)
        since_looked_s += over_s
        if over_s > LATE_S:
            late += 1
            note(asleep, awake)
        if awake - looked >= LOOK_S:
            before, seen = seen, read()
            if since_looked_s > LATE_S or (seen[0] - before[0]) * TICK_S >= LATE_S:
                note(looked, awake)
            looked, since_looked_s = awake, 0.0
        asleep = awake
    stolen, total = (b - a for a, b in zip(at_first, read()))
    return {"wakeups": wakeups, "late": late, "longest_ms": round(1000 * longest_s, 1), "stolen": round(stolen / max(1, total), 4), "late_at": late_at}


def merged(seen):
    """What witnesses on several CPUs saw at the same time, as one."""
    late_at = []
    for begin, end in sorted(interval for one in seen for interval in one["late_at"]):
        if late_at and begin <= late_at[-1][1]:
            late_at[-1][1] = max(end, late_at[-1][1])
        else:
            late_at.append([begin, end])
    return {"wakeups": sum(one["wakeups"] for one in seen), "late": max(one["late"] for one in seen),
            "longest_ms": max(one["longest_ms"] for one in seen), "stolen": max(one["stolen"] for one in seen), "late_at": late_at}  # fmt: skip


def watch_on(cpu, sleep):
    """watch() on one CPU; None where that is not possible, or where the kernel does not tell what a thread waited."""
    try:
        with open(f"/proc/self/task/{threading.get_native_id()}/schedstat", "rb", buffering=0) as file:
            waited = lambda: int(os.pread(file.fileno(), 96, 0).split()[1]) / 1e9  # noqa: E731
            waited()
            os.sched_setaffinity(0, {cpu})  # of this thread
            return watch(sleep, read=lambda: (0, 0), waited=waited)
    except (OSError, ValueError, IndexError):
        return None


def watch_all(sleep):
    """watch() in this thread, and in one for each CPU."""
    seen = []
    threads = [threading.Thread(target=lambda cpu=cpu: seen.append(watch_on(cpu, sleep))) for cpu in sorted(os.sched_getaffinity(0))[:MOST_CPUS]]
    for thread in threads:
        thread.start()
    own = watch(sleep)
    for thread in threads:
        thread.join()
    return merged([own, *filter(None, seen)])


def name_of(words, var):
    """What a process of the suite in VAR is called, by its command line: its node, or its program; None for any other."""
    program = os.path.basename(words[0]) if words else ""
    if program.startswith("python") or not any(word == var or word.startswith(f"{var}/") for word in words):
        return None
    return words[words.index("--name") + 1] if "--name" in words[:-1] else program


def watch_waiting(var, sleep, now=time.monotonic_ns):
    """Reads again and again until sleep(WAIT_LOOK_S) is true. What it sees has the form of Waiting.end()."""
    seen, processes, listed_at = {}, {}, None
    while True:
        at = now()
        if listed_at is None or at - listed_at >= 1_000_000_000:
            listed_at = at
            for pid in filter(str.isdigit, os.listdir("/proc")):
                if pid in processes:
                    continue
                with contextlib.suppress(OSError), open(f"/proc/{pid}/cmdline", "rb") as file:
                    if name := name_of(file.read().decode(errors="replace").split("\0"), var):
                        processes[pid] = name, ProcessWait(pid)
        for pid, (name, process) in list(processes.items()):
            before = process._read_at or at
            waited = process.read(at)
            if waited is None:
                process.close()
                del processes[pid]
                continue
            told = seen.setdefault(name, {"waited_s": 0.0, "waits": []})
            told["waited_s"] += waited / 1e9
            if waited >= LEAST_WAIT_NS and len(told["waits"]) < MOST_LATE:
                told["waits"].append([min(before, at - waited), at, waited])
        if sleep(WAIT_LOOK_S):
            return seen


if __name__ == "__main__":
    # Until the asking process writes, closes or is gone.
    is_asked = lambda seconds: bool(select.select([sys.stdin], [], [], seconds)[0])  # noqa: E731
    if sys.argv[1:2] == ["--waiting"]:
        print(json.dumps(watch_waiting(sys.argv[2], is_asked)), flush=True)
    else:
        print(json.dumps(watch_all(lambda: is_asked(PERIOD_S))), flush=True)
