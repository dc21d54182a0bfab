# SPDX-FileCopyrightText: 2026 SRFS contributors
# SPDX-License-Identifier: Apache-2.0
"""The `commandability` campaign: no order makes the satellite deaf.

It gives one order after the other to a flying suite: every telecommand of the dictionary with its smallest and its largest arguments, every parameter
at both ends (confirmed, kept, and its node restarted with it), every lifecycle order and hold of an operator on board, every pair of hazardous
telecommands. After each it proves that the satellite can be commanded: within LIMIT_S a ping is answered with 1,7 and maintenance, which is behind
most other telecommands, completes one of its own. Resets of the computer by itself are allowed in that time. A satellite that does not come back
within LIMIT_S is deaf, and the next order gets a fresh suite.
"""

import contextlib
import dataclasses
import itertools
import json
import pathlib
import shutil
import signal
import stat
import time

import mission_dictionary

from srfs import ROOT
from srfs.flight import mission
from srfs.flight.processes import send_signal
from srfs.program import MissionError

LIMIT_S = 60  # from the order to the proof: a reset by the watchdog and the start of the suite fit
ANSWER_S = 5  # of one ping
ORDER_S = 4  # how long the end of an order is waited for; long tasks go on beside the next ones
LOOKS_S = 25  # how long the satellite is asked after an order that starves the watchdog late, if at all
LIMIT = ("  period_ms: 100 ", "  command_path_limit_ms: 20000\n  period_ms: 100 ")  # an order on board ends within LIMIT_S
MOST_KEPT = 5  # satellites that were deaf, of which the folder is kept
GRACE_S = 3  # from ttc.transmitter_off to the silence
NODES = ("ttc", "timing", "can_switcher", "maintenance", "payload_eps")  # for an argument that is a node: the command path, and one beside it
LOCAL_NODES = (*NODES, "payload_adcs", "payload_thermal", "image_acquisition", "image_processing")
TIMES = ("1980-01-06T00:00:00Z", "2093-12-31T00:00:00Z")  # of the link
NUMBERS = {"u8": (0, 255), "u16": (0, 65535), "u32": (0, 4294967295), "u64": (0, 18446744073709551615), "i32": (-2147483648, 2147483647), "f64": (-1e300, 1e300)}  # fmt: skip
# Arguments that would only be refused otherwise, or that cost the campaign its time.
GIVEN = {
    ("image.capture", "frames"): ("1", "4"), ("image.capture", "exposure_us"): ("1", "100000"), ("image.capture", "interval_ms"): ("0", "100"),
    ("ttc.select_keys", "vc"): ("0", "0"), ("storage.retrieve", "from"): (TIMES[0], TIMES[0]),
    ("functional_monitor.add", "monitor"): ("1", "1,1001"), ("functional_monitor.add", "minimum_failing"): ("1", "2"),
    ("functional_monitor.add", "event"): ("none", "monitor.functional_4"),
}  # fmt: skip
# What undoes an order; a session's lines.
UNDO = {
    "ring.hold": ["tc ring.release node={node}"],
    "ring.release_inactive": ["tc ring.release node={node}"],
    "ttc.set_mode": ["tc ttc.set_mode mode=nominal"],
    "ttc.transmitter_off": ["tc ttc.transmitter_on"],
    "ttc.select_keys": ["tc ttc.select_keys vc=0 set=a"],
    "housekeeping.disable": ["tc housekeeping.enable structure={structure}"],
    "events.disable": ["tc events.enable event={event}"],
    **{f"monitor.{order}": ["tc monitor.restore"] for order in ("add", "enable", "disable", "delete", "modify", "delete_all", "stop")},
    **{f"functional_monitor.{order}": ["tc monitor.restore"] for order in ("add", "enable", "disable", "protect", "delete", "stop")},
    "monitor.set_reporting_delay": ["tc monitor.restore"],
    **{f"event_action.{order}": ["tc event_action.restore"] for order in ("enable", "disable", "delete", "delete_all", "stop")},
    "schedule.disable": ["tc schedule.enable"],
    "schedule.reset": ["tc schedule.enable"],
    "storage.disable": ["tc storage.enable store={store}"],
    "node.use_version": ["tc node.previous_version node={node}"],
    "scrub.retake": ["tc scrub.run"],
}
# A short campaign: what was deaf once, and what comes nearest to it.
DANGEROUS_COMMANDS = ("ring.hold", "ring.release_inactive", "ttc.select_keys", "ttc.set_mode", "ttc.transmitter_off")
DANGEROUS_PARAMETERS = ("ttc.repeat_window_ms", "can_switcher.rotation_order")


