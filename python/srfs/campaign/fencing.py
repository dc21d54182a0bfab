# SPDX-FileCopyrightText: 2026 SRFS contributors
# SPDX-License-Identifier: Apache-2.0
"""The fencing campaign: stops and kills the real processes at random points of their slots, under a steady stream of telecommands.

witness.py judges the recording afterwards.
"""

import contextlib
import heapq
import json
import os
import select
import signal
import threading
import time

from srfs.campaign import witness
from srfs.campaign.campaign import Campaign
from srfs.flight.deployments import PAYLOADS
from srfs.flight.lateness import Excuses, Lateness, Waiting, describe_lateness
from srfs.flight.processes import wait_until
from srfs.program import MissionError
from srfs.report import check_none, pyplot, save, write_csv

SWITCHER = "can_switcher"
RESETS = 1 / 21  # share of telecommands that reset the peripheral: at_most_once

# (class, share). A stopped process continues after a random time, unless it was killed for being stopped.
FAULTS = (
    ("stop the holder", 10),
    ("stop a waiting payload", 4),
    ("stop the switcher", 4),
    ("kill the holder", 3),
    ("kill a payload", 2),
    ("kill the switcher", 2),
    ("stop the holder, kill the switcher", 2),
)
STOP_S = ((0.0002, 0.005), (0.005, 0.03), (0.03, 0.08), (0.08, 0.4))  # from an instant to several leases
FAULT_PERIOD_S = (0.1, 0.9)
UP_DEADLINE_S = 10
UP_MOST_S = 10 * UP_DEADLINE_S + 30  # time in which a start waits for a CPU does not count against its deadline
GROUND_PATIENCE_S = 60  # ttc tells each end at the latest 40 s after the acceptance: 10 s to its expiry, 30 s of grace
SETTLE_S = 90  # time for the telecommands under way to end after the last fault
BOUND_S = 15  # limit of each recovery; the summary lists the measured times


