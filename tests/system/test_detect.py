# SPDX-FileCopyrightText: 2026 SRFS contributors
# SPDX-License-Identifier: Apache-2.0
"""srfs-detect as an operator calls it."""

import json
import math
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

    def test_links_an_object_over_the_files_of_a_sequence(self):
        with tempfile.TemporaryDirectory(prefix="srfs_test_") as folder:
            made = subprocess.run([BIN / "bench_image", folder, "--set", "sequence", "--frames", "1", "--width", "500", "--height", "400", "--seed", "8"],
                                  capture_output=True, text=True, timeout=120)  # fmt: skip
            self.assertEqual(made.returncode, 0, made.stderr)
            truth = json.loads((Path(folder) / "sequence_000.json").read_text())
            run = detect("--method", "tracklet", "--json", *(str(Path(folder) / f"sequence_000_{k}.fits") for k in range(8)))
        self.assertEqual(run.returncode, 0, run.stderr)

        found = json.loads(run.stdout)
        self.assertTrue(all(f["registration"] for f in found["frames"]))
        for mover in truth["movers"]:
            places = [((p["x1"] + p["x2"]) / 2, (p["y1"] + p["y2"]) / 2) for p in mover["points"]]
            if mover["snr"] < 7 or not all(10 < x < 490 and 10 < y < 390 for x, y in places):
                continue
            hits = [sum(abs(p["x"] - places[p["frame"]][0]) < 3 and abs(p["y"] - places[p["frame"]][1]) < 3 for p in t["points"]) for t in found["tracklets"]]
            self.assertGreaterEqual(max(hits, default=0), 5, mover)

    def test_finds_where_a_camera_looks(self):
        with tempfile.TemporaryDirectory(prefix="srfs_test_") as folder:
            made = subprocess.run([BIN / "bench_image", folder, "--set", "plate", "--frames", "2", "--width", "800", "--height", "600", "--seed", "12"],
                                  capture_output=True, text=True, timeout=120)  # fmt: skip
            self.assertEqual(made.returncode, 0, made.stderr)
            for frame in sorted(Path(folder).glob("*.fits")):
                truth = json.loads(frame.with_suffix(".json").read_text())["attitude"]
                run = detect("--method", "plate_solve", "--json", str(frame))
                self.assertEqual(run.returncode, 0, run.stderr)
                solution = json.loads(run.stdout)["solution"]
                self.assertLess(abs((solution["ra_deg"] - truth["ra_deg"] + 180) % 360 - 180) * math.cos(math.radians(truth["dec_deg"])), 30 / 3600)
                self.assertLess(abs(solution["dec_deg"] - truth["dec_deg"]), 30 / 3600)
                self.assertLess(abs((solution["roll_deg"] - truth["roll_deg"] + 180) % 360 - 180), 0.1)
                self.assertAlmostEqual(solution["scale_arcsec_px"] / truth["scale_arcsec_px"], 1, places=2)

        # A random star field has no solution.
        run = detect("--method", "plate_solve", "--json", self.frames[0])
        self.assertEqual(run.returncode, 0, run.stderr)
        self.assertIsNone(json.loads(run.stdout)["solution"])

    def test_writes_pictures_and_cut_outs_where_it_is_told(self):
        with tempfile.TemporaryDirectory(prefix="srfs_test_") as folder:
            run = detect("--method", "thumbnail", "--params", "width=100", "--out", folder, "--json", self.frames[0])
            self.assertEqual(run.returncode, 0, run.stderr)
            cutout = json.loads(run.stdout)["frames"][0]["cutout"]
            self.assertEqual((cutout["width"], cutout["height"]), (100, 75))
            self.assertEqual(Path(cutout["file"]).read_bytes()[:8], b"\x89PNG\r\n\x1a\n")

            run = detect("--method", "roi", "--params", "x=40", "--params", "y=50", "--params", "width=64", "--params", "height=32", "--out", folder, "--json", self.frames[0])
            self.assertEqual(run.returncode, 0, run.stderr)
            cutout = json.loads(run.stdout)["frames"][0]["cutout"]
            self.assertEqual((cutout["x"], cutout["y"], cutout["width"], cutout["height"]), (40, 50, 64, 32))
            whole, part = Path(self.frames[0]).read_bytes(), Path(cutout["file"]).read_bytes()
            self.assertEqual(part[2880:2880 + 2 * 64], whole[2880 + 2 * (50 * 400 + 40):][:2 * 64])

            run = detect("--method", "roi", "--out", folder + "/none", self.frames[0])
            self.assertEqual((run.returncode, run.stdout), (2, ""))

    def test_makes_no_picture_without_a_folder_for_it_and_says_so(self):
        for method in ("thumbnail", "roi"):
            run = detect("--method", method, self.frames[0])
            self.assertEqual((run.returncode, run.stdout), (2, ""), run.stderr)
            self.assertIn(f"--method {method} makes a picture: give its folder with --out", run.stderr)

    def test_names_the_bounds_of_the_field_that_explains_no_stars(self):
        run = detect("--method", "plate_solve", "--params", "min_field=7", self.frames[0])
        self.assertEqual(run.returncode, 0, run.stderr)
        self.assertIn("field of 7 to 60 degrees (min_field, max_field)", run.stdout)

    def test_lists_the_defects_of_a_detector(self):
        run = detect("--method", "defect_map", "--json", *self.frames)
        self.assertEqual(run.returncode, 0, run.stderr)

        found = json.loads(run.stdout)
        self.assertEqual({d["kind"] for d in found["defects"]} - {"hot", "dark"}, set())
        self.assertTrue(any("particles look like defects" in note for f in found["frames"] for note in f["notes"]))

    def test_says_which_methods_and_parameters_there_are(self):
        run = detect("--method", "comets", self.frames[0])
        self.assertEqual((run.returncode, run.stdout), (2, ""))
        self.assertIn("no method 'comets'; available: star_centroid, streak", run.stderr)

        run = detect("--method", "streak", "--params", "treshold=3", self.frames[0])
        self.assertEqual((run.returncode, run.stdout), (2, ""))
        self.assertIn("no parameter 'treshold'; available: threshold, min_length", run.stderr)

    def test_says_which_file_it_cannot_read_and_why(self):
        broken = Path(self.folder.name) / "broken.fits"
        broken.write_bytes(Path(self.frames[0]).read_bytes()[:5000])
        run = detect("--method", "star_centroid", "--json", self.frames[0], str(broken))
        self.assertEqual((run.returncode, run.stdout), (1, ""))
        self.assertIn("broken.fits: FITS:", run.stderr)


if __name__ == "__main__":
    unittest.main()
