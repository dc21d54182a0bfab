# SPDX-FileCopyrightText: 2026 SRFS contributors
# SPDX-License-Identifier: Apache-2.0
"""A stranger on the RS422 line, without keys, at the rate of the line: what it costs is what the ICD says (2.8).

By hand, for longer, at a part of the line's rate, with the measured figures as JSON:
    SRFS_STRANGER_S=600 SRFS_STRANGER_PART=0.5 PYTHONPATH=../../python /usr/bin/python3 -B test_stranger.py
"""

import json
import os
import pathlib
import random
import subprocess
import threading
import time
import tty
import unittest

import cltu
from support import BIN, DEADLINE_S, SystemTest

ATTACK_S = float(os.environ.get("SRFS_STRANGER_S", "0.7"))
OCTETS_S = 921_600 / 10 * float(os.environ.get("SRFS_STRANGER_PART", "1"))
FORGED = bytes([0xC0, 0x00, 0x01]) + (1 << 60).to_bytes(12, "big") + bytes(30)
SET_VR = bytes([0x82, 0x00, 77])


def bc_frame(data):
    total = 5 + len(data) + 2
    octets = bytes([0x30, 0xAB, 0, total - 1, 0]) + data
    return octets + cltu.crc(octets)


def percentile(values, part):
    return sorted(values)[min(len(values) - 1, int(part * len(values)))] if values else None


class Flood(threading.Thread):
    """Writes CLTUs to the line, at its rate, until it is ended."""

    def __init__(self, port, unit):
        super().__init__(daemon=True)
        self.line = os.open(port, os.O_RDWR | os.O_NOCTTY)
        tty.setraw(self.line)
        self.unit = unit
        self.octets = 0
        self.ended = threading.Event()

    def run(self):
        begun = time.monotonic()
        while not self.ended.is_set():
            due = (time.monotonic() - begun) * OCTETS_S - self.octets
            burst = self.unit() if due > 0 else b""
            if not burst:
                self.ended.wait(0.002)
                continue
            while burst:
                written = os.write(self.line, burst)
                self.octets += written
                burst = burst[written:]

    def stop(self):
        self.ended.set()
        self.join()
        os.close(self.line)


