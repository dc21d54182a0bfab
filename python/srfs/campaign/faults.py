# SPDX-FileCopyrightText: 2026 SRFS contributors
# SPDX-License-Identifier: Apache-2.0
"""The fault campaign: injects every class of failure into every node of a running mission under telecommands, and judges how the ring recovers.

The campaign restarts no node itself; the suite does. The processes carry no test code. Faults that a signal cannot cause are injected by
fault_injector.cpp, which a wrapper script preloads into each program.
"""

import collections
import contextlib
import ctypes
import dataclasses
import math
import os
import pathlib
import platform
import select
import shutil
import signal
import statistics
import threading
import time

from srfs.campaign import witness
from srfs.campaign.campaign import Campaign
from srfs.flight import deployments
from srfs.flight.deployments import NODES, PAYLOADS
from srfs.flight.lateness import Excuses, Lateness, Waiting, describe_lateness
from srfs.flight.machine import stress_ng
from srfs.flight.processes import kib_of, send_signal, wait_until
from srfs.program import MissionError
from srfs.report import all_ok, check_none, pyplot, quantiles, save, show_checks, write_csv

STEADY_DEADLINE_S = 60
OBSERVE_S = 0.5  # after the recovery; any other node with a new process by then is a false restart
SETTLE_S = 60
ACTIVE = 3  # lifecycle_msgs/State
SUBSETS = 2 ** len(NODES) - 2  # of the nine nodes, without the empty and the full set

# Commands of fault_injector.cpp.
ABORT, SEGFAULT, LOOP, DEADLOCK, LATE, DEAF, STALE_NONCE, WRONG_INCARNATION, WRONG_STATE, GROW, DESCRIPTORS, CLOCK_STEP, IDLE, HOG = range(1, 15)
HEALTHY = 0


@dataclasses.dataclass(frozen=True)
class FaultClass:
    name: str
    what: str
    expected: str  # "restart": a new process is Active again; "none": no node is restarted; "mended": Active again after the cause is gone
    p50_s: float | None = None  # goals for the time from the fault to Active again
    max_s: float | None = None
    bound_s: float = 30  # a later recovery fails the campaign, whatever the goal
    found_as: tuple = ()  # faults that the ring may report; empty: any


EXIT, HANG = (0.3, 0.8), (0.7, 1.2)
CLASSES = (
    FaultClass("exit", "asked to end by somebody (SIGTERM)", "restart", *EXIT),
    FaultClass("abort", "SIGABRT", "restart", *EXIT),
    FaultClass("segfault", "SIGSEGV", "restart", *EXIT),
    FaultClass("kill", "SIGKILL", "restart", *EXIT),
    FaultClass("stop", "SIGSTOP", "restart", *HANG),
    FaultClass("loop", "a callback that does not return, and burns a CPU", "restart", *HANG),
    FaultClass("deadlock", "a callback that does not return, and waits", "restart", *HANG),
    FaultClass("late", "every turn of the work thread 0.5 s late: answers late", "restart"),
    FaultClass("deaf", "receives nothing from the network any more", "restart"),
    FaultClass("stale_nonce", "its answers name another question", "restart"),
    FaultClass("wrong_incarnation", "its answers name another incarnation", "restart"),
    FaultClass("wrong_state", "its answers name a state that there is not", "restart"),
    FaultClass("worker", "a worker thread that does not come back", "restart", bound_s=12, found_as=("worker frozen",)),
    # The switcher may fence a payload that holds the bus first.
    FaultClass("idle", "answers in Active; its input stays where it is, its timers do nothing", "restart", bound_s=12, found_as=("not working", "exited")),
    FaultClass("memory", "grows by 64 MiB a second", "restart"),
    FaultClass("descriptors", "uses all file descriptors", "restart"),
    FaultClass("start_hang", "killed; its successors hang while they start, until the cause is gone", "mended", bound_s=120),
    FaultClass("crash_loop", "killed; its successors end at once, until the cause is gone", "mended", bound_s=120),
    FaultClass("no_binary", "killed; its program is missing, until it is put back", "mended", bound_s=120),
    FaultClass("bad_binary", "killed; its program is damaged, until it is put back", "mended", bound_s=120),
    # SIGSEGV in the probation of a version: the last good version becomes Active.
    FaultClass("bad_version", "a new version crashes in its probation; the last good one comes back", "restart", 1.0, 1.0),
    FaultClass("clock_forward", "its clock of the day goes three hours ahead and back", "none"),
    FaultClass("clock_back", "its clock of the day goes three hours back and ahead", "none"),
)
# The switcher may fence a payload that holds the bus first. A process whose threads keep its own work thread from the CPU is silent, too.
HOG_CLASS = FaultClass("hog", "eight threads that burn the CPUs", "restart", 5.0, 5.0, bound_s=60,
                       found_as=("taking the CPUs", "silent", "exited", "absent"))  # fmt: skip
