# SPDX-FileCopyrightText: 2026 SRFS contributors
# SPDX-License-Identifier: Apache-2.0
"""srfs-detect as an operator calls it."""

import json
import math
import re
import subprocess
import unittest
from pathlib import Path

from support import BIN, TemporaryFolder


def detect(*arguments):
    return subprocess.run([BIN / "srfs-detect", *arguments], stdin=subprocess.DEVNULL, capture_output=True, text=True, timeout=120)


TDM_HEADER = re.compile(r"CCSDS_TDM_VERS = 2\.0\nCREATION_DATE = [-0-9T:.]+Z\nORIGINATOR = [ -~]+\n")
TDM_SEGMENT = re.compile(r"META_START\n((?:[A-Z_0-9]+ = [ -~]+\n)+)META_STOP\nDATA_START\n((?:COMMENT [ -~]+\n)*)((?:[A-Z_0-9]+ = [ -~]+\n)+)DATA_STOP\n")
TDM_DATA = re.compile(r"(ANGLE_1|ANGLE_2|MAG) = (\d{4}-\d\d-\d\dT\d\d:\d\d:\d\d\.\d+Z) (-?\d+\.\d+)")
TDM_META = {"TIME_SYSTEM", "START_TIME", "STOP_TIME", "PARTICIPANT_1", "PARTICIPANT_2", "MODE", "PATH", "ANGLE_TYPE", "REFERENCE_FRAME"}


def tracking_data(text):
    """Reads a message of angles by the grammar of CCSDS 503.0-B-2. @return [({metadata}, {keyword: [(time, value)]})]"""
    header = TDM_HEADER.match(text)
    assert header, text[:200]
    assert all(len(line) <= 254 for line in text.splitlines())
    at, segments = header.end(), []
    while at < len(text):
        segment = TDM_SEGMENT.match(text, at)
        assert segment, text[at:at + 300]
        at = segment.end()
        meta = dict(line.split(" = ", 1) for line in segment[1].splitlines())
        assert set(meta) == TDM_META and meta["TIME_SYSTEM"] == "UTC" and meta["MODE"] == "SEQUENTIAL" and meta["PATH"] == "2,1", meta
        data = {}
        for line in segment[3].splitlines():
            found = TDM_DATA.fullmatch(line)
            assert found, line
            data.setdefault(found[1], []).append((found[2], float(found[3])))
        for rows in data.values():
            times = [time for time, _ in rows]
            assert times == sorted(times) and meta["START_TIME"] <= times[0] and times[-1] <= meta["STOP_TIME"], rows
        assert all(0 <= ra < 360 for _, ra in data["ANGLE_1"]) and all(-90 <= dec <= 90 for _, dec in data["ANGLE_2"])
        segments.append((meta, data))
    return segments


