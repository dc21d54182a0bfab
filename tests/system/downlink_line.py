# SPDX-FileCopyrightText: 2026 SRFS contributors
# SPDX-License-Identifier: Apache-2.0
"""A stranger on the downlink, without keys and without the project's code: hears every CADU between the spacecraft and a ground station of
its own, and writes CADUs between them: what it heard, altered or not, and what it makes.

Sources: CCSDS 131.0-B (marker, randomizer in open_link.py, Reed-Solomon (255,223) in the dual basis) and 132.0-B (TM frames).
"""

import os
import select
import threading
import tty

import cltu
from open_link import ASM, CODED_OCTETS, FRAME_OCTETS, pseudo_noise

CADU_OCTETS = len(ASM) + CODED_OCTETS
PARITY_OCTETS = CODED_OCTETS - FRAME_OCTETS
NOISE = pseudo_noise(CODED_OCTETS)
DUAL_BASIS_ROWS = (0x8D, 0xEF, 0xEC, 0x86, 0xFA, 0x99, 0xAF, 0x7B)  # 131.0-B, annex F
IDLE_VC = 7


def _galois():
    powers, value = [], 1
    for _ in range(255):
        powers.append(value)
        value = value << 1 ^ (0x187 if value & 0x80 else 0)
    return powers, {value: power for power, value in enumerate(powers)}


POWERS, LOGARITHMS = _galois()


def _times(a, b):
    return POWERS[(LOGARITHMS[a] + LOGARITHMS[b]) % 255] if a and b else 0


def _generator():
    """Of the roots alpha^(11 j), j from 112 to 143; highest power first."""
    polynomial = [1]
    for j in range(112, 112 + PARITY_OCTETS):
        root = POWERS[11 * j % 255]
        polynomial = [a ^ _times(b, root) for a, b in zip([*polynomial, 0], [0, *polynomial])]
    return polynomial


def _to_dual(octet):
    dual = 0
    for bit in range(8):
        if octet >> bit & 1:
            dual ^= DUAL_BASIS_ROWS[7 - bit]
    return dual


GENERATOR = _generator()
DUAL = [_to_dual(octet) for octet in range(256)]
CONVENTIONAL = {dual: octet for octet, dual in enumerate(DUAL)}


def parity(frame):
    """Of 223 octets in the dual basis."""
    register = [0] * PARITY_OCTETS
    for octet in frame:
        feedback = CONVENTIONAL[octet] ^ register[0]
        register = [a ^ _times(feedback, b) for a, b in zip([*register[1:], 0], GENERATOR[1:])]
    return bytes(DUAL[octet] for octet in register)


def cadu(frame):
    """Of a frame without its FECF, which is made."""
    whole = frame + cltu.crc(frame)
    return ASM + bytes(a ^ b for a, b in zip(whole + parity(whole), NOISE))


def frame_in(octets):
    """The frame of a CADU that came without damage, without its FECF."""
    return bytes(a ^ b for a, b in zip(octets[len(ASM) :], NOISE))[: FRAME_OCTETS - 2]


class DownlinkLine(threading.Thread):
    """Between the spacecraft's line and a new one; `port` is the station's end."""

    def __init__(self, spacecraft_port):
        super().__init__(daemon=True)
        self._spacecraft = os.open(spacecraft_port, os.O_RDWR | os.O_NOCTTY | os.O_NONBLOCK)
        tty.setraw(self._spacecraft)
        self._station, self._kept_open = os.openpty()
        tty.setraw(self._kept_open)
        self.port = os.ttyname(self._kept_open)
        self.heard = []  # CADUs of the spacecraft, in order
        self._injected = []
        self.written = 0  # CADUs of the stranger that are on the line
        self._lock = threading.Lock()
        self._ended = threading.Event()
        self.start()

    def write(self, cadus):
        """Between CADUs of the spacecraft, as soon as possible."""
        with self._lock:
            self._injected += cadus

    def run(self):
        down = b""
        while not self._ended.is_set():
            ready = select.select([self._spacecraft, self._station], [], [], 0.01)[0]
            if self._station in ready:
                self._write_all(self._spacecraft, os.read(self._station, 4096))
            if self._spacecraft in ready:
                down = self._forward(down + os.read(self._spacecraft, 65536))
            if not down:
                self._inject()

    def _forward(self, octets):
        """Whole CADUs alone; what was begun before this line was opened is lost."""
        at = octets.find(ASM)
        octets = octets[at:] if at >= 0 else octets[-len(ASM) + 1 :]
        while octets.startswith(ASM) and len(octets) >= CADU_OCTETS:
            one, octets = octets[:CADU_OCTETS], octets[CADU_OCTETS:]
            self.heard.append(one)
            self._write_all(self._station, one)
        return octets

    def _inject(self):
        with self._lock:
            some, self._injected = self._injected[:8], self._injected[8:]
        for one in some:
            self._write_all(self._station, one)
            self.written += 1

    @staticmethod
    def _write_all(line, octets):
        while octets:
            select.select([], [line], [], 1)
            octets = octets[os.write(line, octets) :]

    def stop(self):
        self._ended.set()
        self.join()
        for line in (self._spacecraft, self._station, self._kept_open):
            os.close(line)
