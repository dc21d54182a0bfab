# SPDX-FileCopyrightText: 2026 SRFS contributors
# SPDX-License-Identifier: Apache-2.0
"""Files over the link by CFDP: up and down, over a bad line, and while both ends are killed."""

import hashlib
import os
import random
import signal
import unittest

from support import DEADLINE_S, SystemTest

from srfs.flight.processes import wait_until

TRANSFER_S = 180  # far above the transfer time of these files, for a machine under load


def content(octets, seed):
    return random.Random(seed).randbytes(octets)


def digest(path):
    return hashlib.sha256(path.read_bytes()).hexdigest() if path.exists() else None


class FilesTest(SystemTest):
    def finished(self, ground, direction, name, since=0, deadline_s=TRANSFER_S):
        news = ground.wait_for(
            lambda m: m["type"] == "file" and m["event"] == "finished" and (m["direction"], m["name"]) == (direction, name), deadline_s, since
        )
        self.assertIsNotNone(news, f"{name} did not come to an end")
        return news

    def put_down(self, flight, name, octets):
        """Puts a file into the outbox as a node of the suite does: writes it completely, then renames it."""
        outbox = flight.var / "files" / "outbox"
        wait_until(outbox.exists, DEADLINE_S, "the folder of files")
        part = outbox / f".{name}"
        part.write_bytes(octets)
        part.rename(outbox / name)

    def put_up(self, ground, name, octets):
        source = self.folder / f"source_{name}"
        source.write_bytes(octets)
        ground.send(f"put {source} {name}")

    def test_a_file_goes_up_and_another_comes_down_and_both_ends_say_so(self):
        with self.flight() as flight:
            ground = flight.ground()
            self.put_up(ground, "up.bin", content(40_000, 1))
            self.put_down(flight, "down.bin", content(60_000, 2))
            for direction, name, octets in (("up", "up.bin", 40_000), ("down", "down.bin", 60_000)):
                news = self.finished(ground, direction, name)
                self.assertTrue(news["success"], news)
                self.assertEqual(news["octets"], octets)
            self.assertEqual((flight.var / "files/up.bin").read_bytes(), content(40_000, 1))
            self.assertEqual((flight.var / "ground/files/down.bin").read_bytes(), content(60_000, 2))
            for event, name in (("file.received", "up.bin"), ("file.sent", "down.bin")):
                said = ground.wait_for(lambda m, e=event: m["type"] == "event" and m["event"] == e, DEADLINE_S)
                self.assertIsNotNone(said, event)
                self.assertEqual(said["fields"]["name"], name)
            wait_until(lambda: list((flight.var / "files/outbox").iterdir()) == [], DEADLINE_S, "an empty outbox")

    def test_a_suspended_file_rests_until_it_is_resumed(self):
        with self.flight() as flight:
            ground = flight.ground()
            # Cut the line, so that nothing arrives before the transfer is suspended.
            flight.control({"rs422": {"cut": True}})
            self.put_up(ground, "rests.bin", content(30_000, 3))
            begun = ground.wait_for(lambda m: m["type"] == "file" and m["name"] == "rests.bin", DEADLINE_S)
            self.assertIsNotNone(begun)
            since = ground.position()
            ground.send(f"suspend {begun['id']}")
            suspended = ground.wait_for(lambda m: m["type"] == "file" and m["event"] == "suspended", DEADLINE_S, since)
            self.assertIsNotNone(suspended)
            flight.control({"rs422": {"cut": False}})
            # A telecommand goes up and is answered; the file does not go up.
            self.complete(ground, "ping")
            self.assertFalse((flight.var / "files/rests.bin").exists())
            ground.send(f"resume {begun['id']}")
            self.assertTrue(self.finished(ground, "up", "rests.bin")["success"])
            self.assertEqual((flight.var / "files/rests.bin").read_bytes(), content(30_000, 3))

    def test_files_cross_a_bad_line_between_ends_that_are_killed(self):
        octets = 1_000_000  # about 11 s on the line, so that the ends die in the middle of it
        with self.flight() as flight:
            ground = flight.ground()
            flight.control({"rs422": {"flip_probability": 1e-4}})
            self.put_down(flight, "down.bin", content(octets, 4))
            self.put_up(ground, "up.bin", content(octets, 5))
            for death in range(1, 5):
                # Before each death, both files make progress.
                since = ground.position()
                for direction in ("up", "down"):
                    ground.wait_for(
                        lambda m, d=direction: m["type"] == "file" and m["direction"] == d and (m["event"] == "finished" or m["progress"] > 0),
                        DEADLINE_S, since)  # fmt: skip
                if death % 2 == 0:
                    ground.process.kill()
                    ground.process.wait()
                    ground = flight.ground()
                else:
                    pid = flight.node_pid("ttc")
                    os.kill(pid, signal.SIGKILL)
                    wait_until(lambda p=pid: flight.node_pid("ttc") not in (None, p), 3 * DEADLINE_S, "ttc is restarted")
            for file, seed in (("files/up.bin", 5), ("ground/files/down.bin", 4)):
                expected = hashlib.sha256(content(octets, seed)).hexdigest()
                wait_until(lambda f=file, e=expected: digest(flight.var / f) == e, TRANSFER_S, f"{file}, byte for byte")
            flight.control({"rs422": {"flip_probability": 0}})
            for folder in ("files", "ground/files"):
                wait_until(lambda f=folder: list((flight.var / f / "outbox").iterdir()) == [], TRANSFER_S, "an empty outbox")
                self.assertEqual(list((flight.var / folder / "unsent").iterdir()), [])


if __name__ == "__main__":
    unittest.main()
