# SPDX-FileCopyrightText: 2026 SRFS contributors
# SPDX-License-Identifier: Apache-2.0
"""The sending end of COP-1's AD service, written from CCSDS 232.1-B-2 section 5 alone, without the project's code. States:
S1 (active), S2 (retransmit without wait), S3 (retransmit with wait), S5 (initialising with BC frame), S6 (initial). It drives an
OpenStation and is as simple as the standard allows: one wait queue, one sent queue, timeout type 0.
"""

import time
from dataclasses import dataclass

import cltu
from open_link import SEGMENT_HEADER, UNSECURED_VC, tc_packet

WINDOW = 8  # K, at most the spacecraft's positive window (32)
T1_S = 3.0
TRANSMISSION_LIMIT = 40


@dataclass
class Clcw:
    """232.0-B-3, 4.2."""

    vc: int
    lockout: bool
    wait: bool
    retransmit: bool
    farm_b: int
    nr: int

    @classmethod
    def read(cls, word):
        assert word >> 31 == 0 and word >> 29 & 3 == 0, f"{word:08x} is no CLCW of version 1"
        assert word >> 24 & 3 == 1, f"{word:08x}: COP in effect is not COP-1"
        assert word & 0x00030100 == 0, f"{word:08x}: spare bits are set"
        return cls(word >> 18 & 0x3F, bool(word >> 13 & 1), bool(word >> 12 & 1), bool(word >> 11 & 1), word >> 9 & 3, word & 0xFF)


class Alert(Exception):
    """The AD service ended (5.2.15)."""


def frame(kind, data, sequence=0, scid=0xAB, vc=UNSECURED_VC):
    """A TC transfer frame: kind AD, BD or BC (232.0-B-3, 4.1.2)."""
    flags = {"AD": 0x00, "BD": 0x20, "BC": 0x30}[kind]
    last = 5 + len(data) + 2 - 1
    header = bytes([flags | scid >> 8, scid & 0xFF, vc << 2 | last >> 8, last & 0xFF, sequence])
    return header + data + cltu.crc(header + data)


class FopClient:
    """AD service over an OpenStation.

    lose(n) decides whether the n-th AD transmission (from 0, including retransmissions) is lost on its way up.
    """

    def __init__(self, station, lose=lambda transmission: False):
        self._station = station
        self._lose = lose
        self._state = "S6"
        self._vs = 0
        self._nnr = 0
        self._sent = []  # (N(S), data), oldest first
        self._wait = []
        self._timer = None
        self._count = 1  # Transmission_Count
        self._bc = None
        self._looked_at = 0
        self.transmissions = 0
        self.lost = 0
        self.clcw = None
        self.packets = 0

    # ---- directives

    def set_vr(self, vr):
        """Initiate AD service with Set V(R) (E27)."""
        self._vs = self._nnr = vr
        self._begin(bytes([0x82, 0x00, vr]))

    def unlock(self):
        """Set V(S) (E35) from the last CLCW, then initiate AD service with Unlock (E25)."""
        self._vs = self._nnr = self.clcw.nr
        self._begin(bytes([0x00]))

    def _begin(self, control):
        self._sent, self._wait, self._count = [], [], 1
        self._bc = control
        self._state = "S5"
        self._transmit_bc()
        self._run(lambda: self._state == "S1", 60, "the spacecraft did not execute the control command")

    # ---- requests

    def send(self, apid, service, subtype, data=b""):
        """Queues a telecommand; returns its request id."""
        self.packets += 1  # counted apart from the telecommands that the station itself sends
        packet = tc_packet(apid, service, subtype, data, 0x1000 + self.packets)
        self._wait.append(SEGMENT_HEADER + packet)
        self._look_for_frame()
        return packet[:4]

    def finish(self, deadline_s):
        """Waits until every frame is acknowledged."""
        self._run(lambda: not self._sent and not self._wait, deadline_s, "frames are not acknowledged")

    def wait_for_clcw(self, matches, deadline_s):
        self._run(lambda: self.clcw is not None and matches(self.clcw), deadline_s, f"no such CLCW, the last: {self.clcw}")

    # ---- the machine

    def _run(self, over, deadline_s, complaint):
        end = time.monotonic() + deadline_s
        while not over():
            assert time.monotonic() < end, f"{complaint} (state {self._state}, V(S) {self._vs}, NN(R) {self._nnr}, {self.clcw})"
            self._station.wait_for(lambda report: False, 0.02, len(self._station.reports))
            words = self._station.control_words
            for word in words[self._looked_at :]:
                clcw = Clcw.read(word)
                if clcw.vc == UNSECURED_VC:
                    self.clcw = clcw
                    self._on_clcw(clcw)
            self._looked_at = len(words)
            if self._timer is not None and time.monotonic() >= self._timer:
                self._on_timer()

    def _on_clcw(self, clcw):
        if self._state == "S6":
            return
        if self._state == "S5":
            if not clcw.lockout and not clcw.retransmit and not clcw.wait and clcw.nr == self._vs == self._nnr:
                self._state, self._bc, self._timer = "S1", None, None  # E1
            return
        if clcw.lockout:
            self._alert(f"LOCKOUT: {clcw}")
        acknowledged = (clcw.nr - self._nnr) % 256
        if acknowledged > (self._vs - self._nnr) % 256:
            self._alert(f"NN(R): {clcw}")
        everything = clcw.nr == self._vs
        if (everything and clcw.retransmit) or (not clcw.retransmit and acknowledged == 0 and self._state != "S1"):
            self._alert(f"SYNCH: {clcw}")
        if clcw.wait and not clcw.retransmit:
            self._alert(f"CLCW: {clcw}")
        if acknowledged:
            del self._sent[:acknowledged]
            self._nnr = clcw.nr
            self._count = 1
        if not clcw.retransmit:  # E1, E2, E5, E6
            self._state = "S1"
            if everything:
                self._timer = None
            self._look_for_frame()
        elif clcw.wait:  # E9, E11
            self._state = "S3"
        elif acknowledged or self._state != "S2":  # E8, E10
            self._state = "S2"
            self._retransmit()

    def _on_timer(self):
        self._timer = None
        if self._count >= TRANSMISSION_LIMIT:
            self._alert("T1")
        if self._state == "S5":
            self._count += 1
            self._transmit_bc()
        elif self._state in ("S1", "S2"):
            self._retransmit()

    def _retransmit(self):
        self._count += 1
        for sequence, data in self._sent:
            self._transmit_ad(sequence, data)
        self._look_for_frame()

    def _look_for_frame(self):
        while self._wait and self._state in ("S1", "S2") and (self._vs - self._nnr) % 256 < WINDOW:
            if not self._sent:
                self._count = 1
            self._sent.append((self._vs, self._wait.pop(0)))
            self._transmit_ad(*self._sent[-1])
            self._vs = (self._vs + 1) % 256

    def _transmit_ad(self, sequence, data):
        self._timer = time.monotonic() + T1_S
        if self._lose(self.transmissions):
            self.lost += 1
        else:
            self._station.write(cltu.cltu(frame("AD", data, sequence)))
        self.transmissions += 1

    def _transmit_bc(self):
        self._timer = time.monotonic() + T1_S
        self._station.write(cltu.cltu(frame("BC", self._bc)))

    def _alert(self, reason):
        self._state, self._timer, self._sent, self._wait = "S6", None, [], []
        raise Alert(reason)
