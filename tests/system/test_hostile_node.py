# SPDX-FileCopyrightText: 2026 SRFS contributors
# SPDX-License-Identifier: Apache-2.0
"""A payload's uplinked program attacks what is around it: hostile_node.cpp."""

import json
import os
import pathlib
import re

from support import BIN, DEADLINE_S, SystemTest, kill, slots, wait_for_slots
from test_update import BUILD_DEADLINE_S, UpdateTest

from srfs import ROOT
from srfs.flight.lateness import Excuses, Lateness, Waiting
from srfs.flight.processes import wait_until

NODE = "payload_thermal"
OTHERS = ("payload_adcs", "payload_eps")
RESTARTED = "payload_adcs"
MOST = {"descriptors": 1024, "MiB of a file": 128, "MiB of memory": 256}
# Kinds of attempts that the report must have; those on processes once for each.
ATTEMPTS = ("list keys", "read order key seal/seal_key",
            "read keys/package.pub", "write run/stopping", "memory by ptrace", "signal by fcntl", "end by kill", "start a process",
            "a real-time priority", "shared memory")  # fmt: skip
# Where it says what only others may say, and what it asks of them.
FORGED = ("/timing/tick", "/can/task_flags", "/telecommand", "/event", "/can/bus_status")
ORDERED = ("~/change_state", "~/set_parameters")
MOST_EXCUSED = 10  # slots of a payload, about one in five: more would be the hostile program's doing
SLOT_MARGIN_NS = 100_000_000  # the tick before a slot


