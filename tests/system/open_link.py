# SPDX-FileCopyrightText: 2026 SRFS contributors
# SPDX-License-Identifier: Apache-2.0
"""An independent ground station for TC virtual channel 1, without the project's code: encodes telecommand packets to octets of the line,
decodes octets of the line to telemetry packets, and reads housekeeping structures by the dictionary's YAML.

Sources: CCSDS 133.0-B (packet), 232.0-B and 231.0-B (TC, in cltu.py), 132.0-B and 131.0-B (TM), ECSS-E-ST-70-41C 7.4 (PUS-C).
"""

import os
import pathlib
import select
import struct
import time
import tty

import cltu
import yaml

ROOT = pathlib.Path(__file__).resolve().parents[2]
DICTIONARY = [*(ROOT / "msgs/mission").glob("*.yaml"), *(ROOT / "mission").rglob("*.yaml")]
ASM = bytes.fromhex("1acffc1d")
FRAME_OCTETS = 223  # times the interleave
CODED_OCTETS = 255  # frame and parity of RS(255,223), times the interleave; a clean line needs no correction
UNSECURED_VC = 1
SEGMENT_HEADER = b"\xc0"


def pseudo_noise(count):
    """The TM randomizer's sequence: x^8 + x^7 + x^5 + x^3 + 1, all ones at the start (131.0-B, 10.4)."""
    bits, register = [], [1] * 8
    for _ in range(8 * count):
        bits.append(register[0])
        register = register[1:] + [register[0] ^ register[3] ^ register[5] ^ register[7]]
    return bytes(int("".join(map(str, bits[i : i + 8])), 2) for i in range(0, len(bits), 8))


def tc_packet(apid, service, subtype, data=b"", sequence=0, acknowledge=0xF):
    body = bytes([0x20 | acknowledge, service, subtype, 0, 0]) + data
    packet = struct.pack(">HHH", 0x1800 | apid, 0xC000 | sequence, len(body) + 1) + body
    return packet + cltu.crc(packet)


def telecommand_octets(packet):
    return cltu.cltu(cltu.frame(SEGMENT_HEADER + packet, vc=UNSECURED_VC))


class Report:
    """A TM packet: apid, service, subtype, data (without headers and checksum)."""

    def __init__(self, packet):
        assert cltu.crc(packet) == b"\0\0", "the checksum of a TM packet is wrong"
        self.apid = struct.unpack(">H", packet[:2])[0] & 0x7FF
        self.service, self.subtype = packet[7], packet[8]
        self.data = packet[6 + 15 : -2]

    def __repr__(self):
        return f"{self.service},{self.subtype} of {self.apid}: {self.data.hex()}"


class Structure:
    """A housekeeping structure of the dictionary; decodes fields of fixed length only."""

    SIZES = {"u8": ("B", 1), "u16": ("H", 2), "u32": ("I", 4), "u64": ("Q", 8), "i8": ("b", 1), "i16": ("h", 2), "i32": ("i", 4),
             "i64": ("q", 8), "f32": ("f", 4), "f64": ("d", 8), "bool": ("?", 1)}  # fmt: skip

    def __init__(self, name):
        self._all = {s["name"]: s for file in DICTIONARY for s in yaml.safe_load(file.read_text()).get("structures", [])}
        self.id = self._all[name]["id"]
        self._fields = list(self._flatten(self._all[name]["fields"]))

    def _flatten(self, fields):
        for field in fields:
            if "structure" in field:
                yield from self._flatten(self._all[field["structure"]]["fields"])
            else:
                yield field

    def decode(self, data):
        values, at = {}, 0
        for field in self._fields:
            letter, size = self.SIZES[field["type"]]
            count = field.get("count", 1)
            found = struct.unpack_from(f">{count}{letter}", data, at)
            values[field["name"]] = found[0] if count == 1 else list(found)
            at += count * size
        assert at == len(data), f"{len(data)} octets, the dictionary says {at}"
        return values


class OpenStation:
    """Holds the operator's end of the line."""

    def __init__(self, port, interleave=1):
        self._frame_octets, self._coded_octets = interleave * FRAME_OCTETS, interleave * CODED_OCTETS
        self._line = os.open(port, os.O_RDWR | os.O_NOCTTY | os.O_NONBLOCK)
        tty.setraw(self._line)
        self._noise = pseudo_noise(self._coded_octets)
        self._received = b""
        self._unfinished = {}  # virtual channel -> octets of a packet that continues in the next frame
        self._counts = {}  # virtual channel -> count of its last frame
        self._sequence = 0
        self.reports = []
        self.control_words = []  # one per frame
        self.frames = 0

    def close(self):
        os.close(self._line)

    def write(self, octets):
        while octets:
            select.select([], [self._line], [], 5)
            octets = octets[os.write(self._line, octets[:512]) :]

    def send(self, apid, service, subtype, data=b""):
        """Sends a telecommand; returns its request id (the first four octets of the packet)."""
        self._sequence += 1
        packet = tc_packet(apid, service, subtype, data, self._sequence)
        self.write(telecommand_octets(packet))
        return packet[:4]

    def wait_for(self, matches, deadline_s, since=0):
        """The first report from position `since` on that matches; None after deadline_s."""
        end = time.monotonic() + deadline_s
        looked_at = since
        while True:
            for report in self.reports[looked_at:]:
                if matches(report):
                    return report
            looked_at = len(self.reports)
            left = end - time.monotonic()
            if left <= 0:
                return None
            if select.select([self._line], [], [], min(left, 0.2))[0]:
                self._take(os.read(self._line, 65536))

    def verification(self, request, subtype, deadline_s, since=0):
        return self.wait_for(lambda r: r.service == 1 and r.subtype == subtype and r.data[:4] == request, deadline_s, since)

    def _take(self, octets):
        self._received += octets
        while (at := self._received.find(ASM)) >= 0 and len(self._received) >= at + len(ASM) + self._coded_octets:
            coded = self._received[at + len(ASM) : at + len(ASM) + self._coded_octets]
            frame = bytes(a ^ b for a, b in zip(coded, self._noise))[:self._frame_octets]
            if cltu.crc(frame) != b"\0\0":  # the marker occurred within other octets, or the frame is damaged
                self._received = self._received[at + 1 :]
                continue
            self._received = self._received[at + len(ASM) + self._coded_octets :]
            self.frames += 1
            self._take_frame(frame)

    def _take_frame(self, frame):
        channel = frame[1] >> 1 & 0x7
        assert (frame[0] << 4 | frame[1] >> 4) & 0x3FF == 0xAB, "another spacecraft's frame"
        self.control_words.append(struct.unpack(">I", frame[-6:-2])[0])
        first_header = struct.unpack(">H", frame[4:6])[0] & 0x7FF
        if self._counts.get(channel, frame[3] - 1) + 1 & 0xFF != frame[3]:  # a frame of this channel was lost
            self._unfinished.pop(channel, None)
        self._counts[channel] = frame[3]
        if first_header == 0x7FE:  # idle data only
            return
        data = frame[6:-6]  # control word and checksum follow
        if channel not in self._unfinished:  # the station started in the middle of a packet
            if first_header == 0x7FF:
                return
            data = data[first_header:]
        stream = self._unfinished.get(channel, b"") + data
        while len(stream) >= 6 and len(stream) >= (length := struct.unpack(">H", stream[4:6])[0] + 7):
            if struct.unpack(">H", stream[:2])[0] & 0x7FF != 0x7FF:
                self.reports.append(Report(stream[:length]))
            stream = stream[length:]
        self._unfinished[channel] = stream
