# SPDX-FileCopyrightText: 2026 SRFS contributors
# SPDX-License-Identifier: Apache-2.0
"""Bad telecommands on the RS422 line: each is counted, and the next good telecommand works."""

import os
import random
import tty
import unittest

import cltu
from support import DEADLINE_S, SystemTest

# A forged secured body: segment header, SPI 1, a counter far ahead, and no valid MAC.
FORGED = bytes([0xC0, 0x00, 0x01]) + (1 << 60).to_bytes(12, "big") + bytes(30)


def bad_inputs():
    """[(name, octets, counter of ttc that counts it)]"""
    good = cltu.cltu(cltu.frame(FORGED))
    damaged_crc = bytearray(cltu.frame(FORGED))
    damaged_crc[-1] ^= 0x01
    damaged_blocks = bytearray(good)
    for position in (3, 4, 5, 11, 12, 13):
        damaged_blocks[position] ^= 0x5A
    return [
        ("noise", random.Random(1).randbytes(4096), None),
        ("a start sequence and silence", cltu.START_SEQUENCE, "start_sequences"),
        ("a truncated CLTU", good[: len(good) // 2], None),
        ("code blocks without end", cltu.START_SEQUENCE + bytes(7).join([b"", cltu.parity(bytes(7))] * 4096), None),
        ("code blocks that cannot be corrected", bytes(damaged_blocks), "bch_rejects"),
        ("a wrong checksum", cltu.cltu(bytes(damaged_crc)), "crc_rejects"),
        ("another spacecraft", cltu.cltu(cltu.frame(FORGED, scid=0x1AB)), "wrong_scid"),
        ("a header that says 3 octets", cltu.cltu(cltu.frame(FORGED, length=3)), "wrong_length"),
        ("a virtual channel that is not in use", cltu.cltu(cltu.frame(FORGED, vc=9)), "wrong_vc"),
        ("a forged frame", good, "sdls_mac_failures"),
        ("a frame without content", cltu.cltu(cltu.frame(b"")), None),
    ]


def write_to_line(port, octets):
    line = os.open(port, os.O_RDWR | os.O_NOCTTY)
    try:
        tty.setraw(line)
        while octets:
            octets = octets[os.write(line, octets) :]
    finally:
        os.close(line)


class BadInputTest(SystemTest):
    def test_every_bad_input_is_counted_and_the_next_good_telecommand_works(self):
        deployment = self.deployment(("{ initial_mode: nominal }", "{ initial_mode: nominal, housekeeping_period_ms: 200 }"))
        with self.flight(deployment) as flight:
            before = {node["name"]: node["pid"] for node in flight.up_report["nodes"]}
            ground = flight.ground()
            ground.command("tc housekeeping.set_interval structure=ttc interval_ms=200", DEADLINE_S)
            counters = ground.housekeeping("ttc", DEADLINE_S)["fields"]
            for name, octets, counter in bad_inputs():
                with self.subTest(name):
                    write_to_line(flight.var / "rs422", octets)

                    outcome = ground.command("tc eps.switch_load load=1 state=on --timeout 20", DEADLINE_S)
                    self.assertEqual(outcome.get("stage"), "completed", outcome)
                    completed = counters["tc_completed"]
                    now = ground.housekeeping("ttc", DEADLINE_S, matches=lambda f, c=completed: f["tc_completed"] > c)["fields"]
                    self.assertGreaterEqual(now["octets_received"] - counters["octets_received"], len(octets))
                    if counter:
                        self.assertGreater(now[counter], counters[counter], f"{counter}: {now}")
                    counters = now
            self.assertEqual({node["name"]: node["pid"] for node in flight.status()}, before, "no node was restarted")

    def test_telecommands_that_are_not_in_the_dictionary_never_leave_the_ground(self):
        with self.flight() as flight:
            ground = flight.ground()
            for line, named in (
                ("tc eps.self_destruct", "eps.self_destruct"),
                ("tc eps.switch_load load=4 state=on", "load"),
                ("tc eps.switch_load load=1", "state"),
                ("tc eps.switch_load load=1 state=on colour=red", "colour"),
                ("tc thermal.set_setpoint heater=0 setpoint_k=warm", "setpoint_k"),
                ("frobnicate", "frobnicate"),
            ):
                with self.subTest(line):
                    outcome = ground.command(line, DEADLINE_S)
                    self.assertEqual(outcome["type"], "error")
                    self.assertIn(named, outcome["message"])
            self.assertEqual(ground.stats()["telecommands_sent"], 0)

            # A list of added nodes that no tool wrote: the suite continues, and the ground gets an event.
            before = {node["name"]: node["pid"] for node in flight.up_report["nodes"]}
            since = ground.position()
            (flight.var / "state" / "suite").mkdir(exist_ok=True)
            (flight.var / "state" / "suite" / "added_nodes").write_text("revision: 1\nnodes: [{ name: intruder }]\n")
            told = ground.wait_for(lambda m: m["type"] == "event" and m["event"] == "suite.added_nodes_damaged", DEADLINE_S, since)
            self.assertIsNotNone(told, "the ground is told")
            self.assertIn("not a list of added nodes", told["fields"]["why"])
            self.assertEqual({node["name"]: node["pid"] for node in flight.status()}, before)


if __name__ == "__main__":
    unittest.main()