class HostileNodeTest(SystemTest):
    """The judge: what the attacks changed, seen from outside."""

    def state_of(self, pid):
        stat = pathlib.Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()
        return {"stopped": stat[0] in "Tt", "niceness": stat[16], "policy": os.sched_getscheduler(pid), "CPUs": os.sched_getaffinity(pid)}

    def processes(self, flight):
        return {node["name"]: node["pid"] for node in flight.status() if node["name"] != NODE}

    def watch_machine(self):
        self.lateness, self.waiting = Lateness(), Waiting(self.var)
        self.addCleanup(self.lateness.end)
        self.addCleanup(self.waiting.end)

    def prepare(self, flight):
        """Lets the program attack when it is Active: a file in its own folder, which the golden program does not look at."""
        self.secret = os.urandom(16).hex()
        self.tick_period = flight.srfs("param", "get", "timing", "tick_period_ms").stdout.strip().split()[-1]
        (flight.var / "files").mkdir(exist_ok=True)
        (flight.var / "files" / "of_others").write_text(self.secret)
        own = flight.var / "state" / NODE
        own.mkdir(parents=True, exist_ok=True)
        (own / "attack").touch()

    def state_in(self, flight, name):
        return next(node["state"] for node in flight.status() if node["name"] == name)

    def restart_one_meanwhile(self, flight, ground, recorder, deadline_s=DEADLINE_S):
        """A node that starts while another forges: it knows nobody yet, and must believe none of it. Returns the processes anew."""
        own = flight.var / "state" / NODE
        wait_until((own / "orders").exists, deadline_s, "it forges and orders")
        since_killed = ground.position()
        kill(flight, RESTARTED)
        wait_until(lambda: self.state_in(flight, RESTARTED) == "active", 3 * DEADLINE_S, f"{RESTARTED} is active again")
        self.restarted_at = recorder.position()
        wait_for_slots(recorder, RESTARTED, "released", 2, self.restarted_at)
        self.wait_for_event(
            ground,
            "node.foreign_samples",
            since_killed,
            lambda m: m["source"] == RESTARTED and m["fields"]["participant"].startswith(f"{NODE}, "),
        )
        (own / "forged_enough").touch()
        return self.processes(flight), {node: self.state_of(pid) for node, pid in self.processes(flight).items()}

    def judge_orders(self, flight, ground, since_sent):
        """What it said and ordered over DDS in the name of others."""
        orders = flight.var / "state" / NODE / "orders"
        wait_until(lambda: orders.exists() and orders.read_text().count("\n") >= 4, DEADLINE_S, "its orders were answered")
        self.assertEqual([line for line in orders.read_text().splitlines() if not line.startswith("refused ")], [])
        # Each is counted; the reports, which come only so often, name some of them.
        counted = lambda: {i["name"] for node in self.processes(flight) for i in flight.srfs_json("stats", node)["inputs"] if i["foreign"] > 0}  # noqa: E731
        wait_until(lambda: counted() >= set(FORGED), DEADLINE_S, f"each forgery of {FORGED} is counted")
        for topics in (FORGED, ORDERED):
            self.wait_for_event(
                ground,
                "node.foreign_samples",
                since_sent,
                lambda m: m["fields"]["topic"] in topics and m["fields"]["participant"].startswith(f"{NODE}, "),  # noqa: B023
            )
        goodbyes = r"forged datagrams .* [1-9]\d* of an uplinked node in another's name"
        wait_until(lambda: re.search(goodbyes, (flight.var / "log/ttc.log").read_text(errors="replace")), DEADLINE_S, "its goodbyes for others")
        self.assertEqual({node["state"] for node in flight.status() if node["name"] != NODE}, {"active"})
        self.assertFalse((flight.var / "state/payload_adcs/hold").exists())
        self.assertEqual(flight.srfs("param", "get", "timing", "tick_period_ms").stdout.strip().split()[-1], self.tick_period)

    def lost_slots(self, recorder, payload, since, excuses):
        """Failed slots of a payload. Those are left out in which the peripherals, which are hw_sim's and not on board, waited for a CPU."""
        begin = lambda m: m["said_ns"] - m["used_us"] * 1000 - SLOT_MARGIN_NS  # noqa: E731
        failed = slots(recorder, payload, "failed", since)
        lost = [m for m in failed if not excuses.find(["hw_sim"], begin(m), m["said_ns"])]
        self.assertLess(len(failed) - len(lost), MOST_EXCUSED, failed)
        if len(failed) > len(lost):
            print(f"{len(failed) - len(lost)} slots of {payload} excused")
        return lost

    def judge(self, flight, ground, recorder, since, before, since_sent=0):
        self.judge_orders(flight, ground, since_sent)
        report = flight.var / "state" / NODE / "attacks"
        wait_until(lambda: report.exists() and report.read_text().endswith("end of all attempts\n"), DEADLINE_S, "it has attempted everything")
        wait_until(lambda: flight.versions(NODE)["running"] == 0, DEADLINE_S, "it was ended and rolled back")
        self.assertEqual(flight.versions(NODE)["versions"][-1]["state"], "failed")
        lines = report.read_text().splitlines()
        self.assertEqual([line for line in lines if line.startswith("done")], [])
        refused = [line.removeprefix("refused ") for line in lines if line.startswith("refused")]
        for kind in ATTEMPTS:
            self.assertTrue(any(line.startswith(kind) for line in refused), f"{kind} was not attempted")
        victims = {int(line.rpartition(" ")[2]) for line in refused if line.startswith("end by kill")}
        self.assertLessEqual(set(before[0].values()), victims, "it knows all other nodes")
        for amount, what in (re.match(r"took (\d+) (.+)", line).groups() for line in lines if line.startswith("took")):
            self.assertLessEqual(int(amount), MOST[what], what)
            self.assertGreater(int(amount), 0, what)

        # Whatever it reports: nobody else was ended, stopped or slowed down, and no slot was lost.
        self.assertEqual(self.processes(flight), before[0])
        self.assertEqual({node: self.state_of(pid) for node, pid in before[0].items()}, before[1])
        self.assertEqual((flight.var / "files" / "of_others").read_text(), self.secret)
        self.assertFalse((flight.var / "run" / "stopping").exists())
        after = recorder.position()
        for payload in OTHERS:
            wait_for_slots(recorder, payload, "released", 2, after)
        excuses = Excuses(self.lateness.end(), self.waiting.end())
        for payload in OTHERS:
            self.assertEqual(self.lost_slots(recorder, payload, self.restarted_at if payload == RESTARTED else since, excuses), [])
        faults = [json.loads(line) for line in flight.srfs("faults").stdout.splitlines()]
        self.assertEqual({fault["subject"] for fault in faults if fault.get("outcome_text") == "restarted"} - {NODE, RESTARTED}, set())
        print(f"{len(refused)} attempts refused;", *(line for line in lines if line.startswith("took")), sep=" ")

    def test_an_uplinked_program_reaches_none_of_its_goals_and_is_rolled_back(self):
        with self.flight("fig16") as flight:
            ground, recorder = flight.ground(), flight.recorder()
            self.watch_machine()
            self.prepare(flight)
            for payload in OTHERS:
                wait_for_slots(recorder, payload, "released", 1, 0)
            since = recorder.position()
            for words in (("add", NODE, str(BIN / "hostile_node")), ("use", NODE, "1", "--probation", "3600")):
                self.assertEqual(flight.srfs("versions", *words).returncode, 0, words)
            before = self.restart_one_meanwhile(flight, ground, recorder)
            self.judge(flight, ground, recorder, since, before)
            self.complete(ground, "tc ring.report_faults count=1")


class HostilePackageTest(UpdateTest, HostileNodeTest):
    """From its signed package on: the build, the self-test and the swap have nothing against it."""

    def test_an_uplinked_program_reaches_none_of_its_goals_and_is_rolled_back(self):
        with self.flight() as flight:
            ground, recorder = flight.ground(), flight.recorder()
            self.watch_machine()
            self.prepare(flight)
            for payload in OTHERS:
                wait_for_slots(recorder, payload, "released", 1, 0)
            package = self.package((ROOT / "tests/system/hostile_node.cpp").read_text())
            outcome, since_sent = self.install(ground, flight, package)
            since = recorder.position()
            self.assertEqual(outcome["stage"], "completed", outcome)
            before = self.restart_one_meanwhile(flight, ground, recorder, BUILD_DEADLINE_S)
            self.assertIn(self.end(ground, since_sent)["event"], ("update.installed", "update.failed"))
            self.judge(flight, ground, recorder, since, before, since_sent)
            self.complete(ground, "tc ring.report_faults count=1")
