# SPDX-FileCopyrightText: 2026 SRFS contributors
# SPDX-License-Identifier: Apache-2.0
"""What the experiments share. Times are CLOCK_MONOTONIC in ns."""

from srfs.flight.deployments import PAYLOADS
from srfs.report import all_ok, save, write_csv

FIRST, SECOND, THIRD = PAYLOADS  # the paper's payload1, 2, 3
RING = (FIRST, THIRD, SECOND)  # each checks the next


class Experiment:
    """One run: run(), then judge(), write_csv() and draw()."""

    TITLES = {}  # name: what it shows
    DEPLOYMENT = None  # None: it needs no flight
    ONLY = ()  # nodes that are started; empty: all
    INSTALLED = False  # whether something is compiled on board, which needs the installed headers and libraries
    COLUMNS = ()  # of the CSV

    def __init__(self, name, flight, signals, say):
        self.name, self.flight, self.signals, self.say = name, flight, signals, say
        self.step_deadline_s = 60

    @staticmethod
    def varied(deployment, folder):
        """The deployment that is flown instead of this one."""
        return deployment

    def wait_until(self, condition, what, deadline_s=None):
        return self.signals.wait_until(condition, deadline_s or self.step_deadline_s, what)

    def seconds(self, t):
        """Since the begin of the recording."""
        return (t - self.begin) / 1e9

    def summary(self, checks, **fields):
        deployment = {"deployment": self.flight.deployment.stem} if self.flight else {}
        return {"experiment": self.name, "title": self.TITLES[self.name], **deployment, **fields, "checks": checks, "ok": all_ok(checks)}

    def write_csv(self, path):
        write_csv(path, self.COLUMNS, self.rows())

    def save(self, figure, folder, dpi=130, **options):
        save(figure, folder, self.name, dpi, **options)


class StatesExperiment(Experiment):
    """One whose drawing shows the state of each payload over time, from `begin` to `end`."""

    COLUMNS = ("payload", "state", "begin_s", "end_s")

    def states(self):
        """[(payload, state, begin, end)], as the payloads said themselves."""
        return [(i.payload, i.state, i.begin, i.end) for i in self.line.intervals(self.begin, self.end)]

    def rows(self):
        return [(payload, state, f"{self.seconds(begin):.6f}", f"{self.seconds(end):.6f}") for payload, state, begin, end in self.states()]

    def draw_states(self, axis, number, payload, names, labels, **style):
        """One panel, of the payload with this number (from 1); names: all states, the lowest in the drawing first."""
        own = [(state, begin) for who, state, begin, _ in self.states() if who == payload]
        levels = [names.index(state) for state, _ in own]
        axis.step([self.seconds(begin) for _, begin in own] + [self.seconds(self.end)], levels + levels[-1:], where="post", color=f"C{number - 1}", **style)
        axis.set_yticks(range(len(names)), labels, fontsize=8)
        axis.set_ylim(-0.3, len(names) - 0.3)
        axis.set_title(f"payload{number} ({payload})", fontsize=9, loc="left")
