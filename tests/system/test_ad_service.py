# SPDX-FileCopyrightText: 2026 SRFS contributors
# SPDX-License-Identifier: Apache-2.0
"""The AD service of COP-1 against the running suite, with a sending end that shares no code with the suite, and with srfs-ground."""

import struct
import unittest

import cltu
import fop_client
from fop_client import FopClient
from open_link import SEGMENT_HEADER, UNSECURED_VC, OpenStation, tc_packet
from support import DEADLINE_S, SystemTest

TTC, EPS = 1, 17  # APIDs
PING = (TTC, 17, 1)
ALL_DELIVERED_S = 120  # some timers of 3 s, on a busy machine


def switch_load(load, state):
    return (EPS, 8, 1, struct.pack(">HBB", 1, load, state))


class OpenAdServiceTest(SystemTest):
    """Virtual channel 1 of sim_open."""

    def station(self, flight, interleave=1):
        station = OpenStation(flight.var / "rs422", interleave)
        self.addCleanup(station.close)
        return station

    def reports(self, station, request, subtype):
        return [r for r in station.reports if r.service == 1 and r.subtype == subtype and r.data[:4] == request]

    def assert_each_executed_once(self, station, requests):
        for request in requests:
            done = station.wait_for(lambda r, q=request: r.service == 1 and r.subtype == 7 and r.data[:4] == q, DEADLINE_S)
            self.assertIsNotNone(done, f"{request.hex()} was not executed")
        station.wait_for(lambda r: (r.apid, r.service) == (TTC, 3), DEADLINE_S, len(station.reports))  # late reports have arrived by then
        for request in requests:
            for subtype in (1, 7):
                self.assertEqual(len(self.reports(station, request, subtype)), 1, f"1,{subtype} of {request.hex()}")
        accepted = [r.data[:4] for r in station.reports if (r.service, r.subtype) == (1, 1)]
        self.assertEqual([r for r in accepted if r in requests], requests, "in order")

    def fly_with_losses(self, deployment, interleave):
        with self.flight(deployment) as flight:
            station = self.station(flight, interleave)
            # Lose the first, one in the middle of a window, a retransmitted one, and several in a row.
            fop = FopClient(station, lose=lambda n: n in (0, 4, 9, 10, 11, 12, 20, 30) and n < 40)
            fop.set_vr(250)  # N(S) wraps
            self.assertEqual(fop.clcw.nr, 250)
            requests = [fop.send(*(switch_load(2, n % 2) if n % 4 == 0 else PING)) for n in range(24)]
            fop.finish(ALL_DELIVERED_S)

            self.assertEqual(fop.lost, 8)
            self.assertGreater(fop.transmissions, 24 + 8 - 1)
            self.assertEqual(fop.clcw.nr, (250 + 24) % 256)
            self.assert_each_executed_once(station, requests)

    def test_lost_frames_are_repeated_and_every_telecommand_is_executed_once(self):
        self.fly_with_losses("sim_open", 1)

    def test_the_same_with_interleave_5(self):
        self.fly_with_losses("sim_open_i5", 5)

    def test_a_stray_frame_locks_the_farm_out_until_it_is_unlocked(self):
        with self.flight("sim_open") as flight:
            station = self.station(flight)
            fop = FopClient(station)
            fop.set_vr(7)
            first = fop.send(*PING)
            fop.finish(ALL_DELIVERED_S)
            farm_b = fop.clcw.farm_b

            stray = SEGMENT_HEADER + tc_packet(*PING, sequence=1000)
            station.write(cltu.cltu(fop_client.frame("AD", stray, sequence=8 + 100, vc=UNSECURED_VC)))
            with self.assertRaisesRegex(fop_client.Alert, "LOCKOUT"):
                fop.wait_for_clcw(lambda clcw: clcw.lockout, DEADLINE_S)
            self.assertEqual((fop.clcw.nr, fop.clcw.farm_b), (8, farm_b))
            # Locked out: AD frames are refused even when they fit, BD frames are not.
            station.write(cltu.cltu(fop_client.frame("AD", stray, sequence=8, vc=UNSECURED_VC)))
            since = len(station.reports)
            request = station.send(*PING)
            self.assertIsNotNone(station.verification(request, 7, DEADLINE_S, since))

            fop.unlock()
            self.assertEqual(fop.clcw.farm_b, (farm_b + 2) % 4, "the BD frame and the unlock")
            second = fop.send(*PING)
            fop.finish(ALL_DELIVERED_S)
            self.assert_each_executed_once(station, [first, second])
            self.assertEqual(self.reports(station, stray[1:5], 1), [], "the stray frame did nothing")


class GroundAdServiceTest(SystemTest):
    """srfs-ground with the secured AD service over a line that flips bits."""

    def test_telecommands_over_a_bad_line_are_executed_once_and_in_order(self):
        deployment = self.deployment(("{ initial_mode: nominal }", "{ initial_mode: nominal, housekeeping_period_ms: 200 }"))
        with self.flight(deployment) as flight:
            ground = flight.ground()
            ground.command("tc housekeeping.set_interval structure=ttc interval_ms=200", DEADLINE_S)
            ground.send("ad on")
            self.assertIsNotNone(ground.wait_for(lambda m: m["type"] == "cop" and m["service"] == "on", DEADLINE_S))
            before = ground.housekeeping("ttc", DEADLINE_S)["fields"]["tc_accepted"]

            flight.control({"rs422": {"flip_probability": 4e-3}})
            since = ground.position()
            lines = [ground.send("tc ttc.ping --timeout 40") for _ in range(60)]
            repeated = ground.wait_for(lambda m: (m.get("cop") or m).get("repeated", 0) > 0, DEADLINE_S, since)
            self.assertIsNotNone(repeated, "no frame was lost")
            flight.control({"rs422": {"flip_probability": 0}})

            for line in lines:
                ground.wait_for(lambda m, n=line: m["type"] == "tc_stage" and m["line"] == n and m["final"], ALL_DELIVERED_S)
            stats = ground.stats(DEADLINE_S)
            self.assertIsNotNone(stats)
            cop = stats["cop"]
            self.assertEqual((cop["service"], cop["queued"], cop["outstanding"]), ("on", 0, 0), cop)
            now = ground.housekeeping("ttc", DEADLINE_S, matches=lambda f: f["tc_accepted"] >= before + len(lines))["fields"]
            self.assertEqual(now["tc_accepted"], before + len(lines), "each once")
            self.assertEqual(now["sdls_replays"], 0, "no counter is used twice")


if __name__ == "__main__":
    unittest.main()
