# SPDX-FileCopyrightText: 2026 SRFS contributors
# SPDX-License-Identifier: Apache-2.0
"""The deployment sim_open, commanded without security over TC virtual channel 1 by a station that shares no code with the suite."""

import random
import struct
import unittest

import cltu
from open_link import SEGMENT_HEADER, UNSECURED_VC, OpenStation, Structure, pseudo_noise, tc_packet
from support import DEADLINE_S, SystemTest

TTC, EPS = 1, 17  # APIDs
PING = (TTC, 17, 1)


def switch_load(load, state):
    return (EPS, 8, 1, struct.pack(">HBB", 1, load, state))


def code(number, parameter=b""):
    return struct.pack(">H", number) + parameter


# Telecommands in good frames whose packets are refused on board: (name, telecommand, failure code and parameter).
REFUSED = [
    ("a load that does not exist", switch_load(9, 1), code(6, b"\1")),
    ("a switch state that does not exist", switch_load(2, 7), code(6, b"\2")),
    ("an argument too many", (EPS, 8, 1, struct.pack(">HBBB", 1, 2, 1, 0)), code(13)),
    ("a function that does not exist", (EPS, 8, 1, b"\x7f\xff"), code(7, b"\x7f\xff")),
    ("a service that does not exist", (TTC, 99, 1), code(4)),
    ("a request that does not exist", (TTC, 17, 99), code(5)),
    ("more groups than a request may carry", (TTC, 3, 5, struct.pack(">H", 17) + bytes(34)), code(13)),
]


def damaged_inputs():
    """[(name, octets, counter of structure ttc)]"""
    body = SEGMENT_HEADER + tc_packet(*PING)
    frame = cltu.frame(body, vc=UNSECURED_VC)
    good = cltu.cltu(frame)
    wrong_blocks = bytearray(good)
    for position in (3, 4, 5, 11, 12, 13):
        wrong_blocks[position] ^= 0x5A
    longest = cltu.frame(SEGMENT_HEADER + bytes(4000), vc=UNSECURED_VC, length=1024)
    return [
        ("a wrong checksum", cltu.cltu(frame[:-1] + bytes([frame[-1] ^ 1])), "crc_rejects"),
        ("another spacecraft", cltu.cltu(cltu.frame(body, scid=0x1AB, vc=UNSECURED_VC)), "wrong_scid"),
        ("a length of 3", cltu.cltu(cltu.frame(body, vc=UNSECURED_VC, length=3)), "wrong_length"),
        ("a channel that is not in use", cltu.cltu(cltu.frame(body, vc=9)), "wrong_vc"),
        ("code blocks that cannot be corrected", bytes(wrong_blocks), "bch_rejects"),
        ("noise", random.Random(2).randbytes(4096), "noise_octets"),
        ("a truncated CLTU", good[: len(good) // 2], "wrong_length"),
        ("a CLTU that goes on behind its frame", cltu.cltu(longest), "crc_rejects"),
        ("a packet with a wrong checksum", cltu.cltu(cltu.frame(body[:-1] + bytes([body[-1] ^ 1]), vc=UNSECURED_VC)), "tc_rejected"),
        ("an unsecured frame on the secured channel", cltu.cltu(cltu.frame(body, vc=0)), "sdls_mac_failures"),
    ]


class OpenChannelTest(SystemTest):
    def station(self, flight):
        station = OpenStation(flight.var / "rs422")
        self.addCleanup(station.close)
        return station

    def completes(self, station, *telecommand):
        """Sends a telecommand and expects its acceptance and completion. Returns the position of the reports before it."""
        since = len(station.reports)
        request = station.send(*telecommand)
        for subtype in (1, 7):
            self.assertIsNotNone(station.verification(request, subtype, DEADLINE_S, since), f"1,{subtype}: {station.reports[since:]}")
        return since

    def counters(self, station, matches=lambda fields: True):
        """The next periodic sample of structure ttc that matches."""
        ttc = Structure("ttc")
        found = {}

        def fits(report):
            if (report.apid, report.service, report.subtype) != (TTC, 3, 25) or report.data[:2] != struct.pack(">H", ttc.id):
                return False
            found.update(ttc.decode(report.data[2:]))
            return matches(found)

        self.assertIsNotNone(station.wait_for(fits, DEADLINE_S, len(station.reports)), f"{found}")
        return found

    def test_the_randomizer_of_the_test_is_the_standard_one(self):
        self.assertEqual(pseudo_noise(8).hex(), "ff480ec09a0d70bc")

    def test_an_open_channel_is_announced_and_commands_the_spacecraft(self):
        with self.flight("sim_open") as flight:
            log = (flight.var / "log" / "ttc.log").read_text()
            self.assertRegex(log, "(?i)warn.*TC VIRTUAL CHANNEL 1 HAS NO SECURITY")
            station = self.station(flight)

            since = self.completes(station, *PING)
            self.assertTrue(station.wait_for(lambda r: (r.apid, r.service, r.subtype) == (TTC, 17, 2), DEADLINE_S, since))

            eps = Structure("payload_eps")
            for state in (1, 0, 1):
                since = self.completes(station, *switch_load(2, state))
                says_so = station.wait_for(
                    lambda r, s=state: (r.apid, r.service, r.subtype) == (EPS, 3, 25)
                    and r.data[:2] == struct.pack(">H", eps.id)
                    and eps.decode(r.data[2:])["load_switches"] >> 2 & 1 == s,
                    DEADLINE_S,
                    since,
                )
                self.assertTrue(says_so, f"load 2 is {state}")

            for name, telecommand, notice in REFUSED:
                with self.subTest(name):
                    since = len(station.reports)
                    request = station.send(*telecommand)
                    refusal = station.verification(request, 2, DEADLINE_S, since)
                    self.assertIsNotNone(refusal, station.reports[since:])
                    self.assertEqual(refusal.data[4:], notice)
            since = len(station.reports)
            refusal = station.verification(station.send(0x123, 17, 1), 10, DEADLINE_S, since)
            self.assertIsNotNone(refusal, "1,10: it cannot be routed")
            self.assertEqual((refusal.apid, refusal.data[4:]), (TTC, code(1)))
            self.completes(station, *PING)

    def test_damaged_octets_are_counted_and_the_next_good_telecommand_works(self):
        deployment = self.deployment(("{ initial_mode: nominal }", "{ initial_mode: nominal, housekeeping_period_ms: 200 }"), base="sim_open")
        with self.flight(deployment) as flight:
            before = {node["name"]: node["pid"] for node in flight.up_report["nodes"]}
            station = self.station(flight)
            self.completes(station, TTC, 3, 31, struct.pack(">HHI", 1, Structure("ttc").id, 200))
            counters = self.counters(station)
            for name, octets, counter in damaged_inputs():
                with self.subTest(name):
                    station.write(octets)
                    counted = self.counters(station, lambda f, n=counter, c=counters[counter]: f[n] > c)
                    self.completes(station, *PING)
                    counters = self.counters(station, lambda f, c=counted["tc_completed"]: f["tc_completed"] > c)
            self.assertEqual({node["name"]: node["pid"] for node in flight.status()}, before, "no node was restarted")


if __name__ == "__main__":
    unittest.main()
