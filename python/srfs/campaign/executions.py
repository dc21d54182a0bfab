# SPDX-FileCopyrightText: 2026 SRFS contributors
# SPDX-License-Identifier: Apache-2.0
"""The telecommands that the simulated peripherals executed: an independent record for the campaigns."""

import json
import socket

from srfs.flight.deployments import PAYLOADS


class Executions:
    def __init__(self, run_dir):
        self.of = {payload: [] for payload in PAYLOADS}  # ids in order
        self.unseen = 0  # hw_sim had dropped them before the query
        self._counts = dict.fromkeys(PAYLOADS, 0)
        self._socket = run_dir / "sim_control.sock"

    def __len__(self):
        return sum(map(len, self.of.values()))

    def ask(self):
        """Adds the executions since the last call. Uses the control socket directly, because frequent calls must not start processes."""
        with socket.socket(socket.AF_UNIX, socket.SOCK_SEQPACKET) as control:
            control.settimeout(5)
            control.connect(str(self._socket))
            control.send(b'{"query":"executed"}')
            reply = json.loads(control.recv(1 << 18))["executed"]
        for payload in PAYLOADS:
            peripheral = reply[payload.removeprefix("payload_")]
            last, count = peripheral["last"], peripheral["count"]
            new = count - self._counts[payload]
            self.unseen += max(0, new - len(last))
            self.of[payload] += last[len(last) - min(new, len(last)) :]
            self._counts[payload] = count
