# SPDX-FileCopyrightText: 2026 SRFS contributors
# SPDX-License-Identifier: Apache-2.0
"""A stranger on the downlink: forged control words, a forged beacon, recordings that are played again. The station believes nothing of it,
not after a restart of either end, and its AD service works meanwhile."""

import os
import pathlib
import shutil
import subprocess
import unittest

import downlink_line
from downlink_line import IDLE_VC, DownlinkLine, cadu, frame_in
from support import BIN, DEADLINE_S, SystemTest, kill, wait_for_ttc

from srfs.flight.ground import GroundSession
from srfs.flight.processes import wait_until, wait_while_it_goes_on

HEADER_OCTETS, SECURITY_OCTETS, MAC_OCTETS, OCF_OCTETS = 6, 8, 16, 4
LOCKOUT = bytes.fromhex("01002800")  # type 0, COP-1, VC 0: lockout and retransmit, V(R) 0
VECTORS = pathlib.Path(__file__).parents[1] / "vectors" / "ground_link.txt"


class ForgerTest(unittest.TestCase):
    def test_the_stranger_can_code(self):
        vectors = dict(line.rsplit(" = ", 1) for line in VECTORS.read_text().splitlines() if line.startswith("RS(255"))
        self.assertEqual(downlink_line.parity(bytes(range(223))).hex(), vectors["RS(255,223) dual basis parity of 00..de"])


def with_control_word(frame, word):
    return frame[:-OCF_OCTETS] + word


def newer(frame, by):
    """The same frame with a number that was not used yet."""
    at = HEADER_OCTETS + 2
    number = int.from_bytes(frame[at : at + 6], "big") + by
    return frame[:at] + number.to_bytes(6, "big") + frame[at + 6 :]


