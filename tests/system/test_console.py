# SPDX-FileCopyrightText: 2026 SRFS contributors
# SPDX-License-Identifier: Apache-2.0
"""`srfs-ground console` in a terminal emulator (pyte): what an operator sees and types over ssh."""

import contextlib
import fcntl
import os
import pty
import re
import select
import signal
import struct
import subprocess
import termios
import threading
import unittest

import pyte
from support import BIN, DEADLINE_S, SystemTest

from srfs.flight.processes import wait_until
from srfs.program import MissionError


class Console:
    """The program in a pseudo terminal, and the screen that a terminal would show."""

    def __init__(self, var, rows=24, columns=80, term="xterm-256color", lang="C.UTF-8"):
        self.screen = pyte.Screen(columns, rows)
        self.stream = pyte.ByteStream(self.screen)
        self.seen = b""
        self.lock = threading.Lock()
        self.far, near = pty.openpty()
        self.set_size(rows, columns)
        self.before = termios.tcgetattr(near)
        environment = {**os.environ, "TERM": term, "LC_ALL": lang}
        self.process = subprocess.Popen([str(BIN / "srfs-ground"), "--port", str(var / "rs422"), "console"], stdin=near, stdout=near, stderr=subprocess.PIPE,
                                        env=environment, start_new_session=True, preexec_fn=lambda: fcntl.ioctl(0, termios.TIOCSCTTY, 0))  # fmt: skip
        self.near = near
        self.thread = threading.Thread(target=self.read, daemon=True)
        self.thread.start()

    def set_size(self, rows, columns):
        with self.lock:
            fcntl.ioctl(self.far, termios.TIOCSWINSZ, struct.pack("HHHH", rows, columns, 0, 0))
            self.screen.resize(rows, columns)

    def read(self):
        while select.select([self.far], [], [], 0.2)[0] or self.process.poll() is None:
            with contextlib.suppress(OSError):
                if select.select([self.far], [], [], 0)[0]:
                    octets = os.read(self.far, 65536)
                    with self.lock:
                        self.seen += octets
                        self.stream.feed(octets)

    def type(self, text):
        os.write(self.far, text.encode())

    def text(self):
        with self.lock:
            return "\n".join(self.screen.display)

    def wait_for(self, text):
        try:
            wait_until(lambda: text in self.text(), DEADLINE_S, repr(text))
        except MissionError as error:
            raise AssertionError(f"{error}\n{self.text()}\nexit code: {self.process.poll()}") from None

    def end(self):
        """The exit code; the terminal is as it was before."""
        self.process.wait(timeout=DEADLINE_S)
        error = self.process.stderr.read().decode()
        self.process.stderr.close()
        self.thread.join(DEADLINE_S)
        same = termios.tcgetattr(self.near) == self.before
        os.close(self.near)
        os.close(self.far)
        return self.process.returncode, error, same


class ConsoleTest(SystemTest):
    @contextlib.contextmanager
    def serving(self):
        server = []

        def start():
            command = [str(BIN / "srfs-ground"), "--port", str(self.var / "rs422"), "serve"]
            server[:] = [subprocess.Popen(command, stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, text=True)]
            self.assertTrue(server[0].stdout.readline().startswith("serving"))

        def kill():
            server[0].kill()
            server[0].wait()
            server[0].stdout.close()

        start()
        try:
            yield start, kill
        finally:
            if server[0].returncode is None:
                kill()

    def test_an_operator_commands_and_sees_what_happens_over_a_restart_of_the_server(self):
        with self.flight(), self.serving() as (start, kill):
            console = Console(self.var)
            console.wait_for("mode nominal")
            console.wait_for("line open")
            # Completion, then a telecommand to its end.
            console.type("tc eps.sw\t")
            console.wait_for("> tc eps.switch_load")
            console.type("load=2 st\t")
            console.type("on\r")
            console.wait_for("eps.switch_load completed")
            # Refused as by tc, before anything is sent.
            console.type("tc eps.swich_load load=2 state=on\r")
            console.wait_for("did you mean 'eps.switch_load'")
            console.type("tc eps.switch_load load=77 state=on\r")
            console.wait_for("out of range")
            # A report that a telecommand orders is shown.
            console.type("view ttc\r")
            console.wait_for("[ttc]")
            console.type("ping\r")
            console.wait_for("ttc.ping completed")
            # A hazardous one is asked about, armed, and sent.
            console.type("tc eps.power_cycle_peripheral off_ms=100\r")
            console.wait_for("is hazardous. Arm it")
            console.type("no\r")
            console.wait_for("nothing was sent: the answer was not yes")
            console.type("\x1bOA\r")  # Up: the line before
            console.wait_for("is hazardous. Arm it")
            console.type("yes\r")
            console.wait_for("eps.power_cycle_peripheral completed")
            # Larger, with limits and events at the side; then so small that nothing fits.
            console.set_size(40, 132)
            console.wait_for("limits out")
            console.set_size(8, 30)
            console.wait_for("too small")
            console.set_size(24, 80)
            console.wait_for("mode nominal")
            # The server is killed, and comes back.
            kill()
            console.wait_for("NO SERVER")
            console.type("ping\r")
            console.wait_for("there is no server now")
            start()
            console.wait_for("connected to the next one")
            console.type("tc housekeeping.one_shot structure=timing\r")
            console.wait_for("housekeeping.one_shot completed")
            console.type("quit\r")
            self.assertEqual(console.end(), (0, "", True))
            names = [line.split()[0] for line in (self.var / "ground/console_history").read_text().splitlines()]
            self.assertEqual(names[-1], "quit")
            self.assertNotIn("yes", names, "answers are no lines")

            # A terminal without colours and without UTF-8; a signal ends it in order.
            console = Console(self.var, term="vt100", lang="C")
            console.wait_for("mode nominal")
            self.assertIsNone(re.search(rb"\x1b\[(\d+;)*3\d(;\d+)*m", console.seen), "no colours")
            self.assertTrue(console.seen.isascii())
            console.type("\x1b[A")
            console.wait_for("> quit")
            console.process.send_signal(signal.SIGTERM)
            self.assertEqual(console.end(), (0, "", True))

            # What is missing is said.
            refused = self.ground_run("console")
            self.assertEqual(refused.returncode, 2)
            self.assertIn("it needs a terminal", refused.stderr)
            code, error, same = Console(self.var, term="no-such-terminal").end()
            self.assertEqual((code, same), (2, True))
            self.assertIn("'no-such-terminal' is not known", error)
            kill()
            refused = self.ground_run("console")
            self.assertEqual(refused.returncode, 2)
            self.assertIn("start it: srfs-ground serve", refused.stderr)


if __name__ == "__main__":
    unittest.main()
