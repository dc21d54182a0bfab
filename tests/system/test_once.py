# SPDX-FileCopyrightText: 2026 SRFS contributors
# SPDX-License-Identifier: Apache-2.0
"""ttc killed while telecommands run: each accepted one is executed once and its end reported; a repeated telecommand is not executed again."""

import collections
import mmap
import os
import random
import signal
import struct
import threading
import unittest

from support import BIN, DEADLINE_S, JUDGED, SystemTest, kill, restarts, wait_for_slots, wait_for_ttc

from srfs.flight.processes import wait_until

PERIPHERALS = {"eps": "eps.switch_load load=2 state={}", "adcs": "adcs.set_mode mode={}", "thermal": "thermal.set_setpoint heater=0 setpoint_k={}"}
ARGUMENTS = {"eps": ("on", "off"), "adcs": ("point", "idle"), "thermal": ("291", "289")}
PATIENCE_S = 90  # of the ground: the ring waits longer after each death
WINDOW_MS = 1000  # the shortest window in which the ring counts deaths
UNDER_WAY = 3  # telecommands per payload
ACCEPTED_TURNS = 3  # turns in which ttc is killed only after it accepted a telecommand


class OnceTest(SystemTest):
    """Telecommands with an id; the peripherals list the ids that they executed."""

    def stages(self, ground, line):
        return ground.select(lambda m: m["type"] == "tc_stage" and m["line"] == line)

    def names(self, ground, line):
        return [m["stage"] for m in self.stages(ground, line)]

    def executed(self, flight, peripheral):
        return flight.control({"query": "executed"})["executed"][peripheral]

    def send(self, ground, number, peripheral=None):
        peripheral = peripheral or tuple(PERIPHERALS)[number % len(PERIPHERALS)]
        text = PERIPHERALS[peripheral].format(ARGUMENTS[peripheral][number // len(PERIPHERALS) % 2])
        return ground.send(f"tc {text} --timeout {PATIENCE_S}")

    def wait_for_the_end(self, ground, lines):
        """Waits for the end of each accepted telecommand; a frame that arrived while ttc was dead is lost. A restarted ttc repeats its reports
        before it sends its first answer."""
        wait_for_ttc(ground)
        for line in lines:
            if "accepted" in self.names(ground, line):
                self.assertIsNotNone(ground.outcome(line, PATIENCE_S + DEADLINE_S), f"line {line}: {self.names(ground, line)}")

    def judge(self, flight, ground, lines):
        """Every accepted telecommand has its end on the ground. Each is executed at most once, and exactly once if completed."""
        self.wait_for_the_end(ground, lines)
        accepted = [line for line in lines if "accepted" in self.names(ground, line)]
        for line in accepted:
            self.assertEqual(self.names(ground, line)[-1], "completed", f"line {line}: {self.stages(ground, line)}")
        for peripheral in PERIPHERALS:
            found = self.executed(flight, peripheral)
            self.assertEqual(found["count"], len(found["last"]), "the list is complete")
            times = collections.Counter(found["last"])
            self.assertEqual([number for number, n in times.items() if n > 1], [], f"executed twice at {peripheral}")
            to_it = lambda line, p=peripheral: any(m["command"].startswith(p) for m in self.stages(ground, line))  # noqa: E731
            self.assertGreaterEqual(found["count"], sum(map(to_it, accepted)))
            # By number: a recorder may miss what a ttc publishes that has just started.
            self.assertLessEqual(found["count"], sum(map(to_it, lines)), "nothing that nobody sent")
        return accepted


class KilledTtcTest(OnceTest):
    def test_every_accepted_telecommand_is_executed_once_and_its_end_is_told(self):
        seed = random.randrange(1 << 32)
        print(f"seed {seed}")
        chance = random.Random(seed)
        with self.flight() as flight:
            recorder, ground = flight.recorder(), flight.ground()
            wait_for_slots(recorder, "payload_eps", "released", 2, 0)
            others = [name for name in JUDGED if name != "ttc"]
            before = restarts(flight, others)
            lines = []
            for turn in range(2 * ACCEPTED_TURNS):
                after_acceptance = turn % 2 == 1
                if after_acceptance:  # telecommands that arrive while it starts are lost
                    wait_for_ttc(ground)
                since = ground.position()
                for _ in range(UNDER_WAY):
                    lines += [self.send(ground, len(lines) + k) for k in range(len(PERIPHERALS))]
                if after_acceptance:
                    self.assertIsNotNone(ground.wait_for(lambda m: m["type"] == "tc_stage" and m["stage"] == "accepted", DEADLINE_S, since))
                # Anywhere between the first octet, or the first acceptance, and the last report.
                threading.Event().wait(chance.uniform(0, 0.4))
                kill(flight, "ttc")
            accepted = self.judge(flight, ground, lines)
            self.assertGreaterEqual(len(accepted), ACCEPTED_TURNS)
            self.assertEqual(restarts(flight, others), before, "nobody else")

    def test_a_payload_and_ttc_killed_together_lose_nothing(self):
        with self.flight() as flight:
            recorder, ground = flight.recorder(), flight.ground()
            wait_for_slots(recorder, "payload_eps", "released", 2, 0)
            lines = [self.send(ground, n, "eps") for n in range(6)]
            self.assertIsNotNone(ground.wait_for(lambda m: m["type"] == "tc_stage" and m["stage"] == "accepted", DEADLINE_S))
            payload = flight.node_pid("payload_eps")
            os.kill(payload, signal.SIGKILL)
            kill(flight, "ttc")
            self.assertTrue(self.judge(flight, ground, lines))


class CrashPointTest(OnceTest):
    CALLS = int(os.environ.get("SRFS_CRASH_POINTS", "16"))

    def armed_deployment(self):
        self.point = self.var / "crash_point"  # below VAR: ttc writes nowhere else
        self.var.mkdir()
        self.point.write_bytes(bytes(16))
        wrapper = self.folder / "ttc_node"
        wrapper.write_text(f'#!/bin/sh\nexport LD_PRELOAD={BIN.parent}/lib/libsrfs_crash_point.so SRFS_CRASH_POINT={self.point}\nexec {BIN}/ttc_node "$@"\n')
        wrapper.chmod(0o755)
        # ttc dies more often here than in flight. With a short window, the ring's patience is spent only on deaths in quick succession.
        return self.deployment(("executable: ttc_node\n", f"executable: {wrapper}\n"), ("ring:", f"ring:\n  window_ms: {WINDOW_MS}"))

    def test_killed_at_each_system_call_of_a_telecommand_it_is_executed_once(self):
        with self.flight(self.armed_deployment()) as flight:
            recorder, ground = flight.recorder(), flight.ground()
            wait_for_slots(recorder, "payload_eps", "released", 2, 0)
            lines, killed = [], 0
            with open(self.point, "r+b") as file, mmap.mmap(file.fileno(), 16) as point:
                for call in range(1, self.CALLS + 1):
                    pid = flight.node_pid("ttc")
                    point[:] = struct.pack("=QQ", call, 0)
                    lines.append(self.send(ground, call))
                    # ttc's other work continues, so it reaches the call in any case.
                    wait_until(lambda: flight.node_pid("ttc") not in (None, pid), DEADLINE_S, f"ttc ended before call {call} and is back")
                    killed += 1
                    back = recorder.position()
                    wait_for_ttc(ground)
                    ticks = WINDOW_MS // 100 + 2
                    wait_until(lambda: len(recorder.select(lambda m: m["type"] == "tick", back)) > ticks, DEADLINE_S, "the death is out of the window")
            self.judge(flight, ground, lines)
            self.assertEqual(killed, self.CALLS)


if __name__ == "__main__":
    unittest.main()