# The worker thread to freeze: one that gets work every second. A restarter gets an empty job.
WORKERS = {"ttc": "ttc_store", **dict.fromkeys(PAYLOADS, "store"), **dict.fromkeys(("timing", "can_switcher", *NODES[6:]), "ring")}
WITHOUT_DUE_WORK = NODES[6:]
KINDS = {"subset": "several nodes killed at once", "everybody": "all nine killed at once", "soak": "nothing but load",
         "overload": "more load than CPUs for a while", "suite_stopped": "the whole suite stopped for 0.05 to 3 s and continued", "steady": "between two faults"}  # fmt: skip
WINDOW_S = 1.5  # length of the ring's death history
NODE_PRIORITY, DEVICE_PRIORITY = 40, 50  # SCHED_FIFO
LOAD = "--cpu 4 --io 2"
START_FAULT_S = 4  # how long the cause of a fault at start persists

COMMAND_PERIOD_S = 0.25
DELIVERY_NS = 500_000_000  # allowance for delivery from a topic to the campaign, on a busy machine
GROUND_PATIENCE_S = 40  # a ttc that cannot start for some seconds reports the outcomes once it runs


class _SigInfo(ctypes.Structure):
    _fields_ = (("number", ctypes.c_int), ("errno", ctypes.c_int), ("code", ctypes.c_int), ("pad", ctypes.c_int), ("pid", ctypes.c_int),
                ("uid", ctypes.c_uint), ("value", ctypes.c_uint64), ("rest", ctypes.c_char * 96))  # fmt: skip


def queue_to_thread(pid, tid, command, argument=0):
    """Sends one command to the injector in one thread of a process."""
    info = _SigInfo(number=signal.SIGRTMIN + 7, code=-1, pid=os.getpid(), uid=os.getuid(), value=command | (argument & 0xFFFFFFFF) << 32)
    number = {"x86_64": 297, "aarch64": 240}[platform.machine()]  # rt_tgsigqueueinfo
    if ctypes.CDLL(None, use_errno=True).syscall(number, pid, tid, info.number, ctypes.byref(info)) != 0:
        raise OSError(ctypes.get_errno(), os.strerror(ctypes.get_errno()))


def threads(pid):
    """{name: tid} of a process's threads, except the first."""
    found = {}
    for task in pathlib.Path(f"/proc/{pid}/task").iterdir():
        with contextlib.suppress(OSError):
            if task.name != str(pid):
                found[(task / "comm").read_text().strip()] = int(task.name)
    return found


class Wrappers:
    """Wrapper scripts in place of the nodes' programs: each preloads the injector, and can be damaged, removed and restored."""

    def __init__(self, folder, bin_dir, injector):
        self.folder = folder
        self.bin_dir = bin_dir
        self.injector = injector
        self.folder.mkdir(parents=True, exist_ok=True)
        for node in NODES:
            self.mend(node)

    def path(self, node):
        return self.folder / f"{node}_node"

    def mend(self, node, at_start=""):
        text = ("#!/bin/sh\n"
                f"export LD_PRELOAD={self.injector} SRFS_FAULT_AT_START={at_start}\n"
                f'exec {self.bin_dir / (node + "_node")} "$@"\n')  # fmt: skip
        self._replace(node, text)

    def damage(self, node):
        self._replace(node, "\x7fELF\x02\x01 not any more\n")

    def remove(self, node):
        self.path(node).unlink()

    def _replace(self, node, text):
        new = self.folder / f"{node}.new"
        new.write_text(text)
        new.chmod(0o755)
        new.rename(self.path(node))

    def deployment(self, base, changed, misses=3, realtime=False, tick_ms=None):
        """Copies a deployment so that its nodes start through the wrappers. The tick period does not change the length of the slots: a holder
        that needs more than one tick blocks the switch to the next holder."""
        deployment = deployments.read(base)
        if "ring" in deployment:
            # Nodes die more often here than in flight. With a short window, the ring's patience is spent only on deaths in quick succession.
            deployment["ring"] |= {"window_ms": round(WINDOW_S * 1000), "misses": misses}
        for node in deployment["nodes"]:
            if node["executable"] in {f"{name}_node" for name in NODES}:
                node["executable"] = str(self.path(node["name"]))
            if tick_ms and node["name"] == "timing":
                node["parameters"]["tick_period_ms"] = tick_ms
            if realtime:
                make_node_realtime(node)
        return deployments.write(deployment, changed)


def make_node_realtime(node):
    """In a deployment. Niceness and background apply to normal threads only; the deployment refuses them together with fifo."""
    node["scheduling"] = {"policy": "fifo", "priority": NODE_PRIORITY, "cpus": node["scheduling"]["cpus"]}


def realtime_deployment(base, changed):
    """Copies a deployment so that its nodes have SCHED_FIFO."""
    deployment = deployments.read(base)
    for node in deployment["nodes"]:
        make_node_realtime(node)
    return deployments.write(deployment, changed)