@dataclasses.dataclass
class Order:
    """What is done to the satellite, and what undoes it."""

    kind: str
    name: str
    lines: list = dataclasses.field(default_factory=list)  # of the session
    undo: list = dataclasses.field(default_factory=list)  # the same
    local: list = dataclasses.field(default_factory=list)  # arguments of `srfs`, one call each
    local_undo: list = dataclasses.field(default_factory=list)
    restarts: str = ""  # node that is killed afterwards, so that it starts with what was stored
    looks_s: float = 0  # asked again and again for so long


def argument_ends(dictionary, command, argument):
    """Its smallest and its largest value, or all of its labels."""
    given = GIVEN.get((command, argument["name"]))
    if given:
        return given
    if argument["type"] == "text":
        return NODES if argument["name"] == "node" else ("", "x" * argument["max"])
    if argument["type"] == "bool":
        return ("false", "true")
    if argument["type"] == "time":
        return TIMES
    if "enum" in argument:
        return tuple(str(label) for label in dictionary.enums[argument["enum"]]["labels"])
    if "range" in argument:
        return tuple(str(end) for end in argument["range"])
    references = {"structure": [s["name"] for s in dictionary.structures if "id" in s], "event": [e["name"] for e in dictionary.events],
                  "store": [s["name"] for s in dictionary.stores], "parameter": [p["full_name"] for p in dictionary.parameters],
                  "event_or_none": ["none", "monitor.user_8"], "telemetry": ["timing.cycle", "payload_eps.state_of_charge"]}  # fmt: skip
    if "reference" in argument:
        all_of_it = references[argument["reference"]]
        return (all_of_it[0], all_of_it[-1])
    return tuple(str(end) for end in NUMBERS[argument["type"]])


def _sockets(folder, names):
    """What cannot be copied: sockets and pipes."""
    return [name for name in names if stat.S_IFMT((pathlib.Path(folder) / name).lstat().st_mode) not in (stat.S_IFREG, stat.S_IFDIR, stat.S_IFLNK)]


def quoted(value):
    return f'"{value}"' if value == "" or " " in value else value


def command_orders(dictionary, only=()):
    """Every telecommand with the ends of its arguments: as many orders as the argument with the most values has."""
    for command in dictionary.commands:
        if mission_dictionary.has_packet(command) or mission_dictionary.has_parameter_value(command) or (only and command["name"] not in only):
            continue
        ends = {a["name"]: argument_ends(dictionary, command["name"], a) for a in command["arguments"]}
        for number in range(max(map(len, ends.values()), default=1)):
            chosen = {name: values[number % len(values)] for name, values in ends.items()}
            words = " ".join([command["name"], *(f"{name}={quoted(value)}" for name, value in chosen.items())])
            lines = [f"arm {words}"] * bool(command.get("hazardous")) + [f"tc {words}"]
            yield Order("telecommand", words, lines, [line.format(**chosen) for line in UNDO.get(command["name"], [])])
    if not only:  # those whose arguments are of another kind
        storm = ["tc event_action.add event=event_action.released \"request=ttc.set_mode mode=safe\"", "tc event_action.enable event=event_action.released",
                 "tc event_action.add event=ttc.mode_changed \"request=ttc.set_mode mode=nominal\"", "tc event_action.enable event=ttc.mode_changed",
                 "tc ttc.set_mode mode=safe"]  # fmt: skip
        yield Order("telecommand", "event_action.add", storm, ["tc event_action.restore", "tc ttc.set_mode mode=nominal"], looks_s=LOOKS_S)
        yield Order("telecommand", "schedule.insert", ["tc ttc.ping --at 2093-01-01T00:00:00Z", "tc ttc.set_mode mode=safe --at 2093-01-01T00:00:01Z"], ["tc schedule.reset", "tc schedule.enable"])


