# SPDX-FileCopyrightText: 2026 SRFS contributors
# SPDX-License-Identifier: Apache-2.0
"""docs/pictures/imaging.png: flies the simulated spacecraft with its camera at Orion's belt, has debris cross the field, orders a picture by
telecommand and draws what srfs-detect finds in the frames. About 20 s."""

from srfs.flight import deployments, mission
from srfs.flight.processes import output
from srfs.program import MissionError

CAMERA = {"pointing": {"ra_deg": 84.05, "dec_deg": -2.5, "roll_deg": 12}, "fwhm_px": 3, "debris": {"magnitude": 5.5, "rate_deg_s": 1.2}}
TASK = 1
ORDER = f"tc image.capture task={TASK} exposure_us=150000 gain_db=20 frames=8 interval_ms=250 method=tracklet"
WIDTH = 800
DEADLINE_S = 60


def frames_of_a_flight(bin_dir, folder):
    """Paths of the frames of one imaging task."""
    sim = deployments.read("sim")
    sim["simulation"]["camera"] = CAMERA
    with mission.Mission(folder / "var", deployments.write(sim, folder / "sim.yaml"), bin_dir, say=print) as flight:
        flight.control({"camera": {"pass": True}})
        outcome = flight.ground().command(ORDER, DEADLINE_S) or {}
        if outcome.get("stage") != "completed":
            raise MissionError(f"no picture: {outcome}")
        return sorted((flight.var / "images/frames" / f"{TASK:010}").glob("*.fits"))


def make(bin_dir, folder, out):
    output(bin_dir / "srfs-detect", "--method", "tracklet", "--draw", out, "--draw-width", WIDTH, *frames_of_a_flight(bin_dir, folder))
