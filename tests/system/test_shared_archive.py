# SPDX-FileCopyrightText: 2026 SRFS contributors
# SPDX-License-Identifier: Apache-2.0
"""Two stations that hear one spacecraft record into one PostgreSQL, while one of them is killed and the database crashes."""

import contextlib
import json
import os
import pathlib
import pty
import select
import shutil
import signal
import subprocess
import threading
import time
import tty
import unittest

from postgresql import IS_INSTALLED, PostgresqlCluster
from support import BIN, DEADLINE_S, SystemTest

from srfs.flight.processes import wait_until


class Antennas:
    """What the spacecraft sends comes out at a port for each station; what the stations send goes up."""

    def __init__(self, line, ports):
        self.line = os.open(line, os.O_RDWR | os.O_NOCTTY | os.O_NONBLOCK)
        tty.setraw(self.line)
        self.far, self.near = zip(*(pty.openpty() for _ in ports), strict=True)
        for near, port in zip(self.near, ports, strict=True):
            tty.setraw(near)
            port.symlink_to(os.ttyname(near))
        for far in self.far:
            os.set_blocking(far, False)
        self.stopping, self.stop = os.pipe()
        self.thread = threading.Thread(target=self._run, daemon=True)
        self.thread.start()

    def _run(self):
        while True:
            ready, _, _ = select.select([self.stopping, self.line, *self.far], [], [])
            if self.stopping in ready:
                return
            with contextlib.suppress(OSError):
                for source in ready:
                    octets = os.read(source, 4096)
                    for far in self.far if source == self.line else (self.line,):
                        with contextlib.suppress(BlockingIOError):  # a station that is not there has its own gap
                            os.write(far, octets)

    def end(self):
        os.write(self.stop, b"x")
        self.thread.join()
        for descriptor in (self.line, *self.far, *self.near, self.stopping, self.stop):
            os.close(descriptor)


class Station:
    """`srfs-ground serve`, and what it shows."""

    def __init__(self, folder, number, archive):
        self.port = folder / "rs422"
        self.words = [str(BIN / "srfs-ground"), "--port", str(self.port), "--station", str(number)]
        self.archive = archive
        self.log = folder / "serve.log"
        self.shown = []  # (when, packet)
        self.starts = 0
        self.start()

    def start(self):
        with self.log.open("a") as log:
            self.server = subprocess.Popen([*self.words, "--archive", self.archive, "serve"], stdin=subprocess.DEVNULL, stdout=log, stderr=log)
        self.starts += 1
        wait_until(lambda: self.log.read_text().count("serving ") == self.starts, DEADLINE_S, "the server serves")
        self.listener = subprocess.Popen([*self.words, "--json", "listen"], stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, text=True)
        self.reader = threading.Thread(target=self._read, args=(self.listener,), daemon=True)
        self.reader.start()

    def _read(self, listener):
        for line in listener.stdout:
            message = json.loads(line)
            if message["type"] in ("tm_packet", "beacon", "event", "pong"):
                self.shown.append((time.monotonic(), (message["apid"], message["sequence"], message["time"])))

    def run(self, *words):
        return subprocess.run([*self.words, *words], stdin=subprocess.DEVNULL, capture_output=True, text=True, timeout=DEADLINE_S)

    def archived(self, *words):
        result = self.run("--json", *words)
        if result.returncode != 0:
            raise AssertionError(result.stderr)
        return [json.loads(line) for line in result.stdout.splitlines()]

    def end(self, signal_number=signal.SIGTERM):
        self.server.send_signal(signal_number)
        self.server.wait(timeout=DEADLINE_S)
        self.listener.terminate()
        self.listener.wait(timeout=DEADLINE_S)
        self.reader.join()
        self.listener.stdout.close()


