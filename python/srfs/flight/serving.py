# SPDX-FileCopyrightText: 2026 SRFS contributors
# SPDX-License-Identifier: Apache-2.0
"""`srfs-ground serve` beside a flight, with the operator's page."""

import json
import queue
import subprocess
import threading

from srfs.flight.ground import ANSWER_DEADLINE_S
from srfs.flight.processes import stop_child
from srfs.program import MissionError


class GroundServer:
    """Owns the line of a flight until stop(). `url` opens the page with the token that commands."""

    def __init__(self, bin_dir, var, deployment, address="127.0.0.1:0", log_path=None):
        log = open(log_path, "ab") if log_path else subprocess.DEVNULL
        command = [str(bin_dir / "srfs-ground"), "--port", str(var / "rs422"), "--deployment", str(deployment), "serve", "--web", address]
        self.process = subprocess.Popen(command, stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=log, start_new_session=True, text=True)
        if log_path:
            log.close()
        self.web_file = var / "ground" / "web.json"
        self._lines = queue.Queue()
        threading.Thread(target=self._read, daemon=True).start()
        self.url = self._wait_for_address(log_path)

    def _read(self):
        for line in self.process.stdout:
            self._lines.put(line.strip())
        self._lines.put(None)

    def _wait_for_address(self, log_path):
        while True:
            try:
                line = self._lines.get(timeout=ANSWER_DEADLINE_S)
            except queue.Empty:
                line = None
            if line is None:
                self.stop()
                why = log_path.read_text(errors="replace").strip().splitlines()[-1:] if log_path else []
                raise MissionError(f"srfs-ground serve --web does not serve{': ' + why[0] if why else ''}")
            if line.startswith("web: "):
                return line.removeprefix("web: ")

    def observing_url(self):
        """The page with the token that may only observe."""
        known = json.loads(self.web_file.read_text())
        return f"{known['url']}/#token={known['observe']}"

    def stop(self):
        stop_child(self.process)
        self.process.stdout.close()
