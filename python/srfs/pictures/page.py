# SPDX-FileCopyrightText: 2026 SRFS contributors
# SPDX-License-Identifier: Apache-2.0
"""docs/pictures/page*.png: the operator's page with a flight of the simulation."""

import base64
import time

from srfs.flight import mission
from srfs.flight.serving import GroundServer
from srfs.web.browser import browser, wait_for

WIDTH, HEIGHT = 1440, 860
CAPTURE = {"name": "image.capture", "arguments": {"frames": 2, "exposure_us": 50000}}
PLOT = "plots?p=payload_eps.battery_voltage_v,payload_adcs.pointing_error_deg&span=5"
DEADLINE_S = 120
FLIGHT_S = 90  # until the plots have something to show
TASKS = 4  # the overview shows the first frame of a task; one of them has streaks in it


def make(bin_dir, folder, out):
    """Flies, takes a picture of the sky, and pictures of four views."""
    var = folder / "var"
    with mission.Mission(var, "sim", bin_dir) as flight:
        server = GroundServer(bin_dir, var, flight.deployment, "127.0.0.1:0", var / "log" / "serve.log")
        try:
            with browser(WIDTH, HEIGHT) as driver:
                photograph(driver, server.url, out)
        finally:
            server.stop()


def photograph(driver, url, out):
    def wait(script, what):
        wait_for(lambda: driver.execute_script(script), what, DEADLINE_S)

    def picture(view, ready, name):
        driver.execute_script("location.hash = arguments[0]", f"#/{view}")
        wait(ready, view)
        time.sleep(1)  # plots draw in a frame of their own
        shot = driver.execute_cdp_cmd("Page.captureScreenshot", {"format": "png"})
        (out.parent / f"{out.stem}{name}.png").write_bytes(base64.b64decode(shot["data"]))

    driver.get(url)
    wait("return document.body.classList.contains('ready')", "the page")
    driver.execute_script("localStorage.setItem('srfs.theme', 'dark')")
    for task in range(1, TASKS + 1):
        driver.execute_script("srfs.model.api.post('telecommands', arguments[0])", {**CAPTURE, "arguments": {**CAPTURE["arguments"], "task": task}})
        time.sleep(FLIGHT_S / TASKS)
    driver.refresh()
    wait("return document.body.classList.contains('ready')", "the page")
    picture("overview", "return document.querySelector('.panel.attitude dd') !== null", "")
    picture("commands/ttc.transmitter_off?duration_s=60", "return document.querySelector('form.command')?.dataset.checked === 'good'", "_command")
    picture(PLOT, "return document.querySelector('time-plot')?.series[1]?.points.length > 0", "_plot")
    picture("files", f"return document.querySelectorAll('figure.whole[data-state=shown]').length === {TASKS}", "_files")
