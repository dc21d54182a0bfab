# SPDX-FileCopyrightText: 2026 SRFS contributors
# SPDX-License-Identifier: Apache-2.0
"""CLTUs with and without faults, independent of the flight code (CCSDS 231.0-B sections 3 and 6, 232.0-B section 4)."""

import binascii

START_SEQUENCE = bytes.fromhex("eb90")
TAIL_SEQUENCE = bytes.fromhex("c5c5c5c5c5c5c579")


def crc(octets):
    """Frame error control field: CRC-16 with polynomial 1021, initial value FFFF."""
    return binascii.crc_hqx(octets, 0xFFFF).to_bytes(2, "big")


def parity(block):
    """Last octet of a BCH(63,56) code block: seven inverted parity bits and the filler."""
    register = 0
    for octet in block:
        for bit in range(7, -1, -1):
            feedback = (octet >> bit & 1) ^ (register >> 6)
            register = (register << 1) & 0x7F ^ (0x45 if feedback else 0)
    return bytes([(~register & 0x7F) << 1])


def cltu(frame):
    frame += b"\x55" * (-len(frame) % 7)
    blocks = (frame[i : i + 7] for i in range(0, len(frame), 7))
    return START_SEQUENCE + b"".join(block + parity(block) for block in blocks) + TAIL_SEQUENCE


def frame(body, scid=0xAB, vc=0, length=None):
    """A BD frame around a body, with a correct checksum. length: the frame length in the header, if not the true one."""
    total = 5 + len(body) + 2
    said = (total if length is None else length) - 1
    header = bytes([0x20 | scid >> 8, scid & 0xFF, vc << 2 | said >> 8, said & 0xFF, 0])
    return header + body + crc(header + body)