def parameter_orders(dictionary, only=()):
    for parameter in dictionary.parameters:
        name, node = parameter["full_name"], parameter["node"]
        if only and name not in only:
            continue
        if parameter["type"] == "text":
            ends = ["", "payload_eps", "x" * parameter["max"]]
        else:
            ends = [str(v) for v in argument_ends(dictionary, "", parameter)]
            ends = [ends[0], ends[-1]]
        for value in ends:
            lines = [f"tc parameters.set parameter={name} value={quoted(value)}", f"tc parameters.confirm node={node}", f"tc parameters.keep node={node}"]
            yield Order("parameter", f"{name}={value}", lines, [f"tc parameters.factory_reset node={node}"], restarts=node,
                        looks_s=LOOKS_S if node == "timing" and name.endswith("_ms") else 0)  # fmt: skip


def local_orders(only=()):
    for node in only or LOCAL_NODES:
        for steps in (("deactivate",), ("deactivate", "cleanup"), ("shutdown",)):
            yield Order("on board", f"{node} {'+'.join(steps)}", local=[["lifecycle", node, step] for step in steps], looks_s=LOOKS_S if node in NODES[:3] else 0,
                        local_undo=[] if node in NODES[:4] or steps == ("shutdown",) else [*[["lifecycle", node, "configure"]] * (len(steps) - 1), ["lifecycle", node, "activate"]])  # fmt: skip
        yield Order("on board", f"{node} hold", local=[["ring", "hold", node]], local_undo=[] if node in NODES[:4] else [["ring", "release", node]],
                    restarts=node, looks_s=LOOKS_S if node in NODES[:3] else 0)  # fmt: skip


def hazardous_pairs(dictionary):
    """Each with the smallest and with the largest arguments; one is followed by itself, too."""
    ends = []
    for command in dictionary.commands:
        if command.get("hazardous"):
            orders = list(command_orders(dictionary, (command["name"],)))
            ends += orders[:1] + orders[-1:] if len(orders) > 1 else orders
    for a, b in itertools.product(ends, repeat=2):
        yield Order("pair", f"{a.name} + {b.name}", a.lines + b.lines, b.undo + a.undo)


def all_orders():
    dictionary = mission_dictionary.load(ROOT / "mission")
    return [*command_orders(dictionary), *parameter_orders(dictionary), *local_orders(), *hazardous_pairs(dictionary)]


def dangerous_orders():
    dictionary = mission_dictionary.load(ROOT / "mission")
    return [*command_orders(dictionary, DANGEROUS_COMMANDS), *parameter_orders(dictionary, DANGEROUS_PARAMETERS)]