class StrangerTest(SystemTest):
    def recorded_ping(self, flight):
        """A telecommand of the ground's, with its keys, as it left for a line of our own."""
        ours, theirs = os.openpty()
        tty.setraw(theirs)
        folder = self.folder / "recorder"
        folder.mkdir()
        (folder / "rs422").symlink_to(os.ttyname(theirs))
        (folder / "keys").symlink_to(flight.var / "keys")
        subprocess.run(
            [BIN / "srfs-ground", "--port", folder / "rs422", "--deployment", flight.deployment, "tc", "ttc.ping", "--timeout", "0.1"],
            capture_output=True,
            check=False,
        )
        octets = os.read(ours, 4096)
        os.close(ours)
        os.close(theirs)
        self.assertTrue(octets.startswith(cltu.START_SEQUENCE), octets)
        return octets

    def counters(self, ground):
        """Of a sample that begins after all that was sent so far has an outcome."""
        self.assertIsNotNone(ground.housekeeping("ttc", DEADLINE_S))
        return ground.housekeeping("ttc", DEADLINE_S)["fields"]

    def attack(self, flight, ground, unit):
        """Floods while the ground commands. Returns what it cost."""
        cpu = lambda: sum(map(int, pathlib.Path(f"/proc/{self.ttc}/stat").read_text().rpartition(")")[2].split()[11:13]))  # noqa: E731
        before = self.counters(ground)
        events = len(ground.select(lambda m: m["type"] == "event" and m["event"] == "ttc.frames_refused"))
        flood = Flood(flight.var / "rs422", unit)
        begun, ticks = time.monotonic(), cpu()
        flood.start()
        latencies, lost = [], 0
        try:
            while not latencies or time.monotonic() - begun < ATTACK_S:
                sent = time.monotonic()
                outcome = ground.command("tc ttc.ping --timeout 10", DEADLINE_S)
                if outcome.get("stage") == "completed":
                    latencies.append(time.monotonic() - sent)
                else:
                    lost += 1
                    self.assertLess(lost, 10 + len(latencies), outcome)
            lasted, used = time.monotonic() - begun, cpu() - ticks
        finally:
            flood.stop()
        after = self.counters(ground)
        grew = lambda name: after[name] - before[name]  # noqa: E731
        return {
            "lasted_s": round(lasted, 1),
            "octets": flood.octets,
            "telecommands": len(latencies),
            "telecommands_not_completed": lost,
            "latency_p50_ms": round(percentile(latencies, 0.5) * 1000, 1),
            "latency_p99_ms": round(percentile(latencies, 0.99) * 1000, 1),
            "cpu_part": round(used / os.sysconf("SC_CLK_TCK") / lasted, 3),
            "journal_syncs": grew("journal_syncs"),
            "journal_octets": grew("journal_octets"),
            "live_packets": grew("tm_packets.live"),
            "live_dropped": grew("tm_dropped.live"),
            "refused": grew("sdls_mac_failures") + grew("sdls_replays") + grew("sdls_too_old"),
            "repeats": grew("tc_repeats"),
            "accepted": grew("tc_accepted"),
            "events": len(ground.select(lambda m: m["type"] == "event" and m["event"] == "ttc.frames_refused")) - events,
        }

    def test_what_has_no_key_or_came_before_costs_no_write_and_no_telemetry(self):
        figures = {}
        deployment = self.deployment(("{ initial_mode: nominal }", "{ initial_mode: nominal, housekeeping_period_ms: 100 }"))
        with self.flight(deployment) as flight:
            self.ttc = next(node["pid"] for node in flight.up_report["nodes"] if node["name"] == "ttc")
            ground = flight.ground()
            ground.command("tc housekeeping.set_interval structure=ttc interval_ms=100", DEADLINE_S)
            accepted = self.counters(ground)["tc_accepted"]
            recorded = self.recorded_ping(flight)  # its counter is the newest until the ground commands again
            line = os.open(flight.var / "rs422", os.O_RDWR | os.O_NOCTTY)
            os.write(line, recorded)
            os.close(line)
            self.assertIsNotNone(ground.housekeeping("ttc", DEADLINE_S, matches=lambda f: f["tc_accepted"] == accepted + 1), "executed")
            noise = random.Random(1)
            figures["idle"] = self.attack(flight, ground, lambda: b"")
            for name, unit in (
                ("recorded telecommand", lambda: recorded),
                ("control commands", lambda: cltu.cltu(bc_frame(SET_VR))),
                ("forged frames", lambda: cltu.cltu(cltu.frame(FORGED))),
                ("noise of CLTUs", lambda: cltu.START_SEQUENCE + noise.randbytes(254)),
            ):
                with self.subTest(name):
                    cost = figures[name] = self.attack(flight, ground, unit)
                    self.assertGreater(cost["octets"], 0)
                    self.assertEqual(cost["live_dropped"], 0)
                    # What is written are the ground's telecommands.
                    commands = cost["accepted"]
                    self.assertLessEqual(cost["journal_syncs"], 3 * commands + cost["lasted_s"] + 2, cost)
                    self.assertLessEqual(cost["journal_octets"], 1000 * commands + 2000, cost)
                    self.assertLessEqual(cost["events"], 1 + cost["lasted_s"] / 60)
                    if "noise" not in name:
                        self.assertGreater(cost["refused"], 10, "the flood reached ttc")
            cop = ground.stats(DEADLINE_S)["cop"]
            self.assertFalse((cop.get("clcw") or {}).get("lockout", False), cop)
        if "SRFS_STRANGER_S" in os.environ:
            print(json.dumps(figures))


if __name__ == "__main__":
    unittest.main()
