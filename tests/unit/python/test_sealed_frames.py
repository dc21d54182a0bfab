# SPDX-FileCopyrightText: 2026 SRFS contributors
# SPDX-License-Identifier: Apache-2.0
"""The vectors of authenticated TM frames, made anew without SRFS' code: octets by hand, the MAC by the openssl program."""

import pathlib
import shutil
import subprocess
import unittest

from srfs.flight import deployments

VECTORS = pathlib.Path(__file__).parents[2] / "vectors" / "ground_link.txt"
KEY = bytes(range(32))
SPACECRAFT = 0xAB
SPI = 16
CLCW = bytes.fromhex("01040006")
PACKET = bytes.fromhex("002ac0010003deadbeef")
IDLE_PACKET = bytes.fromhex("07ffc000000b") + b"\x55" * 12


def crc16(octets):
    crc = 0xFFFF
    for octet in octets:
        crc ^= octet << 8
        for _ in range(8):
            crc = (crc << 1 ^ (0x1021 if crc & 0x8000 else 0)) & 0xFFFF
    return crc.to_bytes(2, "big")


def cmac(octets):
    command = ["openssl", "mac", "-cipher", "AES-256-CBC", "-macopt", f"hexkey:{KEY.hex()}", "-in", "/dev/stdin", "CMAC"]
    made = subprocess.run(command, input=octets, capture_output=True, check=True)
    return bytes.fromhex(made.stdout.decode().strip())


def sealed_frame(vc, master_count, vc_count, first_header, number, data):
    header = (SPACECRAFT << 4 | vc << 1 | 1).to_bytes(2, "big") + bytes([master_count, vc_count]) + (0x1800 | first_header).to_bytes(2, "big")
    security = SPI.to_bytes(2, "big") + number.to_bytes(6, "big")
    frame = header + security + data + cmac(header + security + data + CLCW) + CLCW
    return frame + crc16(frame)


FRAMES = {
    "Sealed TM frame, length 64, SPI 16, number 0343dcacbc01, vc 2 mc 17 vc 34, packet + idle, OCF 01040006": (2, 17, 34, 0, 0x0343DCACBC01, PACKET + IDLE_PACKET),
    "Sealed TM idle frame vc7, length 68, SPI 16, number 0343dcacbc03, OCF 01040006": (7, 0, 0, 0x7FE, 0x0343DCACBC03, b"\x55" * 32),
}


@unittest.skipUnless(shutil.which("openssl"), "needs the openssl program")
class SealedFrames(unittest.TestCase):
    def test_the_vectors_are_those_of_openssl(self):
        vectors = dict(line.rsplit(" = ", 1) for line in VECTORS.read_text().splitlines() if line.startswith("Sealed TM"))
        self.assertEqual(set(vectors), set(FRAMES))
        for name, arguments in FRAMES.items():
            self.assertEqual(sealed_frame(*arguments).hex(), vectors[name], name)


class Deployments(unittest.TestCase):
    def test_those_for_other_stations_have_frames_without_security(self):
        for name, sdls in (("sim", "strict"), ("board_rk3568", "strict"), ("sim_open", "none"), ("sim_open_i5", "none")):
            self.assertEqual(deployments.read(name)["link"]["tm"]["sdls"], sdls, name)


if __name__ == "__main__":
    unittest.main()
