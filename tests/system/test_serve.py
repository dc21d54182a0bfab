# SPDX-FileCopyrightText: 2026 SRFS contributors
# SPDX-License-Identifier: Apache-2.0
"""`srfs-ground serve`: many tools at once on one line, and a server that is killed while they work."""

import contextlib
import fcntl
import json
import os
import random
import select
import signal
import socket
import subprocess
import threading
import time
import tty
import unittest
from datetime import datetime, timezone

from support import BIN, DEADLINE_S, SystemTest

from srfs.flight.processes import wait_until, wait_while_it_goes_on


class Modem:
    """A modem on the network: the octets of the spacecraft's line at a TCP port of the loopback."""

    def __init__(self, line, port=0):
        self.line = os.open(line, os.O_RDWR | os.O_NOCTTY)
        tty.setraw(self.line)
        self.listener = socket.create_server(("127.0.0.1", port))
        self.port = self.listener.getsockname()[1]
        self.connections = 0
        self._ended, self._end = os.pipe()
        self._thread = threading.Thread(target=self._carry, daemon=True)
        self._thread.start()

    def _carry(self):
        peer = None
        while True:
            ready, _, _ = select.select([self._ended, self.listener, self.line, *([peer] if peer else [])], [], [])
            if self._ended in ready:
                break
            if self.listener in ready:
                if peer:
                    peer.close()
                peer, _ = self.listener.accept()
                self.connections += 1
            elif peer in ready:
                octets = peer.recv(65536)
                if octets:
                    os.write(self.line, octets)
                else:
                    peer.close()
                    peer = None
            elif self.line in ready:
                octets = os.read(self.line, 65536)
                if peer:
                    peer.sendall(octets)
        if peer:
            peer.close()

    def end(self):
        """Also a second time."""
        if self.listener.fileno() < 0:
            return
        os.write(self._end, b".")
        self._thread.join()
        self.listener.close()
        for descriptor in (self.line, self._ended, self._end):
            os.close(descriptor)


class Server:
    """`srfs-ground serve`, started again after each kill()."""

    def __init__(self, var, *options, port=None):
        self.var = var
        self.port = port or str(var / "rs422")
        self.options = options
        self.process = None
        self.start()

    def start(self):
        command = [str(BIN / "srfs-ground"), "--port", self.port, "--state", str(self.var / "ground"), "serve", *self.options]
        environment = {**os.environ, "SRFS_VAR": str(self.var)}
        self.process = subprocess.Popen(command, stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, text=True, env=environment)
        line = self.process.stdout.readline()
        assert line.startswith("serving"), line

    def kill(self):
        self.process.kill()
        self.process.wait()
        self.process.stdout.close()

    def end(self):
        self.process.terminate()
        self.process.wait(timeout=DEADLINE_S)
        self.process.stdout.close()
        return self.process.returncode


