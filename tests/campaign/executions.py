# SPDX-FileCopyrightText: 2026 SRFS contributors
# SPDX-License-Identifier: Apache-2.0
"""What the simulated peripherals executed of telecommands: the campaigns' independent record."""

import json
import socket

NAMES = {"payload_adcs": "adcs", "payload_eps": "eps", "payload_thermal": "thermal"}  # of a payload's peripheral in hw_sim


class Executions:
    def __init__(self, run_dir):
        self.of = {payload: [] for payload in NAMES}  # ids in order
        self.unseen = 0  # hw_sim had forgotten them when it was asked
        self._counts = dict.fromkeys(NAMES, 0)
        self._socket = run_dir / "sim_control.sock"

    def __len__(self):
        return sum(map(len, self.of.values()))

    def ask(self):
        """What was executed since the last time. Asked on the control socket itself: often, and without a process each time."""
        with socket.socket(socket.AF_UNIX, socket.SOCK_SEQPACKET) as control:
            control.settimeout(5)
            control.connect(str(self._socket))
            control.send(b'{"query":"executed"}')
            reply = json.loads(control.recv(1 << 18))["executed"]
        for payload, name in NAMES.items():
            last, count = reply[name]["last"], reply[name]["count"]
            new = count - self._counts[payload]
            self.unseen += max(0, new - len(last))
            self.of[payload] += last[len(last) - min(new, len(last)) :]
            self._counts[payload] = count