class ForgedDownlinkTest(SystemTest):
    class Station:
        """A ground station of its own folder on the stranger's line, with the flight's keys."""

        def __init__(self, test, flight, line):
            self.folder = test.folder / "station"
            self.folder.mkdir(exist_ok=True)
            port = self.folder / "rs422"
            port.unlink(missing_ok=True)
            port.symlink_to(line.port)
            if not (self.folder / "keys").exists():
                (self.folder / "keys").symlink_to(flight.var / "keys")
            self.var, self._deployment, self.words = flight.var, flight.deployment, ()

        def ground_command(self, *words):
            return [str(BIN / "srfs-ground"), "--port", str(self.folder / "rs422"), "--deployment", str(self._deployment), *self.words, *map(str, words)]

    def session(self, station):
        ground = GroundSession(station)
        self.addCleanup(ground.end)
        return ground

    def inject(self, line, ground, cadus):
        """Returns what the station counted of them."""
        before = ground.stats()
        written = line.written
        line.write(cadus)
        wait_while_it_goes_on(lambda: line.written == written + len(cadus), lambda: line.written, DEADLINE_S, "the stranger's frames are on the line")
        names = ("forged_frames", "replayed_frames", "old_frames")
        counted = lambda: {name: (now := ground.stats())[name] - before[name] for name in names}  # noqa: E731, F841
        wait_until(lambda: sum(counted().values()) >= len(cadus), DEADLINE_S, "the station counted them")
        return counted()

    def forgeries(self, line):
        """Of what was heard: with a forged control word, altered data, another number, and one of its own making."""
        genuine = frame_in(line.heard[-1])
        data = HEADER_OCTETS + SECURITY_OCTETS
        return [
            with_control_word(genuine, LOCKOUT),
            newer(with_control_word(genuine, LOCKOUT), 1001),
            newer(genuine, 1001),
            newer(genuine[:data] + bytes([genuine[data] ^ 1]) + genuine[data + 1 :], 1001),
            bytes([genuine[0], genuine[1] | IDLE_VC << 1]) + genuine[2:4] + b"\x1f\xfe" + genuine[6:-OCF_OCTETS] + LOCKOUT,
        ]

    def test_nothing_of_a_stranger_is_believed(self):
        with self.flight() as flight:
            line = DownlinkLine(flight.var / "rs422")
            self.addCleanup(line.stop)
            station = self.Station(self, flight, line)
            ground = self.session(station)
            wait_for_ttc(ground)
            beacon = ground.wait_for(lambda m: m["type"] == "beacon", DEADLINE_S)
            self.assertTrue(beacon["verified"])
            self.assertTrue(ground.stats()["authenticated"])

            with self.subTest("forged frames"):
                forged = [cadu(frame) for frame in self.forgeries(line)]
                position = ground.position()
                self.assertEqual(self.inject(line, ground, 40 * forged), {"forged_frames": 200, "replayed_frames": 0, "old_frames": 0})
                self.assertIsNone(ground.find(lambda m: m["type"] == "cop" and (m.get("clcw") or {}).get("lockout"), position))
                self.assertIsNotNone(ground.find(lambda m: "not authentic" in str(m.get("message")), position), "the operator is told")

            with self.subTest("the AD service goes on between forged control words"):
                before = ground.stats()["forged_frames"]
                ground.send("ad on")
                for _ in range(5):
                    line.write(20 * forged)
                    self.complete(ground, "tc ttc.ping")
                wait_until(lambda: ground.stats()["forged_frames"] == before + 5 * 20 * len(forged), DEADLINE_S, "the station counted them")
                self.assertIsNone(ground.find(lambda m: m["type"] == "cop" and (m.get("clcw") or {}).get("lockout"), position))
                ground.send("ad off")

            with self.subTest("a recording is played again"):
                recording = list(line.heard)[-1000:]
                counted = self.inject(line, ground, recording)
                self.assertEqual(counted, {"forged_frames": 0, "replayed_frames": len(recording), "old_frames": 0})

            with self.subTest("after a kill of ttc the numbers go on"):
                before = ground.stats()
                kill(flight, "ttc")
                wait_for_ttc(ground)
                after = ground.stats()
                self.assertEqual(after["replayed_frames"], before["replayed_frames"])
                self.assertGreater(after["frames"], before["frames"])

            with self.subTest("after a kill of the station"):
                recording = list(line.heard)[-1000:]
                ground.process.kill()
                ground.end()
                ground = self.session(station)
                wait_for_ttc(ground)
                self.assertEqual(self.inject(line, ground, recording)["replayed_frames"], len(recording))

            with self.subTest("who wants to see it sees it marked"):
                ground.end()
                station.words = ("--unverified", "mark")
                ground = self.session(station)
                wait_for_ttc(ground)
                position = ground.position()
                self.inject(line, ground, recording)
                marked = ground.wait_for(lambda m: m.get("verified") is False, DEADLINE_S, position)
                self.assertIsNotNone(marked)
                self.complete(ground, "tc ttc.ping")

    def test_without_its_key_the_spacecraft_is_heard_by_those_who_ask_for_it(self):
        with self.flight() as flight:
            station = self.folder / "station"
            shutil.copytree(flight.var / "keys", station / "keys")
            (station / "rs422").symlink_to(os.readlink(flight.var / "rs422"))
            listen = lambda *words: subprocess.run(  # noqa: E731
                [str(BIN / "srfs-ground"), "--port", str(station / "rs422"), "--json", *words, "listen", "--duration", "12"],
                stdin=subprocess.DEVNULL,
                capture_output=True,
                text=True,
                timeout=DEADLINE_S,
            ).stdout
            wait_until(lambda: '"verified":true' in listen(), DEADLINE_S, "sealed telemetry")
            (flight.var / "keys" / "tm_downlink.key").unlink()
            kill(flight, "ttc")
            wait_until(lambda: '"verified":false' in listen("--unverified", "mark"), DEADLINE_S, "telemetry without a seal")
            dropped = listen()
            self.assertNotIn('"verified"', dropped)
            self.assertIn("not authentic", dropped)


if __name__ == "__main__":
    unittest.main()