@dataclasses.dataclass
class Trial:
    """One fault and its outcome; times in ns of CLOCK_MONOTONIC, None: not seen."""

    kind: str
    victims: tuple
    expected: str
    begin: int = 0  # time of the fault; for "mended": when its cause was gone
    accused: int | None = None  # the first accusation of a victim
    process: int | None = None  # all victims have a new process
    active: int | None = None  # all victims are Active again
    found_as: str = ""  # fault named by the first accusation
    false_restarts: tuple = ()
    slots_lost: int = 0
    telemetry_gap_s: float = 0.0
    note: str = ""

    def seconds(self, what):
        value = getattr(self, what)
        return None if value is None else (value - self.begin) / 1e9

    @property
    def ok(self):
        return not self.note and not self.false_restarts and (self.expected == "none" or self.active is not None)


class FaultCampaign(Campaign):
    def __init__(self, flight, wrappers, signals, seed, say, classes=CLASSES, fresh_s=0.4):
        super().__init__(flight, signals, seed, say)
        self.classes = classes
        self.fresh_ns = int(fresh_s * 1e9)  # maximum age of the last answer of a steady node
        self.wrappers = wrappers
        self.trials = []
        self.not_applicable = {}  # class -> {node: why it cannot have this fault}
        self._lock = threading.Lock()
        self._alive = {}  # node -> (incarnation, state, time of the report)
        self._accusations = []  # (time, subject, observer, class)
        self._processes = collections.defaultdict(list)  # node -> [(time first seen, pid)]
        self._telemetry = collections.defaultdict(list)  # application -> times of packets on the ground
        self._sending = threading.Lock()
        self._enough = threading.Event()  # set: send no more telecommands
        self._quit = threading.Event()
        self._threads = []
        self.usage = []
        self.overloads = []  # [(begin, end)] that this campaign made, in ns of CLOCK_MONOTONIC
        self._ticks = 0  # total received
        self.soak_ticks = 0

    # --- watching ---------------------------------------------------------------------------------------------------

    def on_record(self, message):
        if message["type"] == "liveness":
            with self._lock:
                if message["verdict"] == "alive":
                    self._alive[message["subject"]] = (message["subject_incarnation"], message["lifecycle_state"], message["said_ns"])
                elif message["verdict"] == "accused":
                    self._accusations.append((message["said_ns"], message["subject"], message["observer"], message["fault"]))
        elif message["type"] == "tick":
            self._ticks += 1
        super().on_record(message)

    def on_downlink(self, message):
        super().on_downlink(message)
        if message.get("structure") and message.get("vc") == 0:
            self._telemetry[message["structure"]].append(time.monotonic())

    def _watch_processes(self):
        while not self._quit.wait(0.005):
            for node in NODES:
                pid = self.flight.node_pid(node)
                seen = self._processes[node]
                if pid and (not seen or seen[-1][1] != pid):
                    seen.append((time.monotonic_ns(), pid))

    def telecommand(self, payload):
        return f"{super().telecommand(payload)} --timeout {GROUND_PATIENCE_S}"

    def _command(self):
        while not self._quit.wait(COMMAND_PERIOD_S):
            for payload in PAYLOADS:
                with self._sending, contextlib.suppress(MissionError, ValueError):
                    if not self._enough.is_set():
                        self.send_telecommand(payload)
            with contextlib.suppress(OSError):
                self.executions.ask()

    def _pids(self):
        return {node: seen[-1][1] for node, seen in self._processes.items() if seen}

    def _is_steady(self):
        """Whether every node has a process that answered a check in Active within the last fresh_ns."""
        now = time.monotonic_ns()
        with self._lock:
            alive = dict(self._alive)
        return all(self.flight.node_pid(node) and self._processes[node] for node in NODES) and all(
            node in alive and alive[node][1] == ACTIVE and now - alive[node][2] < self.fresh_ns for node in NODES)  # fmt: skip

    def wait_until_steady(self, deadline_s=STEADY_DEADLINE_S):
        self.signals.wait_until(self._is_steady, deadline_s, "all nodes Active and answering")

    def _wait_until_forgotten(self, victims):
        """Waits until the suite is steady and the deaths of these nodes have left the ring's window."""
        last = max((self._processes[node][-1][0] for node in victims if len(self._processes[node]) > 1), default=0)
        time.sleep(max(0, min(WINDOW_S + 0.5, last / 1e9 + WINDOW_S + 0.2 - time.monotonic())))
        self.wait_until_steady()

    # --- the run ----------------------------------------------------------------------------------------------------

    def __enter__(self):
        self.listen()
        for job in (self._watch_processes, self._command):
            self._threads.append(threading.Thread(target=job, daemon=True))
            self._threads[-1].start()
        self.begin = time.monotonic()
        self._machine, self._waiting = Lateness(), Waiting(self.flight.var)
        self.wait_until_steady()
        return self

    def __exit__(self, kind, value, traceback):
        with self._sending:  # none is on its way to the ground after this
            self._enough.set()
        if kind is None:
            self._settle()
        self._quit.set()
        for thread in self._threads:
            thread.join(10)
        self.machine, self.waiting = self._machine.end(), self._waiting.end()
        if kind is None:
            self.executions.ask()

    def _settle(self):
        with contextlib.suppress(MissionError):  # the verdict reports what is missing
            wait_until(lambda: self.signals.asked or self.all_ended(), SETTLE_S, "every telecommand ended", period_s=0.2)

    # --- faults -----------------------------------------------------------------------------------------------------

    def _inject(self, kind, node, pid):
        """@return a callable that ends the fault; None if there is none"""
        signals = {"exit": signal.SIGTERM, "kill": signal.SIGKILL, "stop": signal.SIGSTOP}
        commands = {"abort": ABORT, "segfault": SEGFAULT, "bad_version": SEGFAULT, "loop": LOOP, "deadlock": DEADLOCK, "deaf": DEAF, "stale_nonce": STALE_NONCE,
                    "wrong_incarnation": WRONG_INCARNATION, "wrong_state": WRONG_STATE, "descriptors": DESCRIPTORS, "idle": IDLE, "hog": HOG}  # fmt: skip
        if kind in signals:
            send_signal(pid, signals[kind])
        elif kind in commands:
            queue_to_thread(pid, pid, commands[kind])
        elif kind == "late":
            queue_to_thread(pid, pid, LATE, 500)
        elif kind == "memory":
            queue_to_thread(pid, pid, GROW, 64)
        elif kind == "worker":
            queue_to_thread(pid, threads(pid)[WORKERS[node]], DEADLOCK)
        elif kind.startswith("clock_"):
            queue_to_thread(pid, pid, CLOCK_STEP, 180 if kind == "clock_forward" else -180)
            return lambda: queue_to_thread(pid, pid, HEALTHY)
        return None

    def _why_not(self, kind, node):
        """Why this node cannot have this fault; empty: it can."""
        if kind == "worker" and WORKERS[node] not in threads(self._pids()[node]):
            return f"no worker thread '{WORKERS[node]}'"
        if kind == "idle" and node in WITHOUT_DUE_WORK:
            return "no work of it is ever due: it does what it is told, by a caller who waits for it"
        return ""

    def _break_start(self, kind, node):
        if kind == "start_hang":
            self.wrappers.mend(node, f"{node}:hang:{self.random.randrange(5, 80)}")
        elif kind == "crash_loop":
            self.wrappers.mend(node, f"{node}:exit")
        elif kind == "no_binary":
            self.wrappers.remove(node)
        else:
            self.wrappers.damage(node)

    def trial(self, fault, node):
        self._wait_until_forgotten([node])
        if why_not := self._why_not(fault.name, node):
            self.not_applicable.setdefault(fault.name, {})[node] = why_not
            return None
        trial = Trial(fault.name, (node,), fault.expected)
        version = self._put_on_probation(node) if fault.name == "bad_version" else None
        before, old = self._pids(), self._incarnations()
        begin = time.monotonic_ns()
        if fault.expected == "mended":
            self._break_start(fault.name, node)
            send_signal(before[node], signal.SIGKILL)
            time.sleep(START_FAULT_S)  # effects on the other nodes in this time are checked below
            self.wrappers.mend(node)
            trial.begin = time.monotonic_ns()
            self._watch(trial, fault, before, old)
        else:
            trial.begin = begin
            end = self._inject(fault.name, node, before[node])
            if fault.expected == "none":
                time.sleep(1.5)
                end()
                time.sleep(1.5)
                trial.false_restarts = self._changed(before)
            else:
                self._watch(trial, fault, before, old)
        if version is not None and not trial.note:
            trial.note = self._judge_rollback(node, version)
        self._finish(trial, begin)
        return trial

    def _put_on_probation(self, node):
        """Puts a version with the same program on probation and waits until the node runs it. Returns the version's number."""
        old = self._incarnations()[node]
        added = self.flight.srfs_json("versions", "add", node, self.wrappers.path(node))
        self.flight.srfs_json("versions", "use", node, added["version"], "--probation", "600")

        def runs():
            with self._lock:
                incarnation, state, _ = self._alive[node]
            return incarnation > old and state == ACTIVE

        self.signals.wait_until(runs, STEADY_DEADLINE_S, f"the new version of {node} Active")
        self.wait_until_steady()
        return added["version"]

    def _judge_rollback(self, node, version):
        """Checks that the node was rolled back after its failed probation. Returns the problem; empty: none."""
        def failed():
            found = self.flight.versions(node)
            return found["running"] == found["active"] == found["last_good"] == 0 and any(
                v["number"] == version and v["state"] == "failed" for v in found["versions"])  # fmt: skip

        try:
            wait_until(failed, 10, "the verdict on disk", period_s=0.2)  # it is written after the restart
        except MissionError as error:
            return f"version {version} was not rolled back: {error}"
        return ""

    def _watch(self, trial, fault, before, old):
        """Waits until all victims have an Active process of a later incarnation, and for OBSERVE_S after that.
        before, old: pids and incarnations from before the fault, so that a process which the ring starts at once counts as new too."""
        deadline = time.monotonic() + fault.bound_s
        while time.monotonic() < deadline and not self.signals.asked:
            if trial.process is None:
                times = [next((at for at, pid in self._processes[node] if at > trial.begin and pid != before[node]), None) for node in trial.victims]
                if None not in times:
                    trial.process = max(times)
            with self._lock:
                alive = {node: self._alive.get(node) for node in trial.victims}
            if all(a and a[0] > old[node] and a[1] == ACTIVE and a[2] > trial.begin for node, a in alive.items()):
                trial.active = max(a[2] for a in alive.values())
                break
            time.sleep(0.002)
        else:
            trial.note = f"not Active again within {fault.bound_s} s"
        time.sleep(OBSERVE_S)
        trial.false_restarts = self._changed(before, trial.victims)

    def failed(self, why):
        """Records that the suite did not become steady before the next fault: a failure of the campaign in its own right."""
        self.trials.append(Trial("steady", (), "none", begin=time.monotonic_ns(), note=why))
        return self.trials[-1]

    def _incarnations(self):
        with self._lock:
            return {node: self._alive[node][0] if node in self._alive else 0 for node in NODES}

    def _changed(self, before, but=()):
        return tuple(node for node, pid in self._pids().items() if node not in but and before.get(node) != pid)

    def _finish(self, trial, begin):
        with self._lock:
            found = [a for a in self._accusations if a[0] >= begin and a[1] in trial.victims]
        if found:
            trial.accused, trial.found_as = found[0][0], found[0][3]
        allowed = next((fault.found_as for fault in self.classes if fault.name == trial.kind), ())
        if trial.active and allowed and trial.found_as not in allowed:
            trial.note = f"found as '{trial.found_as}', expected: {', '.join(allowed)}"
        trial.slots_lost = slots_lost(self.messages, begin, time.monotonic_ns(), trial.victims)
        end = time.monotonic()
        for structure, times in list(self._telemetry.items()):
            if any(structure.startswith(victim) for victim in trial.victims):
                continue
            inside = [t for t in times if t > begin / 1e9 - 3]
            gaps = [b - a for a, b in zip(inside, [*inside[1:], end])]
            usual = statistics.median(b - a for a, b in zip(times, times[1:])) if len(times) > 4 else None
            if usual and gaps:
                trial.telemetry_gap_s = max(trial.telemetry_gap_s, round(max(gaps) - usual, 2))
        self.trials.append(trial)

    def subset(self, victims):
        """Kills all victims at once with SIGKILL."""
        self._wait_until_forgotten(victims)
        kind = FaultClass("subset" if len(victims) < len(NODES) else "everybody", "", "restart", bound_s=60)
        trial = Trial(kind.name, tuple(victims), "restart")
        before, old = self._pids(), self._incarnations()
        handles = [os.pidfd_open(before[node]) for node in victims]
        trial.begin = time.monotonic_ns()
        for number in (signal.SIGSTOP, signal.SIGKILL):  # stopped first; otherwise one could start another before it dies itself
            for handle in handles:
                with contextlib.suppress(ProcessLookupError):
                    signal.pidfd_send_signal(handle, number)
        for handle in handles:
            select.select([handle], [], [], 2)
            os.close(handle)
        self._watch(trial, kind, before, old)
        self._finish(trial, trial.begin)
        return trial

    def stop_everybody(self, seconds):
        """Stops the whole suite for so many seconds and continues it: no node may be restarted."""
        self.wait_until_steady()
        trial = Trial("suite_stopped", NODES, "none")
        before = self._pids()
        trial.begin = time.monotonic_ns()
        for pid in before.values():
            send_signal(pid, signal.SIGSTOP)
        time.sleep(seconds)
        for pid in self.random.sample(list(before.values()), len(before)):
            send_signal(pid, signal.SIGCONT)
        time.sleep(1.0)
        trial.false_restarts = self._changed(before)
        trial.note = ""
        self.trials.append(trial)
        return trial

    def soak(self, seconds, tick_ms):
        """Runs for so many seconds without faults but with load. Measures false restarts, ticks, and the slopes of memory and descriptors."""
        self.wait_until_steady()
        trial = Trial("soak", NODES, "none", begin=time.monotonic_ns())
        before, ticks = self._pids(), self._ticks
        self.usage = []  # (s, {node: (KiB, descriptors)})
        with stress_ng(LOAD) as is_loaded:
            end = time.monotonic() + seconds
            while time.monotonic() < end and not self.signals.asked:
                self.usage.append((time.monotonic(), {node: usage(pid) for node, pid in self._pids().items()}))
                time.sleep(min(10, max(0.1, seconds / 20)))
            trial.note = "" if is_loaded() else "stress-ng ended by itself"
        trial.false_restarts = self._changed(before)
        self.soak_ticks = self._ticks - ticks
        expected = seconds * 1000 / tick_ms
        if self.soak_ticks < 0.99 * expected - 1:
            trial.note = trial.note or f"{self.soak_ticks} ticks where {expected:.0f} were due"
        self.trials.append(trial)


