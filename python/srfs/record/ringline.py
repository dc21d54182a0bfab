# SPDX-FileCopyrightText: 2026 SRFS contributors
# SPDX-License-Identifier: Apache-2.0
"""What the members of the liveness ring reported of each other, as `srfs record` heard it. Pure. Times: CLOCK_MONOTONIC in ns."""

from srfs.report import percentile

ACTIVE = 3  # lifecycle_msgs/State
DOWN, UP, WAITING = STATES = ("off", "active", "no answer\nfrom downstream")


class RingLine:
    """Collects liveness reports; on_message may run in another thread than what asks."""

    def __init__(self):
        self.reports = []

    def on_message(self, m):
        if m["type"] == "liveness":
            self.reports.append(m)

    def of(self, since=0, until=None, **fields):
        """The reports made from `since` to `until` with these fields, in order of time."""
        found = [m for m in list(self.reports) if m["said_ns"] >= since and (until is None or m["said_ns"] < until)
                 and all(m.get(name) == value for name, value in fields.items())]  # fmt: skip
        return sorted(found, key=lambda m: m["said_ns"])

    def alive(self, observer, subject, since, until=None, renewed=False):
        """The first answer of an Active subject; renewed: after an outcome of a restart by this observer."""
        if renewed:
            outcome = self.of(since, until, observer=observer, subject=subject, verdict="outcome")
            if not outcome:
                return None
            since = outcome[0]["said_ns"]
        answers = self.of(since, until, observer=observer, subject=subject, verdict="alive", lifecycle_state=ACTIVE)
        return answers[0] if answers else None

    def restarts_by_others(self, ring, since):
        """Restarts whose observer is not the one before the subject in the ring."""
        upstream = {subject: observer for observer, subject in zip(ring, [*ring[1:], ring[0]])}
        return [m for m in self.of(since, verdict="outcome", outcome="restarted") if upstream.get(m["subject"]) != m["observer"]]

    def period_ms(self, observer, subject):
        """Median distance of two answers; None with fewer than two."""
        times = [m["said_ns"] for m in self.of(observer=observer, subject=subject, verdict="alive")]
        distance = percentile([b - a for a, b in zip(times, times[1:])], 0.5)
        return distance and round(distance / 1e6, 1)


def step(line, observer, subject, failed, since, until):
    """How `observer` raised `subject` between the two times: accusation, outcome, Active."""
    accused = line.of(since, until, observer=observer, subject=subject, verdict="accused")
    outcomes = line.of(since, until, observer=observer, subject=subject, verdict="outcome")
    active = line.alive(observer, subject, since, until, renewed=True)
    return {
        "observer": observer,
        "subject": subject,
        "failed_ns": failed,
        "accused_ns": accused[0]["said_ns"] if accused else None,
        "accused_misses": accused[0]["misses"] if accused else 0,
        "fault": accused[0].get("fault") if accused else None,
        "outcome": outcomes[0].get("outcome") if outcomes else None,
        "outcome_ns": outcomes[0]["said_ns"] if outcomes else None,
        "active_ns": active["said_ns"] if active else None,
    }


def states(line, processes, payloads, begin, end):
    """[(payload, state, begin, end)]: off without a process; waiting from its first miss of a check until an answer; else active.

    processes [(when, payload, pid or None)]
    """
    found = []
    for payload in payloads:
        happened = [(at, "start" if pid else "end") for at, who, pid in processes if who == payload]
        happened += [(m["said_ns"], m["verdict"]) for m in line.of(observer=payload) if m["verdict"] in ("miss", "alive")]
        at, state = begin, DOWN
        for when, what in sorted(happened):
            if state == DOWN and what != "start":
                continue  # its last words, heard late
            new = {"start": UP, "end": DOWN, "miss": WAITING, "alive": UP}[what]
            when = min(max(when, begin), end)
            if new != state and when > at:
                found.append((payload, state, at, when))
                at = when
            state = new
        found.append((payload, state, at, end))
    return found
