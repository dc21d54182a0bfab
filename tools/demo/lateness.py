"""Whether this machine had time for the suite: a witness that sleeps, and sees how much too late it wakes.

A process of its own, so that nothing the asking program does can delay it. It sees what a hypervisor or the kernel takes from
everybody; not that others are busy as well, for who sleeps much goes first. Standard library only.
"""

import json
import select
import subprocess
import sys
import time

PERIOD_S = 0.005
LATE_S = 0.020  # what the nodes allow a callback; a peripheral has 25 ms for its answer
STOLEN = 0.02  # of the CPU time: what a hypervisor may take without being noticed
LOOK_S = 0.1  # how often the witness asks what was stolen
TICK_S = 0.01  # unit of /proc/stat (USER_HZ)
MOST_LATE = 100_000  # intervals it notes, hours of a bad host; later ones are counted only


class Lateness:
    """The witness, from its construction on. One that dies has seen nothing."""

    def __init__(self):
        # Its own session: it is not interrupted at the terminal with the one who asks, whose end ends it.
        self._process = subprocess.Popen([sys.executable, "-B", "-S", __file__], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True,
                                         start_new_session=True)  # fmt: skip
        self._seen = None

    def end(self):
        """{wakeups, late, longest_ms, stolen, late_at}: how often it woke, how often more than LATE_S too late, how late at most; which part
        of the CPU time the hypervisor took; [begin, end] of CLOCK_MONOTONIC in ns where it woke that late, in one or in several goes within
        LOOK_S, or where as much of a CPU was taken."""
        if self._seen is None:
            try:
                self._seen = json.loads(self._process.communicate(timeout=10)[0])
            except (subprocess.TimeoutExpired, OSError, ValueError):
                self._process.kill()
                self._process.communicate()
                self._seen = {"wakeups": 0, "late": 0, "longest_ms": 0.0, "stolen": 0.0, "late_at": []}
        return self._seen

    def __enter__(self):
        return self

    def __exit__(self, kind, value, traceback):
        self.end()


def had_time(seen):
    """Whether what the witness saw is a machine that suits real time."""
    return seen["late"] == 0 and seen["stolen"] <= STOLEN


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


def watch(sleep, now=time.monotonic, read=_read_cpu_times):
    """Has sleep() sleep for PERIOD_S again and again until it returns True. What it sees is as Lateness.end() tells it."""
    wakeups, late, longest_s, late_at = 0, 0, 0.0, []

    def note(begin_s, end_s):
        begin, end = int(begin_s * 1e9), int(end_s * 1e9)
        if late_at and begin <= late_at[-1][1]:
            late_at[-1] = [min(begin, late_at[-1][0]), max(end, late_at[-1][1])]
        elif len(late_at) < MOST_LATE:
            late_at.append([begin, end])

    at_first = seen = read()
    asleep = looked = now()
    since_looked_s = 0.0
    while not sleep():
        awake = now()
        over_s = awake - asleep - PERIOD_S
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


if __name__ == "__main__":
    # Until the one who asked writes, closes or is gone.
    print(json.dumps(watch(lambda: bool(select.select([sys.stdin], [], [], PERIOD_S)[0]))), flush=True)