def make_realtime(pid):
    """Sets SCHED_FIFO for every thread of a process; later threads inherit it."""
    try:
        for task in os.listdir(f"/proc/{pid}/task"):
            os.sched_setscheduler(int(task), os.SCHED_FIFO, os.sched_param(DEVICE_PRIORITY))
    except PermissionError:
        raise MissionError("--realtime needs CAP_SYS_NICE: run it as root", code=2) from None


def tick_ms(deployment):
    """The tick period of a deployment file."""
    return deployments.node(deployments.read(deployment), "timing")["parameters"]["tick_period_ms"]


def slope_per_hour(points):
    """[(s, value)] -> slope of a straight line through the last three quarters. In the first quarter, caches and queues fill."""
    later = points[len(points) // 4 :]
    if len(later) < 2:
        return 0.0
    return statistics.linear_regression([at / 3600 for at, _ in later], [value for _, value in later]).slope


def usage(pid):
    """(anonymous memory in KiB, open descriptors) of a process; None: it has ended."""
    memory = kib_of(f"/proc/{pid}/status", "RssAnon")
    with contextlib.suppress(OSError):
        return memory and (memory, len(os.listdir(f"/proc/{pid}/fd")))
    return None


def slots_lost(messages, begin, end, victims):
    """Counts the slots that a fault took from other nodes than its victims, in a period that begins with the fault:

    - grants to others that did not end in a release,
    - ticks without a grant, inferred from the time between two grants, unless a victim holds the bus or issues the grants. The beat may shift
      by half a period when timing restarts; a gap of 1.6 periods or more means a missing slot.
    """
    flags = sorted((m for m in messages if m["type"] == "flags" and m["holder"] and m["published_ns"] <= end), key=lambda m: m["published_ns"])
    released = {(m["switcher"], m["grant"]) for m in messages if m["type"] == "bus" and m["status"] == "released"}
    inside = [m for m in flags if m["published_ns"] >= begin]
    before = flags[: len(flags) - len(inside)]
    grants = {(m["switcher"], m["grant"]): m for m in inside}
    last = max(grants, default=None)  # still running
    lost = sum(1 for key, m in grants.items() if m["holder"] not in victims and key not in released and key != last)
    gaps = gaps_of(before[-200:]) or gaps_of(inside)
    if "can_switcher" in victims or len(gaps) < 3:
        return lost
    usual = statistics.median(gaps)
    # The first gap begins with the last grant before the fault, the last gap ends with the record. Recent grants may still be in transit.
    seen = [*before[-1:], *inside]
    ends = [m["published_ns"] for m in seen[1:]] + [end - DELIVERY_NS]
    return lost + sum(max(0, math.ceil((to - m["published_ns"]) / usual - 0.6) - 1) for m, to in zip(seen, ends) if m["holder"] not in victims)


def gaps_of(flags):
    return [b["published_ns"] - a["published_ns"] for a, b in zip(flags, flags[1:])]


# --- the verdict --------------------------------------------------------------------------------------------------------


def figures(values):
    values = [value for value in values if value is not None]
    return {"count": len(values), **(quantiles(values, "p50 p90 max", digits=3, suffix="_s") if values else {})}


def sort_telecommands(stages, trials):
    """Returns (stages of telecommands whose final stage the ground must receive, number of accepted ones that have none after a death of ttc,
    number that ttc never accepted). The journal of ttc outlives its process: an outcome lost with the process is a failure like any other."""
    by_line = collections.defaultdict(list)
    for m in stages:
        by_line[m["line"]].append(m)
    deaths = [(t.begin, t.active or t.begin) for t in trials if "ttc" in t.victims and t.expected != "none"]
    kept, with_ttc, unheard = [], 0, 0
    for lines in by_line.values():
        names = {m["stage"] for m in lines}
        first, last = lines[0], lines[-1]
        if last["stage"] == "timed_out" and "accepted" not in names:
            unheard += 1  # a BD frame sent while no ttc was running
            continue
        with_ttc += last["stage"] == "timed_out" and any(first["at_ns"] < back and last["at_ns"] > death for death, back in deaths)
        kept += lines
    return kept, with_ttc, unheard


def kinds_of(campaign):
    """The kinds of faults of a campaign, in the order of CLASSES and KINDS; the trials themselves are in random order."""
    seen = {*(trial.kind for trial in campaign.trials), *getattr(campaign, "not_applicable", ())}
    return [name for name in (*(fault.name for fault in campaign.classes), *KINDS) if name in seen]


def summarize(campaign):
    by_name = {fault.name: fault for fault in campaign.classes}
    table = []
    for name in kinds_of(campaign):
        trials = [t for t in campaign.trials if t.kind == name]
        fault = by_name.get(name)
        active = figures([t.seconds("active") for t in trials])
        goal = {"p50_s": fault.p50_s, "max_s": fault.max_s} if fault and fault.max_s else {"max_s": 2.5} if name == "subset" else None
        met = None if goal is None or not active["count"] else active["max_s"] <= goal["max_s"] and active["p50_s"] <= goal.get("p50_s", active["p50_s"])
        table.append({
            "class": name, "what": fault.what if fault else KINDS.get(name, ""), "trials": len(trials), "recovered": sum(t.ok for t in trials),
            "expected": trials[0].expected if trials else "", "not_applicable": campaign.not_applicable.get(name, {}),
            # For "mended", the time counts from the end of the cause, long after the detection.
            "detected": figures([t.seconds("accused") for t in trials if t.expected != "mended"]), "restarted": figures([t.seconds("process") for t in trials]),
            "active": active, "goal": goal, "goal_met": met,
            "false_restarts": sum(len(t.false_restarts) for t in trials), "slots_lost": sum(t.slots_lost for t in trials),
            "telemetry_gap_s": max((t.telemetry_gap_s for t in trials), default=0),
            "found_as": dict(collections.Counter(t.found_as for t in trials if t.found_as)),
        })  # fmt: skip
    soak = len(campaign.usage) > 0  # a long time on a busy machine: some answers come too late
    telecommands = witness.telecommands_of(campaign.messages)
    excuses = Excuses(campaign.machine, campaign.waiting)
    why_late = lambda payload, begin, end: excuses.find(("hw_sim",), begin, end)  # noqa: E731  the peripherals, which are not on board
    others, with_ttc, unheard = sort_telecommands([m for m in campaign.messages if m["type"] == "tc_stage"], campaign.trials)
    judged = [
        *witness.executed_once(telecommands, campaign.executions.of, soak, campaign.machine["late_at"], why_late),
        witness.told_to_the_ground(others, soak, campaign.machine["late_at"], campaign.overloads, why_late),
        check_none([f"{t.kind} {','.join(t.victims)}: {t.note or 'false restarts: ' + ', '.join(t.false_restarts)}" for t in campaign.trials if not t.ok],
                      "every victim recovers, and nobody else is restarted", len(campaign.trials)),
        check_none([f"{campaign.executions.unseen} executions"] if campaign.executions.unseen else [], "every execution was seen"),
    ]  # fmt: skip
    slopes = {}
    if len(campaign.usage) > 1:
        for node in NODES:
            seen = [(at, used[node]) for at, used in campaign.usage if used.get(node)]
            slopes[node] = {"memory_kib_per_hour": round(slope_per_hour([(at, memory) for at, (memory, _) in seen])),
                            "descriptors_per_hour": round(slope_per_hour([(at, descriptors) for at, (_, descriptors) in seen]), 1),
                            "memory_kib": seen[-1][1][0], "descriptors": seen[-1][1][1]}  # fmt: skip
    return {"ok": all_ok(judged), "soak_slopes": slopes, "soak_ticks": campaign.soak_ticks, "checks": judged, "table": table, "recorded_s": round(time.monotonic() - campaign.begin, 1), "machine": describe_lateness(campaign.machine),
            "telecommands": {"sent": len(telecommands), "accepted": sum(t.accepted for t in telecommands.values()),
                             "executed": len(campaign.executions),
                             "not_accepted": unheard, "ends_lost_with_ttc": with_ttc}}  # fmt: skip


def show(summary):
    print(f"  {'class':18} {'ok':>7}  {'detected p50/max':>17}  {'restarted p50/max':>17}  {'Active p50/p90/max':>22}  goal    false  slots    gap  found as")
    pair = lambda f: f"{f['p50_s']:.3f} / {f['max_s']:.3f}" if f["count"] else "-"  # noqa: E731
    for row in summary["table"]:
        a = row["active"]
        active = f"{a['p50_s']:.3f} / {a['p90_s']:.3f} / {a['max_s']:.3f}" if a["count"] else "-"
        goal = {True: "met", False: "MISSED", None: "-"}[row["goal_met"]]
        print(f"  {row['class']:18} {row['recovered']:3}/{row['trials']:3}  {pair(row['detected']):>17}  {pair(row['restarted']):>17}  {active:>22}  {goal:6} "
              f"{row['false_restarts']:6} {row['slots_lost']:6}  {row['telemetry_gap_s']:4.2f} s  "
              + ", ".join(f"{count} {name}" for name, count in row["found_as"].items()))  # fmt: skip
        for node, why in row["not_applicable"].items():
            print(f"  {'':18} not applicable to {node}: {why}")
    show_checks(summary["checks"])
    for goal in summary.get("goals", ()):
        print(f"  {'met   ' if goal['met'] else 'MISSED'}  {goal['what']}")
    if summary["soak_slopes"]:
        print(f"  soak of {summary['soak_ticks']} ticks")
    for node, slope in summary["soak_slopes"].items():
        print(f"  {node:18} {slope['memory_kib']} KiB anonymous memory, {slope['memory_kib_per_hour']:+} KiB/h; {slope['descriptors']} descriptors, {slope['descriptors_per_hour']:+}/h")
    t = summary["telecommands"]
    print(f"  {t['accepted']} of {t['sent']} telecommands accepted, {t['executed']} executed, {t['ends_lost_with_ttc']} ends lost with ttc, in {summary['recorded_s']} s; times in s from the fault")
    print(f"  {summary['machine']}")


def report(summary):
    """The table as Markdown, for docs/evidence/fault_campaign.md."""
    one = lambda f, *keys: " / ".join(f"{f[key]:.2f}" for key in keys) if f["count"] else "-"  # noqa: E731
    verdict = {True: "met", False: "**missed**", None: "-"}
    lines = ["| Class | Fault | Recovered | Detected, s, p50 / max | Active again, s, p50 / p90 / max | Goal, s, p50 / max | | False restarts | Slots lost | Telemetry gap, s |",
             "|---|---|---|---|---|---|---|---|---|---|"]  # fmt: skip
    for row in summary["table"]:
        goal = row["goal"] or {}
        lines.append(f"| {row['class']} | {row['what']} | {row['recovered']} of {row['trials']} | {one(row['detected'], 'p50_s', 'max_s')} "
                     f"| {one(row['active'], 'p50_s', 'p90_s', 'max_s')} | {' / '.join(str(goal[key]) for key in ('p50_s', 'max_s') if key in goal)} "
                     f"| {verdict[row['goal_met']]} | {row['false_restarts']} | {row['slots_lost']} | {row['telemetry_gap_s']:.1f} |")  # fmt: skip
    lines += ["", *(f'- {"" if c["ok"] else "**NOT OK**: "}{c["what"]}' + (f" ({c['of']})" if "of" in c else "") for c in summary["checks"])]
    t = summary["telecommands"]
    lines += [f"- {t['accepted']} of {t['sent']} telecommands accepted, {t['executed']} executed; {summary['recorded_s']} s"]
    if summary["soak_slopes"]:
        lines += ["", f"Soak of {summary['soak_ticks']} ticks.", "", "| Node | Anonymous memory, KiB | Slope, KiB/h | Descriptors | Slope, 1/h |", "|---|---|---|---|---|"]
        lines += [f"| {node} | {s['memory_kib']} | {s['memory_kib_per_hour']:+} | {s['descriptors']} | {s['descriptors_per_hour']:+} |"
                  for node, s in summary["soak_slopes"].items()]  # fmt: skip
    return "\n".join(lines) + "\n"


def write(folder, campaign):
    head = ["class", "victims", "begin_ns", "detected_s", "restarted_s", "active_s", "false_restarts", "slots_lost", "telemetry_gap_s", "found_as", "note"]
    write_csv(folder / "trials.csv", head, ([t.kind, " ".join(t.victims), t.begin, *(t.seconds(what) for what in ("accused", "process", "active")),
                                             " ".join(t.false_restarts), t.slots_lost, t.telemetry_gap_s, t.found_as, t.note] for t in campaign.trials))  # fmt: skip
    campaign.write_record(folder)
    logs = folder / "log"
    shutil.rmtree(logs, ignore_errors=True)
    shutil.copytree(campaign.flight.var / "log", logs)


def draw(folder, campaign):
    """Plots the time from fault to Active again, one line per class."""
    names = [n for n in kinds_of(campaign) if any(t.active for t in campaign.trials if t.kind == n)]
    if not names:
        return
    figure, axis = pyplot().subplots(figsize=(10, 1.2 + 0.38 * len(names)))
    colors = {node: f"C{number}" for number, node in enumerate(NODES)}
    for row, name in enumerate(names):
        for t in campaign.trials:
            if t.kind == name and t.active:
                axis.plot(t.seconds("active"), row, "o", color=colors[t.victims[0]] if len(t.victims) == 1 else "0.4", markersize=5, alpha=0.7)
    for node, color in colors.items():
        axis.plot([], [], "o", color=color, label=node)
    axis.plot([], [], "o", color="0.4", label="several")
    axis.set_yticks(range(len(names)), names)
    axis.invert_yaxis()
    axis.set_xscale("log")
    axis.set_xlabel("s from the fault (or the end of its cause) to Active again")
    axis.grid(alpha=0.3)
    axis.legend(fontsize=7, loc="center left", bbox_to_anchor=(1, 0.5))
    axis.set_title("Fault campaign: recovery of every class in every node")
    save(figure, folder, "recovery", 120)
