#!/usr/bin/python3
# SPDX-FileCopyrightText: 2026 SRFS contributors
# SPDX-License-Identifier: Apache-2.0
"""Makes tycho2_bright.bin from Debian's astrometry-data-tycho2-07-littleendian (its FITS file is the first argument).

One star in seven octets, brightest first: right ascension and declination as shares of 360 degrees in 24 bits, little-endian (the
declination with a sign), and V_T in twentieths of a magnitude.
"""

import array
import math
import struct
import sys
from pathlib import Path

FAINTEST = 10.5
CARD, BLOCK = 80, 2880


def tables(content):
    """@return {name: (offset, octets)} of the file's one-column tables"""
    found, at = {}, 0
    while at < len(content):
        header = {}
        while "END" not in header:
            for i in range(0, BLOCK, CARD):
                card = content[at + i:at + i + CARD].decode("latin1")
                header[card[:8].strip()] = card[10:].split("/")[0].strip(" '")
            at += BLOCK
        axes = int(header["NAXIS"])
        octets = math.prod(int(header[f"NAXIS{k + 1}"]) for k in range(axes)) if axes else 0
        octets = octets * abs(int(header["BITPIX"])) // 8 + int(header.get("PCOUNT", 0))
        found[header.get("TTYPE1", "").strip()] = (at, octets)
        at += (octets + BLOCK - 1) // BLOCK * BLOCK
    return found


def main():
    content = Path(sys.argv[1]).read_bytes()
    found = tables(content)

    def column(name, kind):
        at, octets = found[name]
        values = array.array(kind)
        values.frombytes(content[at:at + octets])
        return values

    xyz, magnitude = column("kdtree_data_stars", "I"), column("MAG_VT", "f")
    magnitude.byteswap()
    stars = []
    for i in sorted((i for i, m in enumerate(magnitude) if m < FAINTEST), key=lambda i: magnitude[i]):
        x, y, z = (-1 + xyz[3 * i + k] / 2147483647.5 for k in range(3))
        ra = round(math.atan2(y, x) / math.tau * 2**24) % 2**24
        dec = round(math.asin(max(-1, min(1, z))) / math.tau * 2**24) % 2**24
        stars.append(struct.pack("<I", ra)[:3] + struct.pack("<I", dec)[:3] + bytes([max(0, round(20 * magnitude[i]))]))
    Path(__file__).with_name("tycho2_bright.bin").write_bytes(b"".join(stars))
    print(len(stars), "stars")


if __name__ == "__main__":
    main()
