# SPDX-FileCopyrightText: 2026 SRFS contributors
# SPDX-License-Identifier: Apache-2.0
"""./run bench image: srfs-detect on simulated frames with known truth, beside source-extractor on the same frames.

bench_image writes the frames, each with another optics, sky and detector. Both programs read the same FITS files; times are
CPU seconds of the whole processes with one thread, measured alternately.
"""

import json
import math
import os
import shutil
import subprocess
import tempfile
import time
from collections import defaultdict
from pathlib import Path

from srfs.program import MissionError
from srfs.report import percentile, quantiles

SNR_BINS = ((6, 8), (8, 15), (15, 40), (40, 100), (100, 3000))
PEER_SHARE = Path("/usr/share/source-extractor")
PEER_COLUMNS = ("XWIN_IMAGE", "YWIN_IMAGE", "FLUX_AUTO", "FLUXERR_AUTO", "FLAGS")


class Grid:
    """Points by place."""

    def __init__(self, points, cell=4.0):
        self.cell, self.cells = cell, defaultdict(list)
        for i, (x, y) in enumerate(points):
            self.cells[int(x // cell), int(y // cell)].append((x, y, i))

    def near(self, x, y, radius):
        i, j = int(x // self.cell), int(y // self.cell)
        found = []
        for a in range(i - 1, i + 2):
            for b in range(j - 1, j + 2):
                found += [(math.hypot(x - u, y - v), k) for u, v, k in self.cells[a, b] if math.hypot(x - u, y - v) <= radius]
        return sorted(found)


def match(truth, found, radius):
    """One to one, the brightest of the truth first. @return {index in truth: index in found}"""
    grid, taken, pairs = Grid([(f["x"], f["y"]) for f in found]), set(), {}
    for t in sorted(range(len(truth)), key=lambda i: -truth[i]["snr"]):
        for _, f in grid.near(truth[t]["x"], truth[t]["y"], radius):
            if f not in taken:
                taken.add(f)
                pairs[t] = f
                break
    return pairs


def rms(values):
    return math.sqrt(sum(v * v for v in values) / len(values))


class StarScore:
    """Sums over frames."""

    def __init__(self):
        self.of, self.hit, self.errors = defaultdict(int), defaultdict(int), defaultdict(list)
        self.found = self.real = 0

    def add(self, frame, found):
        truth, radius = frame["stars"], max(1.5, 0.6 * frame["fwhm"])
        pairs = match(truth, found, radius)
        inside = [f for f in found if 0 <= f["x"] <= frame["width"] - 1 and 0 <= f["y"] <= frame["height"] - 1]
        self.found += len(inside)
        everything = Grid([(t["x"], t["y"]) for t in truth])
        # A fainter star of the truth makes a detection real as well.
        self.real += sum(1 for f in inside if everything.near(f["x"], f["y"], radius))
        stars = Grid([(t["x"], t["y"]) for t in truth])
        for i, t in enumerate(truth):
            margin = 2 * frame["fwhm"]
            if not (margin <= t["x"] <= frame["width"] - 1 - margin and margin <= t["y"] <= frame["height"] - 1 - margin):
                continue
            name = next((b for b in SNR_BINS if b[0] <= t["snr"] < b[1]), None)
            if name is None:
                continue
            self.of[name] += 1
            self.hit[name] += i in pairs
            alone = all(k == i or truth[k]["snr"] < 0.02 * t["snr"] for _, k in stars.near(t["x"], t["y"], min(3.9, 1 + 1.5 * frame["fwhm"])))
            if i in pairs and alone:
                f = found[pairs[i]]
                self.errors[name] += [(f["x"] - t["x"]) / t["limit_x"], (f["y"] - t["y"]) / t["limit_y"]]

    def result(self):
        bins = {}
        for b in SNR_BINS:
            e = self.errors[b]
            bins[f"{b[0]}-{b[1]}"] = {
                "stars": self.of[b],
                "completeness": round(self.hit[b] / self.of[b], 4) if self.of[b] else None,
                "rms_over_limit": round(rms(e), 3) if e else None,
                # A blend or an outlier decides the rms; this is the core.
                "core_over_limit": round(percentile([abs(v) for v in e], 0.68), 3) if e else None,
            }
        return {"bins": bins, "found": self.found, "purity": round(self.real / self.found, 4) if self.found else None}


class StreakScore:
    def __init__(self):
        self.of = self.hit = self.wrong = self.frames = 0
        self.cross, self.angle, self.length, self.missed = [], [], [], []

    def add(self, frame, found):
        self.frames += 1
        taken = set()
        for t in frame["streaks"]:
            self.of += 1
            best = None
            for i, f in enumerate(found):
                if i in taken:
                    continue
                share = covered(t, f)
                if share > 0.5 and (best is None or share > best[0]):
                    best = share, i
            if best is None:
                self.missed.append({"frame": frame["file"], **{k: round(v, 1) for k, v in t.items()}})
                continue
            self.hit += 1
            taken.add(best[1])
            self.measure(t, found[best[1]])
        self.wrong += sum(1 for i, f in enumerate(found) if i not in taken)

    def measure(self, t, f):
        length = math.hypot(t["x2"] - t["x1"], t["y2"] - t["y1"])
        if length < 40:
            return
        ux, uy = (t["x2"] - t["x1"]) / length, (t["y2"] - t["y1"]) / length
        mx, my = (f["x1"] + f["x2"]) / 2 - t["x1"], (f["y1"] + f["y2"]) / 2 - t["y1"]
        self.cross.append(abs(ux * my - uy * mx))
        turn = math.degrees(math.atan2(f["y2"] - f["y1"], f["x2"] - f["x1"]) - math.atan2(uy, ux))
        self.angle.append(abs((turn + 90) % 180 - 90))
        self.length.append(abs(math.hypot(f["x2"] - f["x1"], f["y2"] - f["y1"]) - length))

    def result(self):
        def spread(values):
            return {**quantiles(values, "p50 p90", digits=3), "rms": round(rms(values), 3)} if values else None

        return {"streaks": self.of, "recall": round(self.hit / self.of, 4) if self.of else None, "frames": self.frames, "false_per_frame": round(self.wrong / self.frames, 4) if self.frames else None,
                "cross_track_px": spread(self.cross), "angle_deg": spread(self.angle), "length_px": spread(self.length), "missed": self.missed[:20]}  # fmt: skip


def middles(mover):
    return [((p["x1"] + p["x2"]) / 2, (p["y1"] + p["y2"]) / 2) for p in mover["points"]]


def hits_of(truth, mover, tracklet):
    """Points of a tracklet that lie where the object was."""
    places, near = middles(mover), max(2.0, truth["fwhm"], mover["trail"] / 3)
    return sum(1 for p in tracklet["points"] if math.dist((p["x"], p["y"]), places[p["frame"]]) < near)


class TrackletScore:
    """Moving objects in sequences of frames."""

    BINS = ((3, 4), (4.5, 5.5), (5.5, 1000))

    def __init__(self):
        self.of, self.hit = defaultdict(int), defaultdict(int)
        self.found = self.wrong = self.sequences = self.unregistered = 0
        self.squares, self.places = 0.0, 0
        self.streaks = StreakScore()
        self.missed = []

    def add(self, truth, found):
        """@param found: what srfs-detect --method tracklet printed"""
        self.sequences += 1
        taken = set()
        for mover in truth["movers"]:
            places = middles(mover)
            inside = [0 < x < truth["width"] - 1 and 0 < y < truth["height"] - 1 for x, y in places]
            if sum(inside) < 5:
                continue
            name = "streaks" if mover["trail"] >= 10 else next(f"{low:g}-{high:g}" for low, high in self.BINS if low <= mover["snr"] < high)
            self.of[name] += 1
            for i, tracklet in enumerate(found["tracklets"]):
                hits = hits_of(truth, mover, tracklet)
                if i not in taken and hits >= 5 and 2 * hits > len(tracklet["points"]):
                    self.hit[name] += 1
                    taken.add(i)
                    break
            else:
                self.missed.append({"sequence": truth["file"], "snr": round(mover["snr"], 2), "trail": round(mover["trail"], 2), "x": round(places[0][0]), "y": round(places[0][1]), "inside": sum(inside)})
        self.found += len(found["tracklets"])
        # What follows an object that leaves the frame too soon is none of the goal, but real.
        self.wrong += sum(1 for i, t in enumerate(found["tracklets"]) if i not in taken and not any(2 * hits_of(truth, mover, t) > len(t["points"]) for mover in truth["movers"]))
        self.measure_registration(truth, found["frames"])
        for k in range(len(truth["frames"])):
            streaks = [{**m["points"][k], "snr": m["snr"]} for m in truth["movers"] if m["trail"] >= 10]
            margin = 8
            whole = [s for s in streaks if all(margin < s["x" + e] < truth["width"] - margin and margin < s["y" + e] < truth["height"] - margin for e in "12")]
            found_here = [s for s in found["streaks"] if s["frame"] == k]
            partly = [s for s in streaks if s not in whole]
            self.streaks.add({"streaks": whole, "file": f"{truth['file']}:{k}"}, [f for f in found_here if not any(covered(p, f) > 0.2 for p in partly)])

    def measure_registration(self, truth, frames):
        """Where each frame's corners and middle lie in the first one's pixels, beside the truth."""
        reference = next((k for k, f in enumerate(frames) if f.get("registration") and f["registration"]["a"] == 1 and f["registration"]["rms"] == 0), 0)
        w, h = truth["width"], truth["height"]

        def to_sky(k, x, y):
            p = truth["frames"][k]
            c, s = math.cos(p["turn_rad"]), math.sin(p["turn_rad"])
            u, v = x - w / 2, y - h / 2
            return c * u - s * v + p["shift_x"] + w / 2, s * u + c * v + p["shift_y"] + h / 2

        def from_sky(k, x, y):
            p = truth["frames"][k]
            c, s = math.cos(p["turn_rad"]), math.sin(p["turn_rad"])
            u, v = x - p["shift_x"] - w / 2, y - p["shift_y"] - h / 2
            return c * u + s * v + w / 2, c * v - s * u + h / 2

        for k, frame in enumerate(frames):
            r = frame.get("registration")
            if not r:
                self.unregistered += 1
                continue
            if k == reference:
                continue
            for x, y in ((0, 0), (w, 0), (0, h), (w, h), (w / 2, h / 2)):
                tx, ty = from_sky(reference, *to_sky(k, x, y))
                self.squares += (r["dx"] + r["a"] * x - r["b"] * y - tx) ** 2 + (r["dy"] + r["b"] * x + r["a"] * y - ty) ** 2
                self.places += 2

    def result(self):
        streaks = self.streaks.result()
        return {"sequences": self.sequences, "found": self.found, "false_per_sequence": round(self.wrong / self.sequences, 4) if self.sequences else None,
                "recall": {name: {"of": self.of[name], "recall": round(self.hit[name] / self.of[name], 4)} for name in sorted(self.of)},
                "registration_rms_px": round(math.sqrt(self.squares / self.places), 4) if self.places else None, "frames_not_registered": self.unregistered,
                "streaks_10_20_after_veto": {key: streaks[key] for key in ("streaks", "recall", "false_per_frame")}, "missed": self.missed[:20]}  # fmt: skip


def covered(t, f, reach=4):
    """Share of the longer one that the two have in common, where they run along each other."""
    length = math.hypot(t["x2"] - t["x1"], t["y2"] - t["y1"])
    ux, uy = (t["x2"] - t["x1"]) / length, (t["y2"] - t["y1"]) / length
    along, across = [], []
    for k in "12":
        dx, dy = f["x" + k] - t["x1"], f["y" + k] - t["y1"]
        along.append(dx * ux + dy * uy)
        across.append(abs(ux * dy - uy * dx))
    if max(across) > reach:
        return 0
    low, high = sorted(along)
    return max(0, min(high, length) - max(low, 0)) / max(length, high - low)


class LensScore:
    """Stars of lenses with faults: those that an operator sees at once, and what is none."""

    BRIGHT = 30

    def __init__(self):
        self.of = self.hit = self.found = self.real = 0
        self.missed = []

    def add(self, frame, found):
        truth = frame["stars"]
        # The tail of a comatic star pulls its place; which of its points is right is a matter of definition.
        radius = max(1.5, 0.6 * frame["fwhm"] * (1 + frame["wider"]) + 0.4 * frame["coma"] + 0.3 * frame["drift"])
        pairs = match(truth, found, radius)
        bright = [i for i, t in enumerate(truth) if t["snr"] >= self.BRIGHT and all(2 * frame["fwhm"] <= t[a] <= frame[size] - 1 - 2 * frame["fwhm"] for a, size in (("x", "width"), ("y", "height")))]
        everything, seen = Grid([(t["x"], t["y"]) for t in truth]), Grid([(f["x"], f["y"]) for f in found])
        for i in bright:
            t = truth[i]
            # Two that no lens of this kind separates count as one.
            beside = [k for _, k in everything.near(t["x"], t["y"], min(3.9, radius)) if k != i and truth[k]["snr"] > t["snr"]]
            self.of += 1
            if i in pairs or (beside and seen.near(t["x"], t["y"], min(3.9, 1.5 * radius))):
                self.hit += 1
            else:
                self.missed.append({"frame": frame["file"], **{k: round(t[k], 1) for k in ("x", "y", "snr")}})
        self.found += len(found)
        self.real += sum(1 for f in found if everything.near(f["x"], f["y"], min(3.9, radius)))

    def result(self):
        return {"bright": self.of, "completeness": round(self.hit / self.of, 4), "found": self.found, "purity": round(self.real / self.found, 4) if self.found else None, "missed": self.missed[:20]}


class TrailScore:
    """Trails that are no even lines: found as what they are, once, with their length."""

    def __init__(self):
        self.of = self.hit = self.whole = self.pieces = self.wrong = self.frames = 0
        self.missed = []

    def add(self, frame, found):
        self.frames += 1
        of_trail = set()
        for t in frame["streaks"]:
            length = math.dist((t["x1"], t["y1"]), (t["x2"], t["y2"]))
            along = [i for i, f in enumerate(found) if lies_on(t, f, max(4, t["width"]))]
            best = max((covered(t, found[i], max(4, t["width"])) for i in along), default=0)
            longest = max((math.dist((found[i]["x1"], found[i]["y1"]), (found[i]["x2"], found[i]["y2"])) for i in along), default=0)
            of_trail.update(along)
            self.of += 1
            self.pieces += max(0, len(along) - 1)
            self.hit += best > 0.5
            self.whole += abs(longest - length) <= 0.1 * length and best > 0.5
            if best <= 0.9:
                self.missed.append({"frame": frame["file"], "covered": round(best, 2), "length": round(length), **{k: round(t[k], 2) for k in ("width", "height", "ragged", "gaps")}})
        self.wrong += len(found) - len(of_trail)

    def result(self):
        return {"trails": self.of, "found": round(self.hit / self.of, 4) if self.of else None, "length_within_10_percent": round(self.whole / self.of, 4) if self.of else None,
                "pieces_more": self.pieces, "false_per_frame": round(self.wrong / self.frames, 4), "missed": self.missed[:40]}  # fmt: skip


def lies_on(t, f, reach):
    """Both ends of a streak lie on a trail."""
    length = math.dist((t["x1"], t["y1"]), (t["x2"], t["y2"]))
    ux, uy = (t["x2"] - t["x1"]) / length, (t["y2"] - t["y1"]) / length
    for k in "12":
        dx, dy = f["x" + k] - t["x1"], f["y" + k] - t["y1"]
        if abs(ux * dy - uy * dx) > reach or not -reach - 0.3 * length < dx * ux + dy * uy < 1.3 * length + reach:
            return False
    return True


def run_timed(command, **options):
    """@return CPU seconds and standard output"""
    with tempfile.TemporaryFile() as out, tempfile.TemporaryFile() as problem:
        process = subprocess.Popen(command, stdin=subprocess.DEVNULL, stdout=out, stderr=problem, **options)
        _, status, used = os.wait4(process.pid, 0)
        process.returncode = os.waitstatus_to_exitcode(status)
        out.seek(0)
        problem.seek(0)
        if process.returncode != 0:
            raise MissionError(f"{command[0]}: {problem.read().decode(errors='replace').strip()[-500:]}")
        return used.ru_utime + used.ru_stime, out.read().decode()


def detect(bin_dir, method, *files):
    cpu, out = run_timed([str(Path(bin_dir) / "srfs-detect"), "--method", method, "--json", *map(str, files)])
    return cpu, json.loads(out)


def peer(fits, folder):
    """source-extractor with its defaults, smaller stars allowed, windowed positions. @return CPU seconds, stars"""
    (folder / "out.param").write_text("\n".join(PEER_COLUMNS) + "\n")
    catalogue = folder / "out.cat"
    cpu, _ = run_timed(["source-extractor", str(fits), "-c", str(PEER_SHARE / "default.sex"), "-PARAMETERS_NAME", str(folder / "out.param"), "-FILTER_NAME",
                        str(PEER_SHARE / "default.conv"), "-STARNNW_NAME", str(PEER_SHARE / "default.nnw"), "-CATALOG_NAME", str(catalogue), "-DETECT_MINAREA", "3",
                        "-NTHREADS", "1", "-VERBOSE_TYPE", "QUIET"], cwd=folder)  # fmt: skip
    rows = [line.split() for line in catalogue.read_text().splitlines() if not line.startswith("#")]
    return cpu, [{"x": float(r[0]) - 1, "y": float(r[1]) - 1, "flux": float(r[2])} for r in rows]


def sequences_in(target, name):
    """@return [(FITS files in order, truth)]"""
    made = []
    for path in sorted(target.glob(f"{name}_???.json")):
        truth = json.loads(path.read_text())
        made.append(([path.with_name(f"{path.stem}_{k}.fits") for k in range(len(truth["frames"]))], {**truth, "file": path.stem}))
    return made


def frames_of(bin_dir, folder, name, options, **size):
    """Makes the frames of a set. @return [(FITS file, truth)]"""
    target = folder / name
    target.mkdir()
    command = [str(Path(bin_dir) / "bench_image"), str(target), "--set", name.split("_")[0], "--seed", str(options.seed), "--frames", str(size.pop("frames"))]
    for key, value in size.items():
        command += [f"--{key}", str(value)]
    run_timed(command)
    if name in ("sequence", "faint"):
        return sequences_in(target, name)
    made = []
    for fits in sorted(target.glob(f"{name.split('_')[0]}_???.fits")):
        truth = json.loads(fits.with_suffix(".json").read_text())
        made.append((fits, {**truth, "file": fits.name}))
    return made


def measure_stars(bin_dir, options, folder, frames):
    ours, theirs, cpu = StarScore(), StarScore(), [0.0, 0.0]
    has_peer = shutil.which("source-extractor") is not None
    for fits, truth in frames:
        used, found = detect(bin_dir, "star_centroid", fits)
        truth["width"], truth["height"] = found["frames"][0]["width"], found["frames"][0]["height"]
        ours.add(truth, found["stars"])
        cpu[0] += used
        if has_peer:
            used, stars = peer(fits, folder)
            theirs.add(truth, stars)
            cpu[1] += used
    result = {"frames": len(frames), "srfs": ours.result(), "srfs_cpu_s": round(cpu[0], 3)}
    if has_peer:
        result.update({"source_extractor": theirs.result(), "source_extractor_cpu_s": round(cpu[1], 3), "cpu_ratio": round(cpu[0] / cpu[1], 3)})
    return result


def measure_streaks(bin_dir, frames):
    score = StreakScore()
    for fits, truth in frames:
        _, found = detect(bin_dir, "streak", fits)
        score.add(truth, found["streaks"])
    return score.result()


def measure_lens(bin_dir, folder, frames):
    """Lenses with faults, small detectors, compressed files: no streak is in them."""
    ours, theirs, wrong = LensScore(), LensScore(), 0
    has_peer = shutil.which("source-extractor") is not None
    for fits, truth in frames:
        _, found = detect(bin_dir, "star_centroid", fits)
        truth["width"], truth["height"] = found["frames"][0]["width"], found["frames"][0]["height"]
        ours.add(truth, found["stars"])
        wrong += len(detect(bin_dir, "streak", fits)[1]["streaks"])
        if has_peer:
            theirs.add(truth, peer(fits, folder)[1])
    result = {"frames": len(frames), "srfs": ours.result(), "false_streaks_per_frame": round(wrong / len(frames), 4)}
    if has_peer:
        result["source_extractor"] = theirs.result()
    return result


def measure_pattern(bin_dir, folder, frames):
    """Detectors whose fixed pattern is stronger than their noise, as they are and after `calibrate` with eight darks: no streak is in them."""
    result = {"frames": len(frames)}
    scores = {"without_dark": LensScore(), "with_dark": LensScore()}
    wrong = dict.fromkeys(scores, 0)
    for fits, truth in frames:
        masters = folder / f"masters_{fits.stem}"
        detect(bin_dir, "calibrate", "--calibration", masters, *sorted(fits.parent.glob(f"{fits.stem}_dark_*.fits")))
        for name, options in (("without_dark", []), ("with_dark", ["--calibration", masters])):
            _, found = detect(bin_dir, "star_centroid", *options, fits)
            truth["width"], truth["height"] = found["frames"][0]["width"], found["frames"][0]["height"]
            scores[name].add(truth, found["stars"])
            wrong[name] += len(detect(bin_dir, "streak", *options, fits)[1]["streaks"])
    for name, score in scores.items():
        result[name] = {**score.result(), "false_streaks_per_frame": round(wrong[name] / len(frames), 4)}
    return result


def measure_trails(bin_dir, frames):
    score = TrailScore()
    for fits, truth in frames:
        score.add(truth, detect(bin_dir, "streak", fits)[1]["streaks"])
    return score.result()


def measure_tracklets(bin_dir, sequences, *options):
    score, cpu = TrackletScore(), 0.0
    for files, truth in sequences:
        used, found = detect(bin_dir, "tracklet", *options, *files)
        score.add(truth, found)
        cpu += used
    return {**score.result(), "cpu_s_per_sequence": round(cpu / len(sequences), 3)}


def measure_known(bin_dir, frames):
    """Streaks before the Milky Way: without an attitude, and with the catalogue's stars taken for stars."""
    result = {}
    for name, options in (("without", []), ("with_sky", ["--params", "sky=1"])):
        score, solved = StreakScore(), 0
        for fits, truth in frames:
            _, found = detect(bin_dir, "streak", *options, fits)
            score.add(truth, found["streaks"])
            solved += bool(found["frames"][0].get("solution"))
        row = score.result()
        result[name] = {"frames": len(frames), "solved": solved, **{key: row[key] for key in ("streaks", "recall", "false_per_frame")}}
    return result


def measure_plates(bin_dir, frames):
    """Attitude of fields (set plate: 6 to 15 degrees wide; set lens: 2 to 60, with distortion); the time beside star_centroid on the same frames."""
    errors, pixels, rolls, rms, extra, wrong, unsolved = [], [], [], [], [], 0, []
    for fits, truth in frames:
        stars, found = detect(bin_dir, "star_centroid", fits)[1], detect(bin_dir, "plate_solve", fits)[1]
        extra.append(found["frames"][0]["cpu_ms"] - stars["frames"][0]["cpu_ms"])
        wanted, solution = truth["attitude"], found["solution"]
        if not solution:
            unsolved.append({"frame": truth["file"], "field_deg": round(wanted["field_deg"], 1), "stars": len(stars["stars"])})
            continue
        error = 3600 * apart_deg(wanted, solution)
        if error > max(30, 3 * wanted["scale_arcsec_px"]):
            wrong += 1
            continue
        errors.append(error)
        pixels.append(error / wanted["scale_arcsec_px"])
        rms.append(solution["rms_px"])
        rolls.append(abs((solution["roll_deg"] - wanted["roll_deg"] + 180) % 360 - 180))
    n = len(frames)
    return {"frames": n, "solved": round(len(errors) / n, 4), "wrong": wrong, "arcsec": quantiles(errors, "p50 max", digits=2) if errors else None,
            "px": quantiles(pixels, "p50 max", digits=3) if pixels else None, "rms_px": quantiles(rms, "p50 max", digits=3) if rms else None,
            "roll_deg_max": round(max(rolls), 4) if rolls else None, "ms_after_centroids": quantiles(extra, "p50 max", digits=1), "unsolved": unsolved[:20]}  # fmt: skip


def apart_deg(a, b):
    """Between two places on the sky."""
    a_dec, b_dec, ra = math.radians(a["dec_deg"]), math.radians(b["dec_deg"]), math.radians(a["ra_deg"] - b["ra_deg"])
    chord = math.sin((a_dec - b_dec) / 2) ** 2 + math.cos(a_dec) * math.cos(b_dec) * math.sin(ra / 2) ** 2
    return math.degrees(2 * math.asin(min(1, math.sqrt(chord))))


def measure_time(bin_dir, options, folder):
    """1920 x 1080, the best of several runs, alternately."""
    fits, _ = frames_of(bin_dir, folder, "stars_large", options, frames=1, width=1920, height=1080)[0]
    best = defaultdict(lambda: math.inf)
    for _ in range(7):
        for method in ("star_centroid", "streak"):
            cpu, found = detect(bin_dir, method, fits)
            best[method + "_process_cpu_ms"] = min(best[method + "_process_cpu_ms"], 1000 * cpu)
            best[method + "_ms"] = min(best[method + "_ms"], found["frames"][0]["cpu_ms"])
        if shutil.which("source-extractor"):
            best["source_extractor_process_cpu_ms"] = min(best["source_extractor_process_cpu_ms"], 1000 * peer(fits, folder)[0])
    result = {key: round(value, 1) for key, value in best.items()}
    if "source_extractor_process_cpu_ms" in result:
        result["ratio"] = round(result["star_centroid_process_cpu_ms"] / result["source_extractor_process_cpu_ms"], 3)
    return result


def measure_lossless(bin_dir, options, folder):
    """Packing in strips beside cfitsio's Rice tiles, in one process."""
    _, out = run_timed([str(Path(bin_dir) / "bench_image"), str(folder), "--set", "lossless", "--frames", "4", "--width", "1920", "--height", "1080", "--seed", str(options.seed)])
    return json.loads(out)


def add_options(parser):
    parser.add_argument("--frames", type=int, default=24, metavar="N", help="bench image: frames in each set")
    parser.add_argument("--seed", type=int, default=int(time.time()), help="bench image: seed of the frames (default: a new one each time, printed)")


def measure(bin_dir, options, say):
    with tempfile.TemporaryDirectory(prefix="srfs-bench-image-") as name:
        folder = Path(name)
        result = {"seed": options.seed}
        say(f"bench image: stars in {options.frames} frames, seed {options.seed}")
        result["stars"] = measure_stars(bin_dir, options, folder, frames_of(bin_dir, folder, "stars", options, frames=options.frames))
        for kind in ("streaks", "short", "empty"):
            say(f"bench image: {kind}")
            result[kind] = measure_streaks(bin_dir, frames_of(bin_dir, folder, kind, options, frames=options.frames))
        say("bench image: lenses with faults, and trails in their frames")
        result["camera"] = measure_lens(bin_dir, folder, frames_of(bin_dir, folder, "camera", options, frames=2 * options.frames))
        result["trails"] = measure_trails(bin_dir, frames_of(bin_dir, folder, "trails", options, frames=2 * options.frames))
        say("bench image: detectors with a fixed pattern, without and with a dark")
        result["pattern"] = measure_pattern(bin_dir, folder, frames_of(bin_dir, folder, "pattern", options, frames=max(2, options.frames // 2)))
        say("bench image: sequences of eight frames")
        result["sequences"] = measure_tracklets(bin_dir, frames_of(bin_dir, folder, "sequence", options, frames=max(2, options.frames // 3)))
        say("bench image: sequences of twelve frames with faint objects")
        faint = frames_of(bin_dir, folder, "faint", options, frames=max(2, options.frames // 3))
        result["faint"] = {name: measure_tracklets(bin_dir, faint, "--params", f"faint={value}") for name, value in (("without", 0), ("stacked", 1))}
        say("bench image: the Milky Way")
        result["dense"] = measure_known(bin_dir, frames_of(bin_dir, folder, "dense", options, frames=options.frames))
        result["finder"] = measure_known(bin_dir, frames_of(bin_dir, folder, "finder", options, frames=options.frames))
        say("bench image: attitude")
        result["plates"] = measure_plates(bin_dir, frames_of(bin_dir, folder, "plate", options, frames=2 * options.frames))
        result["lenses"] = measure_plates(bin_dir, frames_of(bin_dir, folder, "lens", options, frames=2 * options.frames))
        say("bench image: time")
        result["time_1920x1080"] = measure_time(bin_dir, options, folder)
        say("bench image: frames without loss")
        result["lossless_1920x1080"] = measure_lossless(bin_dir, options, folder)
    return result


def is_sound(result):
    """Nothing that no load excuses went wrong."""
    lossless = result["lossless_1920x1080"]
    return result["stars"]["srfs"]["found"] > 0 and result["plates"]["wrong"] + result["lenses"]["wrong"] == 0 and all(lossless[sky]["srfs"]["identical"] for sky in ("night", "bright_sky"))


def show(result):
    stars = result["stars"]
    print(f"  seed {result['seed']}")
    for name in ("srfs", "source_extractor"):
        if name not in stars:
            continue
        print(f"  {name}: {stars[name]['found']} found, purity {stars[name]['purity']}")
        for snr, row in stars[name]["bins"].items():
            print(f"    SNR {snr:9} {row['stars']:6} stars, completeness {row['completeness']}, rms {row['rms_over_limit']} of the Cramer-Rao bound, 68 % within {row['core_over_limit']}")
    for name in ("streaks", "short", "empty"):
        row = result[name]
        print(f"  {name}: recall {row['recall']} of {row['streaks']}, {row['false_per_frame']} false a frame; cross-track {row['cross_track_px']}, angle {row['angle_deg']}, length {row['length_px']}")
    lens, row = result["camera"], result["trails"]
    for name in ("srfs", "source_extractor"):
        if name in lens:
            print(f"  lenses with faults, {name}: {lens[name]['completeness']} of {lens[name]['bright']} stars of SNR >= 30, purity {lens[name]['purity']}")
    print(f"  the same: {lens['false_streaks_per_frame']} false streaks a frame")
    print(f"  trails: {row['found']} of {row['trails']} found, length within 10 % {row['length_within_10_percent']}, {row['false_per_frame']} false a frame")
    for name in ("without_dark", "with_dark"):
        row = result["pattern"][name]
        print(f"  fixed pattern, {name.replace('_', ' ')}: {row['completeness']} of {row['bright']} stars of SNR >= 30, {row['found']} found, purity {row['purity']}, {row['false_streaks_per_frame']} false streaks a frame")
    row = result["sequences"]
    print(f"  tracklets in {row['sequences']} sequences of 8: recall {row['recall']}, {row['false_per_sequence']} false a sequence; registration {row['registration_rms_px']} px rms, {row['frames_not_registered']} frames not registered")
    print(f"  streaks of 10 to 20 px after the veto of all frames: {row['streaks_10_20_after_veto']}")
    for name, row in result["faint"].items():
        print(f"  SNR 3 to 4 in 12 frames, {name}: recall {row['recall']}, {row['false_per_sequence']} false a sequence, {row['cpu_s_per_sequence']} s")
    for name, kind in (("dense", "streaks before the Milky Way"), ("finder", "the Milky Way in 8 bits, no streak")):
        for how, row in result[name].items():
            print(f"  {kind}, {how}: {row['solved']} of {row['frames']} solved, recall {row['recall']}, {row['false_per_frame']} false a frame")
    for name, kind in (("plates", "fields 6 to 15 degrees wide"), ("lenses", "fields 2 to 60 degrees wide, distortion up to 5 %")):
        row = result[name]
        print(f"  attitude of {row['frames']} {kind}: {row['solved']} solved, {row['wrong']} wrong, arcsec {row['arcsec']}, px {row['px']}, rms px {row['rms_px']}, ms after the centroids {row['ms_after_centroids']}")
    print(f"  1920 x 1080: {json.dumps(result['time_1920x1080'])}")
    for sky in ("night", "bright_sky"):
        row = result["lossless_1920x1080"][sky]
        print(f"  without loss, sky of {row['background_e']:.0f} e: {json.dumps(row['srfs'])} beside 12 bits a pixel; cfitsio {json.dumps(row['cfitsio_rice'])}; size {row['size_beside_cfitsio']}, time {row['time_beside_cfitsio']} of cfitsio's")