class ServeTest(SystemTest):
    @contextlib.contextmanager
    def served_flight(self, *options):
        with self.flight() as flight:
            server = Server(self.var, *options)
            try:
                yield flight, server
            finally:
                self.assertEqual(server.end(), 0)

    def program(self, *words, **options):
        command = [str(BIN / "srfs-ground"), "--port", str(self.var / "rs422"), *words]
        return subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, **{"stdin": subprocess.DEVNULL, **options})

    def archived(self, *words):
        """What a verb about the archive writes as JSON lines."""
        result = self.ground_run("--json", *words)
        self.assertEqual(result.returncode, 0, result.stderr)
        return [json.loads(line) for line in result.stdout.splitlines()]

    def stored_octets(self):
        return sum(file.stat().st_size for file in (self.var / "store").rglob("*.seg"))

    def counters(self):
        return json.loads((self.var / "ground/uplink.json").read_text())["next_security_counters"]

    def test_a_command_does_not_take_the_line_from_a_folder_that_another_process_owns(self):
        with self.flight():
            state = self.var / "ground"
            state.mkdir(exist_ok=True)
            with open(state / "serve.lock", "w") as lock:
                fcntl.flock(lock, fcntl.LOCK_EX)  # as a server before it has opened its port
                pinging = self.program("ping")
                _, said = pinging.communicate(timeout=DEADLINE_S)
            self.assertNotEqual(pinging.returncode, 0)
            self.assertIn("serve.lock: another srfs-ground owns this folder", said)
            self.assertEqual(self.program("ping").wait(timeout=DEADLINE_S), 0)

    def test_five_tools_share_the_line_and_none_disturbs_another(self):
        with self.served_flight():
            content = random.Random(1).randbytes(60_000)
            source = self.folder / "up.bin"
            source.write_bytes(content)
            listening = self.program("--json", "listen")
            putting = self.program("put", str(source))
            session = self.program("session", stdin=subprocess.PIPE)
            session.stdin.write("ad on\n" + "tc eps.switch_load load=2 state=on\n" * 10)
            session.stdin.close()
            script = self.folder / "pass.txt"
            script.write_text("ad on\n" + "tc eps.switch_load load=1 state=on\nping\n" * 5)
            scripted = self.program("script", str(script))
            pings = [self.ground_run("ping", "--timeout", "30") for _ in range(5)]

            self.assertEqual([p.returncode for p in pings], [0] * 5, [p.stderr for p in pings])
            self.assertEqual(scripted.wait(DEADLINE_S), 0, scripted.stdout.read())
            self.assertEqual(session.wait(DEADLINE_S), 0)
            stages = [json.loads(line) for line in session.stdout.read().splitlines()]
            completed = [s["id"] for s in stages if s["type"] == "tc_stage" and s["stage"] == "completed"]
            self.assertEqual(len(completed), 10)
            self.assertEqual(completed, sorted(completed), "the AD service keeps the order")
            self.assertEqual(putting.wait(2 * DEADLINE_S), 0, putting.stderr.read())
            self.assertEqual((self.var / "files/up.bin").read_bytes(), content)
            self.assertIsNone(listening.poll(), "it still listens")
            listening.send_signal(signal.SIGINT)
            shown, _ = listening.communicate(timeout=DEADLINE_S)
            self.assertEqual(listening.returncode, 0)
            kinds = {json.loads(line)["type"] for line in shown.splitlines()}
            self.assertIn("tm_packet", kinds)
            self.assertNotIn("tc_stage", kinds, "what others command is not its matter")
            for process in (listening, putting, session, scripted):
                for pipe in (process.stdout, process.stderr):
                    pipe.close()

    def test_the_socket_is_the_users_alone_and_rubbish_harms_nobody(self):
        with self.served_flight():
            path = self.var / "ground/serve.sock"
            self.assertEqual(path.stat().st_mode & 0o777, 0o600)
            second = self.ground_run("serve")
            self.assertEqual(second.returncode, 2)
            self.assertIn("another srfs-ground owns this folder", second.stderr)
            rubbish = random.Random(2)
            for _ in range(50):
                client = socket.socket(socket.AF_UNIX, socket.SOCK_SEQPACKET)
                client.connect(str(path))
                with contextlib.suppress(OSError):
                    client.send(rubbish.randbytes(rubbish.randrange(1, 2000)))
                client.close()
            frozen = self.program("listen")
            frozen.send_signal(signal.SIGSTOP)
            try:
                self.assertEqual(self.ground_run("ping", "--timeout", "30").returncode, 0)
            finally:
                frozen.kill()
                frozen.communicate()
            self.assertEqual(self.ground_run("tc", "eps.switch_load", "load=2", "state=on", "--wait").returncode, 0)

    def test_a_line_of_the_network_is_opened_again_when_its_modem_is_back(self):
        with self.flight():
            modem = Modem(self.var / "rs422")
            server = Server(self.var, port=f"tcp:127.0.0.1:{modem.port}")
            try:
                self.assertEqual(self.ground_run("ping").returncode, 0)
                modem.end()
                gone = self.ground_run("ping", "--timeout", "2")
                self.assertNotEqual(gone.returncode, 0, "nobody carries it to the spacecraft")
                modem = Modem(self.var / "rs422", modem.port)
                wait_until(lambda: modem.connections == 1, DEADLINE_S, "the server connects again")
                self.assertEqual(self.ground_run("ping").returncode, 0)
            finally:
                self.assertEqual(server.end(), 0)
                modem.end()

    def test_what_did_not_come_is_retrieved(self):
        with self.served_flight("--fill") as (flight, _):
            for _ in range(2):
                known = len(self.archived("packets"))
                wait_until(lambda k=known: len(self.archived("packets")) > k + 5, DEADLINE_S, "telemetry")
                flight.control({"rs422": {"cut": True}})
                stored = self.stored_octets()
                wait_until(lambda s=stored: self.stored_octets() > s + 3000, DEADLINE_S, "packets that only the spacecraft has")
                flight.control({"rs422": {"cut": False}})
            # Live telemetry is thinned on board, so that there is always a young gap.
            ended = datetime.now(timezone.utc).strftime("%Y-%m-%dT%H:%M:%S")
            old = lambda: [gap for gap in self.archived("gaps") if gap["from"] < ended]  # noqa: E731
            wait_until(old, DEADLINE_S, "the gaps are found")
            # A retrieval that a busy machine cut short is tried again a minute later.
            wait_while_it_goes_on(lambda: all(gap["state"] != "open" for gap in old()), old, 3 * DEADLINE_S, "the gaps are filled")
            self.assertTrue(any(gap["state"] == "filled" for gap in old()), old())
            self.assertTrue(any(packet["retrieved"] and not packet["live"] for packet in self.archived("packets")))
            status = self.archived("station")[0]
            self.assertTrue(status["server"]["locked"])
            self.assertEqual(status["last_telecommand"]["name"], "storage.retrieve")

    def test_a_server_that_is_killed_reuses_no_counter_and_its_clients_go_on(self):
        kills = int(os.environ.get("SRFS_SERVE_KILLS", "12"))
        with self.served_flight() as (_, server):
            session = self.program("session", stdin=subprocess.PIPE)
            lines = []
            reader = threading.Thread(target=lambda: lines.extend(json.loads(line) for line in session.stdout), daemon=True)
            reader.start()
            moments = random.Random(3)
            before = self.counters() if (self.var / "ground/uplink.json").exists() else {}
            completed = lambda: sum(1 for m in lines if m["type"] == "tc_stage" and m["stage"] == "completed")  # noqa: E731
            session.stdin.write("ping\n")  # it is the server's client, and not the owner of a line without one
            session.stdin.flush()
            wait_until(completed, DEADLINE_S, "the session works")
            for number in range(kills):
                for _ in range(3):
                    session.stdin.write("tc eps.switch_load load=2 state=on\n")
                session.stdin.flush()
                time.sleep(moments.uniform(0, 0.3))  # any moment is as good as another
                server.kill()
                server.start()
                now = self.counters()
                for association, value in before.items():
                    self.assertGreaterEqual(now[association], value, f"kill {number}")
                before = now
                done = completed()
                session.stdin.write("tc eps.switch_load load=1 state=on\n")
                session.stdin.flush()
                wait_until(lambda d=done: completed() > d, DEADLINE_S, f"the session goes on after kill {number}")
            # What the spacecraft says after the last of them.
            since = len(lines)
            told = lambda: [m["fields"]["sdls_replays"] for m in lines[since:] if "sdls_replays" in m.get("fields", {})]  # noqa: E731
            wait_until(told, DEADLINE_S, "the counters of the spacecraft's receiver")
            replays = told()
            session.stdin.close()
            self.assertEqual(session.wait(DEADLINE_S), 0)
            reader.join()
            session.stdout.close()
            session.stderr.close()
            ended = [m for m in lines if m["type"] == "tc_stage" and m["final"]]
            self.assertEqual([m for m in ended if m["stage"] in ("rejected", "start_failed", "failed")], [])
            self.assertGreater(completed(), kills)
            # The archive has every packet that was shown, and every telecommand, with what became of it.
            packets = {(m["apid"], m["sequence"], m["time"]) for m in self.archived("packets")}
            shown = {(m["apid"], m["sequence"], m["time"]) for m in lines if m["type"] in ("tm_packet", "beacon", "event", "pong")}
            self.assertGreater(len(shown), kills)
            self.assertEqual(shown - packets, set())
            self.assertEqual(self.ground_run("archive", "check").returncode, 0)
            archived = {c["request"]: c["verdict"] for c in self.archived("commands")}
            done = {m["id"] for m in lines if m["type"] == "tc_stage" and m["stage"] == "completed"}
            self.assertEqual({i: archived.get(i) for i in done}, dict.fromkeys(done, "completed"))
            self.assertEqual(replays[-1], 0, "authentic frames with an old counter")


if __name__ == "__main__":
    unittest.main()