class Trials:
    """Gives orders to one suite after the other. @param kept  folder for what the first MOST_KEPT deaf satellites left behind; None: nothing is kept"""

    def __init__(self, var, deployment, bin_dir, say, kept=None):
        self.var, self.deployment, self.bin_dir, self.say = pathlib.Path(var), deployment, bin_dir, say
        self.kept = kept
        self.flight = self.ground = None
        self.results = []
        self.fresh_suites = 0
        self.not_sent = 0  # lines that the ground tool itself refused

    def __enter__(self):
        self._begin()
        return self

    def __exit__(self, *failure):
        self._end()

    def _begin(self):
        self.flight = mission.Mission(self.var, self.deployment, self.bin_dir, self.say)
        self.flight.start()
        self.ground = self.flight.ground()
        self.fresh_suites += 1

    def _end(self):
        with contextlib.suppress(MissionError):
            self.flight.stop()

    def renew(self):
        """A fresh suite, which knows nothing of what was ordered."""
        self._end()
        deaf = sum(not r["ok"] for r in self.results)
        if self.kept and deaf <= MOST_KEPT:
            shutil.rmtree(self.kept / str(deaf), ignore_errors=True)
            shutil.copytree(self.var, self.kept / str(deaf), symlinks=True, ignore=_sockets)
        shutil.rmtree(self.var, ignore_errors=True)
        self._begin()

    def give_all(self, orders, stop=lambda: False):
        for number, order in enumerate(orders, start=1):
            if stop():
                return
            result = self.attempt(order)
            self.results.append(result)
            self.say(f"{number} of {len(orders)}: {order.kind} {order.name}: {result['verdict']}")
            if not result["ok"]:
                self.renew()

    def attempt(self, order):
        """Gives the order, proves that the satellite can be commanded, undoes the order."""
        boots = self._boots()
        said = [self._line(line) for line in order.lines]
        said += [self._local(*call) for call in order.local]
        if order.restarts:
            self._kill(order.restarts)
        if "transmitter_off" in order.name:
            time.sleep(GRACE_S)
        begin = time.monotonic()
        after_s = self._prove(order)
        asked_until = begin + order.looks_s
        while after_s is not None and time.monotonic() < asked_until:
            time.sleep(1)
            after_s = self._prove(order)
        for line in order.undo:
            self._line(line)
        for call in order.local_undo:
            self._local(*call)
        resets = self._boots() - boots
        if resets:  # of each order alone: what it leaves behind is not set aside for the resets of those before it
            (self.var / "state/boot/starts").unlink(missing_ok=True)
        verdict = "DEAF" if after_s is None else f"commandable after {after_s:.1f} s" + (f", {resets} resets" if resets else "")
        return {"kind": order.kind, "order": order.name, "said": [s for s in said if s], "ok": after_s is not None,
                "after_s": None if after_s is None else round(after_s, 2), "resets": resets, "verdict": verdict}  # fmt: skip

    def _prove(self, order):
        """Seconds until the satellite answered a ping and maintenance a telecommand; None: not within LIMIT_S."""
        begin = time.monotonic()
        silenced = "transmitter_off" in order.name
        while time.monotonic() - begin < LIMIT_S:
            if silenced:  # blind commanding: nothing comes down, what goes up is executed
                self.ground.send("tc ttc.transmitter_on")
            if self._completes("ping --timeout 5", ANSWER_S) and self._completes("tc scrub.report", ANSWER_S):
                return time.monotonic() - begin
        return None

    def _completes(self, line, patience_s):
        answer = self.ground.command(line, patience_s)
        return answer is not None and answer.get("stage") == "completed"

    def _line(self, line):
        """Sends a line of the session. Returns how the satellite ended or refused it."""
        answer = self.ground.command(line, ORDER_S)
        if answer is None:
            return "no end yet"
        if answer["type"] == "error":
            self.not_sent += 1
        return answer.get("message") or f"{answer.get('stage')} {answer.get('name', '')}".strip()

    def _local(self, *arguments):
        done = self.flight.srfs(*arguments)
        return (done.stdout or done.stderr).strip()[-200:] if done.returncode else ""

    def _kill(self, node):
        if pid := self.flight.node_pid(node):
            send_signal(pid, signal.SIGKILL)

    def _boots(self):
        with contextlib.suppress(MissionError, ValueError, KeyError):
            return self.flight.control({"query": "counters"})["watchdog"]["bites"]
        return 0

    def judge(self):
        deaf = [r for r in self.results if not r["ok"]]
        kinds = {kind: sum(r["kind"] == kind for r in self.results) for kind in dict.fromkeys(r["kind"] for r in self.results)}
        return {"ok": bool(self.results) and not deaf and not self.not_sent, "orders": len(self.results), "kinds": kinds, "deaf": deaf, "limit_s": LIMIT_S,
                "slowest_s": max((r["after_s"] for r in self.results if r["ok"]), default=None), "fresh_suites": self.fresh_suites, "not_sent": self.not_sent}  # fmt: skip

    def write(self, out):
        (out / "orders.json").write_text("".join(json.dumps(r) + "\n" for r in self.results))
