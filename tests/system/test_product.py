# SPDX-FileCopyrightText: 2026 SRFS contributors
# SPDX-License-Identifier: Apache-2.0
"""srfs-product as an operator calls it."""

import json
import subprocess
import unittest
from pathlib import Path

from support import BIN, TemporaryFolder

MARKER = b"SRFSTRIP"


def product(*arguments):
    return subprocess.run([BIN / "srfs-product", *map(str, arguments)], stdin=subprocess.DEVNULL, capture_output=True, text=True, timeout=120)


def without_exposure(content):
    """A FITS file of one header block without its card EXPTIME."""
    header, data = content[:2880], content[2880:]
    cards = [header[i : i + 80] for i in range(0, len(header), 80)]
    return b"".join(card for card in cards if not card.startswith(b"EXPTIME")).ljust(len(header)) + data


class ProductProgramTest(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        folder = TemporaryFolder()
        cls.addClassCleanup(folder.cleanup)
        cls.folder = Path(folder.name)
        made = subprocess.run([BIN / "bench_image", folder.name, "--set", "streaks", "--frames", "1", "--width", "400", "--height", "300", "--seed", "5"],
                              capture_output=True, text=True, timeout=120)  # fmt: skip
        assert made.returncode == 0, made.stderr
        (cls.frame,) = cls.folder.glob("*.fits")
        cls.strips = cls.folder / "frame_0001.strips"
        packed = product(cls.strips, "--pack", cls.frame)
        assert packed.returncode == 0, packed.stderr

    def test_gives_back_the_frame_as_fits_and_png(self):
        fits, png = self.folder / "whole.fits", self.folder / "whole.png"
        run = product(self.strips, "--out", fits, "--png", png)
        self.assertEqual(run.returncode, 0, run.stderr)
        self.assertIn("400 x 300, ", run.stdout)
        self.assertNotIn("missing", run.stdout)
        self.assertEqual(fits.read_bytes(), without_exposure(self.frame.read_bytes()))  # strips do not carry its length
        self.assertEqual(png.read_bytes()[:8], b"\x89PNG\r\n\x1a\n")

    def test_makes_a_file_that_the_spacecraft_reads_of_a_picture(self):
        png, fits = self.folder / "picture.png", self.folder / "of_picture.fits"
        self.assertEqual(product(self.strips, "--png", png).returncode, 0)
        run = product(png, "--out", fits)
        self.assertEqual(run.returncode, 0, run.stderr)
        self.assertIn("400 x 300", run.stdout)
        header = fits.read_bytes()[:2880]
        for card in (b"BITPIX  =                   16", b"NAXIS1  =                  400", b"BZERO   =                32768"):
            self.assertIn(card, header)
        again = self.folder / "again.fits"
        self.assertEqual(product(fits, "--out", again).returncode, 0)
        self.assertEqual(again.read_bytes(), fits.read_bytes())
        broken = self.folder / "broken.png"
        broken.write_bytes(png.read_bytes()[:100])
        run = product(broken, "--out", again)
        self.assertEqual(run.returncode, 1)
        self.assertIn("broken.png: PNG: ", run.stderr)

    def test_says_which_strips_are_missing_and_writes_the_rest(self):
        whole = self.strips.read_bytes()
        begins = [at for at in range(len(whole)) if whole.startswith(MARKER, at)]
        self.assertGreater(len(begins), 3)
        damaged = self.folder / "damaged.strips"
        damaged.write_bytes(whole[:begins[1]] + whole[begins[2]:-1000])
        fits = self.folder / "damaged.fits"

        run = product(damaged, "--out", fits)

        self.assertEqual(run.returncode, 3, run.stderr)
        self.assertIn(f"missing: 2 strips (1, {len(begins) - 1})", run.stdout)
        rows = int(run.stdout.split(" strips of ")[1].split()[0])
        row = 2 * 400
        self.assertEqual(fits.read_bytes()[2880:2880 + rows * row], self.frame.read_bytes()[2880:2880 + rows * row])

    def test_says_what_it_cannot_read(self):
        run = product(self.folder / "none.strips")
        self.assertEqual((run.returncode, run.stdout), (1, ""))
        self.assertIn("none.strips", run.stderr)

        other = self.folder / "other.txt"
        other.write_text("neither strips nor a picture")
        run = product(other)
        self.assertEqual((run.returncode, run.stdout), (1, ""))
        self.assertIn("no strip begins in this file", run.stderr)

        stars = self.folder / "stars.bin"
        stars.write_bytes(b"SRFSTARS\x01\0\0\0\0\0\0\1")
        run = product(stars)
        self.assertEqual((run.returncode, run.stdout), (1, ""))
        self.assertIn("a damaged list of stars", run.stderr)

        run = product(self.strips, "--size")
        self.assertEqual((run.returncode, run.stdout), (2, ""))

    def test_explains_itself(self):
        run = product("--help")
        self.assertEqual(run.returncode, 0)
        for word in ("--out", "--png", "--pack", "Exit code", "missing"):
            self.assertIn(word, run.stdout)

    def test_detections_are_drawn_over_the_frame(self):
        png = self.folder / "drawn.png"
        run = subprocess.run([BIN / "srfs-detect", "--method", "streak", "--params", "stars=1", "--draw", png, "--json", self.frame],
                             stdin=subprocess.DEVNULL, capture_output=True, text=True, timeout=120)  # fmt: skip
        self.assertEqual(run.returncode, 0, run.stderr)
        self.assertGreater(len(json.loads(run.stdout)["streaks"]), 0)
        header = png.read_bytes()[:29]
        self.assertEqual(header[:8], b"\x89PNG\r\n\x1a\n")
        self.assertEqual((int.from_bytes(header[16:20], "big"), int.from_bytes(header[20:24], "big")), (400, 300))
        self.assertEqual(header[25], 2, "colours")

        run = subprocess.run([BIN / "srfs-detect", "--method", "streak", "--draw", "/proc/none/x.png", self.frame], stdin=subprocess.DEVNULL, capture_output=True, text=True, timeout=120)
        self.assertEqual(run.returncode, 1)
        self.assertIn("/proc/none/x.png", run.stderr)


if __name__ == "__main__":
    unittest.main()
