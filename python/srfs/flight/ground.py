# SPDX-FileCopyrightText: 2026 SRFS contributors
# SPDX-License-Identifier: Apache-2.0
"""The operator's session, and every other child process that prints JSON lines."""

import contextlib
import json
import subprocess
import threading
import time

from srfs.flight.processes import PATIENCE, stop_child
from srfs.program import MissionError

ANSWER_DEADLINE_S = 60 * PATIENCE  # ends with the answer; so long at most, on a machine that others use, too


class Lines:
    """A child process that prints one JSON object a line; a thread collects them with the time of their arrival."""

    def __init__(self, command, log_path, stdin=None):
        self.log_path = log_path
        with open(log_path, "ab") as log:
            self.process = subprocess.Popen(
                command, stdin=stdin, stdout=subprocess.PIPE, stderr=log, start_new_session=True, text=True, bufsize=1
            )
        self.messages = []  # everything that came, in order; "arrived" is added (time.monotonic)
        self._news = threading.Condition()
        self._listeners = []
        self._thread = threading.Thread(target=self._read, daemon=True)
        self._thread.start()

    def _read(self):
        for line in self.process.stdout:
            try:
                message = json.loads(line)
            except ValueError:
                message = {"type": "garbled", "text": line}
            message["arrived"] = time.monotonic()
            with self._news:
                self.messages.append(message)
                self._news.notify_all()
            for listener in self._listeners:
                listener(message)
        with self._news:
            self._news.notify_all()

    def on_message(self, listener):
        """Calls listener(message) in the reading thread for everything that comes from now on."""
        self._listeners.append(listener)

    def position(self):
        with self._news:
            return len(self.messages)

    def find(self, matches, since=0):
        """The first message from position `since` on for which matches(message) is true, or None."""
        with self._news:
            return next((m for m in self.messages[since:] if matches(m)), None)

    def select(self, matches, since=0):
        with self._news:
            return [m for m in self.messages[since:] if matches(m)]

    def wait_for(self, matches, deadline_s, since=0):
        """As find, waiting for it; None after deadline_s or when the process ended."""
        end = time.monotonic() + deadline_s
        looked_at = since
        with self._news:
            while True:
                for message in self.messages[looked_at:]:
                    if matches(message):
                        return message
                looked_at = len(self.messages)
                left = end - time.monotonic()
                if left <= 0 or not self._thread.is_alive():
                    return None
                self._news.wait(min(left, 0.5))

    def end(self):
        if self.process.stdin:
            with contextlib.suppress(OSError):
                self.process.stdin.close()
        stop_child(self.process)
        self._thread.join(2)
        self.process.stdout.close()


class GroundSession(Lines):
    """`srfs-ground session`: sends command lines, collects everything that the spacecraft says."""

    def __init__(self, mission):
        super().__init__(mission.ground_command("--json", "session"), mission.var / "log" / "ground.log", stdin=subprocess.PIPE)
        self._line = 0
        self.sent_ns = {}  # line number -> CLOCK_MONOTONIC just before it was written

    def send(self, line):
        """Writes one command line; returns its number, which everything it causes carries."""
        self._line += 1
        self.sent_ns[self._line] = time.monotonic_ns()
        try:
            self.process.stdin.write(line + "\n")
            self.process.stdin.flush()
        except OSError as error:
            raise MissionError(f"srfs-ground ended: see {self.log_path}") from error
        return self._line

    def outcome(self, line, deadline_s):
        """The final stage of the telecommand of a line, or the error that kept it from being sent; None: neither came."""
        return self.wait_for(
            lambda m: m.get("line") == line and (m["type"] == "error" or m["type"] == "tc_stage" and m["final"]), deadline_s
        )

    def command(self, text, deadline_s=ANSWER_DEADLINE_S):
        """Sends a line and waits for its outcome."""
        return self.outcome(self.send(text), deadline_s)

    def housekeeping(self, structure, deadline_s=ANSWER_DEADLINE_S, since=None, matches=lambda fields: True):
        """The next live packet of a structure whose fields match; None after deadline_s."""
        since = self.position() if since is None else since
        return self.wait_for(
            lambda m: m.get("structure") == structure and m.get("vc") == 0 and matches(m["fields"]), deadline_s, since
        )

    def fresh(self, structure, deadline_s=ANSWER_DEADLINE_S):
        """Asks for a structure now, again while that is refused (its node may have to come yet), and returns its fields; None when it did not
        come."""
        since = self.position()
        end = time.monotonic() + deadline_s
        is_packet = lambda m: m.get("structure") == structure and m.get("vc") == 0  # noqa: E731
        while True:
            line = self.send(f"tc housekeeping.one_shot structure={structure}")
            refused = lambda m, line=line: m.get("line") == line and m["type"] == "tc_stage" and m["final"] and m["stage"] != "completed"  # noqa: E731
            answer = self.wait_for(lambda m: is_packet(m) or refused(m), end - time.monotonic(), since)
            if answer and not is_packet(answer):
                answer = self.wait_for(is_packet, min(0.5, end - time.monotonic()), since)
            if answer or time.monotonic() > end:
                return answer["fields"] if answer else None

    def stats(self, deadline_s=ANSWER_DEADLINE_S):
        since = self.position()
        self.send("stats")
        return self.wait_for(lambda m: m["type"] == "stats", deadline_s, since)