class DetectProgramTest(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        cls.folder = TemporaryFolder()
        cls.addClassCleanup(cls.folder.cleanup)
        made = subprocess.run([BIN / "bench_image", cls.folder.name, "--set", "streaks", "--frames", "2", "--width", "400", "--height", "300", "--seed", "5"],
                              capture_output=True, text=True, timeout=120)  # fmt: skip
        assert made.returncode == 0, made.stderr
        cls.frames = sorted(str(p) for p in Path(cls.folder.name).glob("*.fits"))

    def test_makes_a_dark_and_names_it_where_it_is_used(self):
        with TemporaryFolder() as name:
            made = subprocess.run([BIN / "bench_image", name, "--set", "pattern", "--frames", "1", "--width", "320", "--height", "240", "--seed", "5"],
                                  capture_output=True, text=True, timeout=120)  # fmt: skip
            self.assertEqual(made.returncode, 0, made.stderr)
            darks, frame, masters = sorted(Path(name).glob("*_dark_*.fits")), Path(name) / "pattern_000.fits", str(Path(name) / "masters")
            no_folder = detect("--method", "calibrate", *darks)
            self.assertEqual((no_folder.returncode, "--calibration" in no_folder.stderr), (2, True), no_folder.stderr)
            misspelt = detect("--method", "star_centroid", "--calibration", masters, frame)
            self.assertEqual((misspelt.returncode, misspelt.stdout, "no such folder" in misspelt.stderr), (2, "", True), misspelt.stderr)
            few = detect("--method", "calibrate", "--calibration", masters, *darks[:2])
            self.assertEqual((few.returncode, "needs 3 frames" in few.stderr), (1, True), few.stderr)
            flat = detect("--method", "calibrate", "--params", "kind=1", "--calibration", masters, frame, frame, frame)
            self.assertEqual((flat.returncode, "there is no dark of 320 x 240 px, 1 s" in flat.stderr), (1, True), flat.stderr)

            dark = json.loads(detect("--method", "calibrate", "--json", "--calibration", masters, *darks).stdout)["master"]
            found = json.loads(detect("--method", "star_centroid", "--json", "--calibration", masters, frame).stdout)
            self.assertEqual((dark["kind"], dark["generation"], dark["frames"]), ("dark", 1, len(darks)))
            self.assertEqual((found["calibration"], found["frames"][0]["dark"]), ([dark], 1))

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
        with TemporaryFolder() as folder:
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
        with TemporaryFolder() as folder:
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
        with TemporaryFolder() as folder:
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

    def test_writes_measured_angles_as_a_tracking_data_message(self):
        with TemporaryFolder() as folder:
            made = subprocess.run([BIN / "bench_image", folder, "--set", "passes", "--frames", "1", "--width", "800", "--height", "600", "--seed", "77"],
                                  capture_output=True, text=True, timeout=120)  # fmt: skip
            self.assertEqual(made.returncode, 0, made.stderr)
            frame = Path(folder) / "passes_000.fits"
            passes = json.loads(frame.with_suffix(".json").read_text())["attitude"]["passes"]
            tdm = Path(folder) / "passes.tdm"
            run = detect("--method", "streak", "--tdm", str(tdm), "--observer", "SRFS-1", "--json", str(frame))
            self.assertEqual(run.returncode, 0, run.stderr)

            streaks = json.loads(run.stdout)["streaks"]
            segments = tracking_data(tdm.read_text())
            self.assertEqual(len(segments), len(streaks))
            self.assertGreaterEqual(len(streaks), 3)
            for (meta, data), streak in zip(segments, streaks):
                self.assertEqual((meta["PARTICIPANT_1"], meta["ANGLE_TYPE"], meta["REFERENCE_FRAME"]), ("SRFS-1", "RADEC", "EME2000"))
                self.assertEqual(set(data), {"ANGLE_1", "ANGLE_2", "MAG"})
                [(time, ra)], [(_, dec)], [(_, magnitude)] = data["ANGLE_1"], data["ANGLE_2"], data["MAG"]
                # The middle of the exposure of two seconds.
                self.assertEqual(time, "2026-11-26T12:00:01.000000Z")
                near = [p for p in passes if abs(p["first"]["dec_deg"] + p["last"]["dec_deg"] - 2 * dec) < 0.02
                        and abs((p["first"]["ra_deg"] + p["last"]["ra_deg"] - 2 * ra + 360) % 720 - 360) * math.cos(math.radians(dec)) < 0.02]  # fmt: skip
                self.assertTrue(near, streak)
                self.assertLess(abs(near[0]["magnitude"] - magnitude), 0.3)

    def test_writes_no_tracking_data_message_without_angles_and_says_why(self):
        with TemporaryFolder() as folder:
            tdm = Path(folder) / "none.tdm"
            run = detect("--method", "streak", "--tdm", str(tdm), self.frames[0])
            self.assertEqual(run.returncode, 1, run.stderr)
            self.assertIn("none.tdm not written: no object with angles and a time", run.stderr)
            self.assertFalse(tdm.exists())
            run = detect("--method", "thumbnail", "--tdm", str(tdm), self.frames[0])
            self.assertEqual((run.returncode, run.stdout), (2, ""))
            self.assertIn("--tdm needs --method streak or tracklet", run.stderr)

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