class Fencing(Campaign):
    def __init__(self, flight, signals, slots, seed, say):
        super().__init__(flight, signals, seed, say)
        self.wanted = slots
        self.faults = []
        self._grants = set()
        self._holder = None  # (payload, time of the flag)
        self._flag = threading.Condition()
        self._stopped = []  # heap of (time to continue, n, pidfd)
        self._n = 0
        self._quit = threading.Event()
        self._start_failed = None
        self._restarts = 0

    def on_record(self, message):
        super().on_record(message)
        if message["type"] == "flags" and message["holder"]:
            with self._flag:
                self._grants.add((message["switcher"], message["grant"]))
                self._holder = message["holder"]
                self._flag.notify_all()

    def telecommand(self, payload):
        resets = self.random.random() < RESETS
        text = f"{payload.removeprefix('payload_')}.reset_peripheral" if resets else super().telecommand(payload)
        return f"{text} --timeout {GROUND_PATIENCE_S}"

    # --- processes --------------------------------------------------------------------------------------------------

    def _open(self, node):
        """A descriptor of the node's current process, which never refers to a later process; None: the node does not run."""
        pid = self.flight.node_pid(node)
        if pid is None:
            return None
        try:
            handle = os.pidfd_open(pid)
        except ProcessLookupError:
            return None
        if self.flight.node_pid(node) != pid:
            os.close(handle)
            return None
        return handle

    def _stop(self, node, seconds):
        """Stops the node for so many seconds. @return False if it does not run"""
        handle = self._open(node)
        if handle is None:
            return False
        with contextlib.suppress(ProcessLookupError):
            signal.pidfd_send_signal(handle, signal.SIGSTOP)
        self._n += 1
        heapq.heappush(self._stopped, (time.monotonic() + seconds, self._n, handle))
        return True

    def _go_on(self, everybody=False):
        while self._stopped and (everybody or self._stopped[0][0] <= time.monotonic()):
            handle = heapq.heappop(self._stopped)[2]
            with contextlib.suppress(ProcessLookupError):
                signal.pidfd_send_signal(handle, signal.SIGCONT)
            os.close(handle)

    def _kill(self, node):
        handle = self._open(node)
        if handle is None:
            return False
        with contextlib.suppress(ProcessLookupError):
            signal.pidfd_send_signal(handle, signal.SIGKILL)
        select.select([handle], [], [], 2)
        os.close(handle)
        return True

    def _keep_started(self):
        try:
            self._start_what_is_missing()
        except Exception as error:  # _check_starts() tells
            self._start_failed = error

    def _check_starts(self):
        if self._start_failed:
            raise MissionError(f"nodes could not be started: {self._start_failed}")

    def _start_what_is_missing(self):
        """Starts missing nodes until the campaign ends. The deployment has no ring, so only the switcher's work is measured."""
        nodes = (SWITCHER, *PAYLOADS)
        while not self._quit.wait(0.02):
            if all(self.flight.node_pid(node) for node in nodes):
                continue
            self._restarts += 1
            self.flight.srfs("up", "--deadline", str(UP_DEADLINE_S), timeout_s=UP_MOST_S)

    # --- faults -----------------------------------------------------------------------------------------------------

    def _wait_for_holder(self):
        """Waits for the next flag and then for a random point of that slot. Returns the holder; None: no flag came."""
        with self._flag:
            self._holder = None
        deadline = time.monotonic() + 3
        while not self._holder:
            if time.monotonic() > deadline:
                return None
            self._go_on()  # there is no flag while the switcher is stopped
            with self._flag:
                self._flag.wait_for(lambda: self._holder, timeout=0.005)
        holder = self._holder
        self._sleep(self.random.uniform(0, 0.02) if self.random.random() < 0.8 else self.random.uniform(0, 0.07))
        return holder

    def _sleep(self, seconds):
        """Like time.sleep(), but meanwhile continues stopped processes when their time has come."""
        end = time.monotonic() + seconds
        while True:
            self._go_on()
            until = min(end, self._stopped[0][0]) if self._stopped else end
            left = until - time.monotonic()
            if left > 0:
                time.sleep(left)
            if time.monotonic() >= end:
                return

    def _fault(self):
        kind = self.random.choices([k for k, _ in FAULTS], [share for _, share in FAULTS])[0]
        seconds = self.random.uniform(*self.random.choice(STOP_S))
        if "holder" in kind:
            victim = self._wait_for_holder()
        elif "switcher" in kind:
            self._wait_for_holder()
            victim = SWITCHER
        else:
            holder = self._wait_for_holder()
            victim = self.random.choice([p for p in PAYLOADS if p != holder or kind == "kill a payload"])
        if victim is None:
            return
        begin = time.monotonic_ns()
        if kind.startswith("kill"):
            if self._kill(victim):
                self.faults.append(witness.Fault(kind, victim, begin, begin))
            return
        if not self._stop(victim, seconds):
            return
        self.faults.append(witness.Fault(kind, victim, begin, begin + int(seconds * 1e9)))
        if kind == "stop the holder, kill the switcher":
            self._sleep(self.random.uniform(0, 0.03))
            self._kill(SWITCHER)

    # --- the run ----------------------------------------------------------------------------------------------------

    def run(self):
        self.listen()
        starter = threading.Thread(target=self._keep_started, daemon=True)
        starter.start()
        self.begin = time.monotonic_ns()
        try:
            with Lateness() as machine, Waiting(self.flight.var) as waiting:
                self._disturb()
                self._go_on(everybody=True)
                self._settle()
        finally:
            self._go_on(everybody=True)
            self._quit.set()
            starter.join(UP_MOST_S + 10)
        self.machine = machine.end()
        self.waiting = waiting.end()
        self._check_starts()
        self.executions.ask()
        self.lines = self.flight.can_log(until_ns=time.monotonic_ns(), deadline_s=5)

    def _disturb(self):
        shown = asked = 0.0
        begin = time.monotonic()
        while len(self._grants) < self.wanted:
            self.signals.check()
            if self.flight.hw_sim.poll() is not None:
                raise MissionError("the simulated spacecraft is gone")
            self._check_starts()
            now = time.monotonic()
            if now - asked > 1:
                asked = now
                self.executions.ask()
            if now - shown > 5:
                shown = now
                self.say(f"{len(self._grants)} of {self.wanted} slots, {len(self.faults)} faults, {self._restarts} restarts, "
                         f"{len(self.executions)} telecommands executed, {now - begin:.0f} s")  # fmt: skip
            for payload in PAYLOADS:
                self.send_telecommand(payload)
            self._fault()
            self._sleep(self.random.uniform(*FAULT_PERIOD_S))

    def _settle(self):
        """Waits until the switcher and all payloads run, every payload has used a slot, and every telecommand has its end."""
        self.say("no more faults; waiting for what is under way")

        def done():
            self._go_on()
            up = all(self.flight.node_pid(node) for node in (SWITCHER, *PAYLOADS))
            used = {slot[2] for slot in witness.used_slots(recent, witness.grants_of(recent))} if (recent := self.messages[settled:]) else set()
            return self.signals.asked or (up and used == set(PAYLOADS) and self.all_ended())

        settled = len(self.messages)
        with contextlib.suppress(MissionError):  # the verdict reports what is missing
            wait_until(done, SETTLE_S, "everything ended", period_s=0.5)

    # --- files ------------------------------------------------------------------------------------------------------

    def judge(self):
        excuses = Excuses(self.machine, self.waiting)
        verdict, found = witness.judge(self.lines, self.messages, self.executions.of, self.faults, int(BOUND_S * 1e9), self.machine["late_at"],
                                       lambda payload, begin, end: excuses.find(("hw_sim", SWITCHER, payload), begin, end))  # fmt: skip
        if self.executions.unseen:
            verdict["checks"].append(check_none([f"{self.executions.unseen} executions"], "every execution was seen"))
            verdict["ok"] = False
        verdict["recorded_s"] = round((time.monotonic_ns() - self.begin) / 1e9, 1)
        verdict["restarts"] = self._restarts
        verdict["machine"] = describe_lateness(self.machine)
        return verdict, found

    def write(self, folder, found):
        """Writes the input of the verdict, for inspection and for judging it again."""
        (folder / "can.log").write_text("\n".join(self.lines) + "\n")
        (folder / "executed.json").write_text(json.dumps(self.executions.of) + "\n")
        (folder / "late.json").write_text(json.dumps({"late_at": self.machine["late_at"], "waiting": self.waiting}) + "\n")
        self.write_record(folder)
        ms = lambda ns: "" if ns is None else f"{ns / 1e6:.3f}"  # noqa: E731
        write_csv(folder / "faults.csv", ["kind", "victim", "begin_ns", "stopped_ms", "bus_gap_ms", "victim_gap_ms"],
                  [[r.fault.kind, r.fault.victim, r.fault.begin, ms(r.fault.end - r.fault.begin), ms(r.bus_gap), ms(r.victim_gap)] for r in found])  # fmt: skip


def draw(folder, found):
    """Plots the distribution of the recovery gaps, one line per class of fault."""
    figure, axes = pyplot().subplots(1, 2, figsize=(12, 5), sharey=True)
    parts = (("bus_gap", "fault to the end of the next used slot"), ("victim_gap", "victim runs again to its next used slot"))
    for axis, (part, title) in zip(axes, parts):
        for number, kind in enumerate(sorted({r.fault.kind for r in found})):
            gaps = sorted(getattr(r, part) / 1e6 for r in found if r.fault.kind == kind and getattr(r, part) is not None)
            if gaps:
                axis.step(gaps, [(k + 1) / len(gaps) for k in range(len(gaps))], where="post", color=f"C{number}", label=f"{kind} ({len(gaps)})")
        axis.set_xscale("log")
        axis.set_xlabel("ms")
        axis.set_title(title, fontsize=10)
        axis.grid(alpha=0.3)
    axes[0].set_ylabel("share of the faults")
    axes[0].legend(fontsize=8, loc="upper left")
    figure.suptitle("Fencing campaign: recovery after processes were stopped and killed")
    save(figure, folder, "recovery", 120)
