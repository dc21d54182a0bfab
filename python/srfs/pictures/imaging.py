#!/usr/bin/python3
# SPDX-FileCopyrightText: 2026 SRFS contributors
# SPDX-License-Identifier: Apache-2.0
"""Makes docs/pictures/imaging.png: flies the simulated spacecraft with its camera at Orion's belt, has debris cross the field, orders a picture by telecommand and draws
what srfs-detect finds in the frames. About 20 s after ./run build.

python3 -m srfs.pictures.imaging [--bin DIR] [--out FILE]
"""

import argparse
import subprocess
import tempfile
from pathlib import Path

from srfs import ROOT
from srfs.flight import mission
from srfs.program import MissionError, run_program

POINTING = "pointing: {ra_deg: 84.05, dec_deg: -2.5, roll_deg: 12}, fwhm_px: 3, debris: {magnitude: 5.5, rate_deg_s: 1.2}"
TASK = 1
ORDER = f"tc image.capture task={TASK} exposure_us=150000 gain_db=20 frames=8 interval_ms=250 method=tracklet"
WIDTH = 800
DEADLINE_S = 60


def frames_of_a_flight(bin_dir, folder):
    """Paths of the frames of one imaging task."""
    text = (ROOT / "launch_config/sim.yaml").read_text()
    deployment = folder / "sim.yaml"
    deployment.write_text(f"{text}  camera: {{ {POINTING} }}\n")  # `simulation:` stands last
    with mission.Mission(folder / "var", str(deployment), bin_dir, say=print) as flight:
        flight.control({"camera": {"pass": True}})
        outcome = flight.ground().command(ORDER, DEADLINE_S) or {}
        if outcome.get("stage") != "completed":
            raise MissionError(f"no picture: {outcome}")
        return sorted((flight.var / "images/frames" / f"{TASK:010}").glob("*.fits"))


def main():
    parser = argparse.ArgumentParser(description="Makes docs/pictures/imaging.png from a flight of the simulated spacecraft.")
    parser.add_argument("--bin", type=Path, default=ROOT / "build-release/bin", help="default: build-release/bin")
    parser.add_argument("--out", type=Path, default=ROOT / "docs/pictures/imaging.png", help="default: docs/pictures/imaging.png")
    options = parser.parse_args()
    with tempfile.TemporaryDirectory(prefix="srfs_picture_") as folder:
        frames = frames_of_a_flight(options.bin, Path(folder))
        command = [options.bin / "srfs-detect", "--method", "tracklet", "--draw", options.out, "--draw-width", str(WIDTH), *frames]
        subprocess.run(command, check=True, stdin=subprocess.DEVNULL)
    print(options.out)
    return 0


if __name__ == "__main__":
    run_program("pictures.imaging", main)
