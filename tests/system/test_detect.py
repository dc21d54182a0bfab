"""srfs-detect as an operator calls it."""

import json
import subprocess
import tempfile
import unittest
from pathlib import Path

from support import BIN


def detect(*arguments):
    return subprocess.run([BIN / "srfs-detect", *arguments], stdin=subprocess.DEVNULL, capture_output=True, text=True, timeout=120)


class DetectProgramTest(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.folder = tempfile.TemporaryDirectory(prefix="srfs_test_")
        cls.addClassCleanup(cls.folder.cleanup)
        made = subprocess.run([BIN / "bench_image", cls.folder.name, "--set", "streaks", "--frames", "2", "--width", "400", "--height", "300", "--seed", "5"],
                              capture_output=True, text=True, timeout=120)  # fmt: skip
        assert made.returncode == 0, made.stderr
        cls.frames = sorted(str(p) for p in Path(cls.folder.name).glob("*.fits"))

    def test_lists_what_it_found_in_every_frame_in_order(self):
        run = detect("--method", "star_centroid", "--json", *self.frames)
        self.assertEqual(run.returncode, 0, run.stderr)

        found = json.loads(run.stdout)
        self.assertEqual([f["file"] for f in found["frames"]], self.frames)
        self.assertEqual({s["frame"] for s in found["stars"]}, {0, 1})
        for star in found["stars"]:
            self.assertTrue({"x", "y", "flux", "snr", "fwhm"} <= star.keys())
        truth = json.loads(Path(self.frames[0]).with_suffix(".json").read_text())
        for t in truth["stars"]:
            if t["snr"] > 50 and 5 < t["x"] < 394 and 5 < t["y"] < 294:
                self.assertTrue(any(abs(s["x"] - t["x"]) < 1 and abs(s["y"] - t["y"]) < 1 for s in found["stars"] if s["frame"] == 0), t)

    def test_finds_the_same_each_time(self):
        first, second = (json.loads(detect("--method", "streak", "--json", self.frames[0]).stdout) for _ in range(2))
        self.assertEqual(first["streaks"], second["streaks"])

    def test_says_which_methods_and_parameters_there_are(self):
        run = detect("--method", "comets", self.frames[0])
        self.assertEqual((run.returncode, run.stdout), (2, ""))
        self.assertIn("no method 'comets': there are star_centroid, streak", run.stderr)

        run = detect("--method", "streak", "--params", "treshold=3", self.frames[0])
        self.assertEqual((run.returncode, run.stdout), (2, ""))
        self.assertIn("no parameter 'treshold': there are threshold, min_length", run.stderr)

    def test_says_which_file_it_cannot_read_and_why(self):
        broken = Path(self.folder.name) / "broken.fits"
        broken.write_bytes(Path(self.frames[0]).read_bytes()[:5000])
        run = detect("--method", "star_centroid", "--json", self.frames[0], str(broken))
        self.assertEqual((run.returncode, run.stdout), (1, ""))
        self.assertIn("broken.fits: FITS:", run.stderr)


if __name__ == "__main__":
    unittest.main()