@unittest.skipUnless(IS_INSTALLED, "PostgreSQL is not installed (packages.txt: postgresql-15)")
class SharedArchiveTest(SystemTest):
    def station(self, number):
        folder = self.folder / f"station{number}"
        return Station(folder, number, self.database.address)

    def test_what_either_station_showed_is_there_once_whoever_is_killed(self):
        self.database = PostgresqlCluster(self.folder)
        self.addCleanup(self.database.end)
        with self.flight():
            ports = []
            for number in (1, 2):
                folder = self.folder / f"station{number}"
                folder.mkdir()
                shutil.copytree(self.var / "keys", folder / "keys")
                ports.append(folder / "rs422")
            antennas = Antennas(self.var / "rs422", ports)
            first, second = self.station(1), self.station(2)
            try:
                self.fly(first, second)
            finally:
                for station in (first, second):
                    if station.server.poll() is None:
                        station.end()
                antennas.end()

    def test_a_station_moves_from_its_file_into_a_shared_archive(self):
        self.database = PostgresqlCluster(self.folder)
        self.addCleanup(self.database.end)
        folder = self.folder / "station1"
        folder.mkdir()
        file = folder / "before.sqlite"
        with self.flight():
            shutil.copytree(self.var / "keys", folder / "keys")
            antennas = Antennas(self.var / "rs422", [folder / "rs422"])
            station = Station(folder, 1, str(file))
            try:
                self.assertEqual(station.run("tc", "eps.switch_load", "load=2", "state=on", "--wait").returncode, 0)
                wait_until(lambda: len(station.shown) > 10, DEADLINE_S, "telemetry")
                refused = station.run("archive", "copy", "--to", str(file))
                self.assertEqual(refused.returncode, 2)
                station.end()
                before = {verb: self.without_numbers(station, verb) for verb in ("packets", "commands")}

                copy = ["--archive", str(file), "archive", "copy", "--to", self.database.address]
                killed = subprocess.Popen([*station.words, *copy], stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
                time.sleep(0.1)
                killed.kill()
                killed.wait()
                copied = station.run("--json", *copy)
                self.assertEqual(copied.returncode, 0, copied.stderr)
                rows = {row["table"]: row for row in map(json.loads, copied.stdout.splitlines())}
                self.assertEqual(rows["packets"]["read"], len(before["packets"]))

                station.archive = self.database.address
                station.start()
                known = len(station.shown)
                wait_until(lambda: len(station.shown) > known + 5, DEADLINE_S, "telemetry into the shared archive")
                again = station.run("--json", *copy)  # beside the server
                self.assertEqual([json.loads(line)["added"] for line in again.stdout.splitlines() if "packets" in line], [0])
                station.end()
            finally:
                if station.server.poll() is None:
                    station.end()
                antennas.end()
            for verb, rows in before.items():
                after = self.without_numbers(station, verb)
                self.assertEqual([row for row in rows if row not in after], [], verb)
            packets = [(m["apid"], m["sequence"], m["time"]) for m in station.archived("packets")]
            self.assertEqual(len(packets), len(set(packets)), "each packet once")
            self.assertGreater(len(packets), len(before["packets"]))

    @staticmethod
    def without_numbers(station, verb):
        return [{key: value for key, value in row.items() if key != "id"} for row in station.archived(verb)]

    def fly(self, first, second):
        command = lambda station: station.run("tc", "eps.switch_load", "load=2", "state=on", "--wait")  # noqa: E731
        shows_more = lambda station: (lambda known=len(station.shown): len(station.shown) > known + 5)  # noqa: E731
        for station in (first, second):
            done = command(station)
            self.assertEqual(done.returncode, 0, done.stderr)
            wait_until(shows_more(station), DEADLINE_S, "telemetry")

        second.end(signal.SIGKILL)
        wait_until(shows_more(first), DEADLINE_S, "telemetry at the other one")
        second.start()
        wait_until(shows_more(second), DEADLINE_S, "telemetry after the kill")

        crashed = time.monotonic()
        self.database.stop()
        for station in (first, second):
            wait_until(lambda s=station: "the archive fails" in s.log.read_text(), DEADLINE_S, "the failure is told")
            wait_until(shows_more(station), DEADLINE_S, "the line goes on without it")
        self.assertNotEqual(first.run("events").returncode, 0)
        self.database.start()
        for station in (first, second):
            wait_until(lambda s=station: "the archive works again" in s.log.read_text(), DEADLINE_S, "it is taken up again")
        works = time.monotonic()
        for station in (first, second):
            self.assertEqual(command(station).returncode, 0)
            wait_until(shows_more(station), DEADLINE_S, "telemetry")
            station.end()

        archived = [(m["apid"], m["sequence"], m["time"]) for m in first.archived("packets")]
        self.assertEqual(len(archived), len(set(archived)), "each packet once")
        for station in (first, second):
            shown = {packet for when, packet in station.shown if when < crashed or when > works}
            self.assertGreater(len(shown), 10)
            self.assertEqual(shown - set(archived), set())
        common = {p for _, p in first.shown} & {p for _, p in second.shown}
        self.assertGreater(len(common), 5, "else no packet came twice")
        self.assertEqual([c["verdict"] for c in second.archived("commands")], ["completed"] * 4)
        self.assertEqual(second.archived("packets"), first.archived("packets"))
        self.assertFalse((pathlib.Path(first.port).parent / "ground/archive.sqlite").exists())
        self.assertEqual(first.run("archive", "check").returncode, 0)


if __name__ == "__main__":
    unittest.main()
