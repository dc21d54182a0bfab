# SPDX-FileCopyrightText: 2026 SRFS contributors
# SPDX-License-Identifier: Apache-2.0
"""A headless browser: Debian's chromium by Debian's selenium."""

import contextlib
import os
import shutil
import tempfile
import time

from srfs.program import MissingProgram


def missing():
    """What is to be installed before a page can be opened; empty: nothing."""
    found = []
    if not shutil.which("chromium"):
        found.append("chromium")
    if not shutil.which("chromedriver"):
        found.append("chromium-driver")
    try:
        import selenium  # noqa: F401
    except ImportError:
        found.append("python3-selenium")
    return found


@contextlib.contextmanager
def browser(width=1280, height=800, dark=True, scale=1):
    """A browser with a profile of its own; it ends with the block."""
    if packages := missing():
        raise MissingProgram(packages[0], " ".join(packages))
    from selenium import webdriver
    profile = tempfile.mkdtemp(prefix="srfs_browser_")
    options = webdriver.ChromeOptions()
    options.binary_location = shutil.which("chromium")
    for option in ("--headless=new", "--disable-gpu", "--disable-dev-shm-usage", "--no-first-run", "--hide-scrollbars", "--disable-extensions", "--disable-background-networking",
                   f"--user-data-dir={profile}", f"--window-size={width},{height}", f"--force-device-scale-factor={scale}",
                   *(["--no-sandbox"] if os.geteuid() == 0 else []), *(["--blink-settings=preferredColorScheme=0"] if dark else [])):
        options.add_argument(option)
    options.set_capability("goog:loggingPrefs", {"browser": "ALL"})
    driver = webdriver.Chrome(service=webdriver.ChromeService(shutil.which("chromedriver")), options=options) if hasattr(webdriver, "ChromeService") else _old_chrome(webdriver, options)
    try:
        driver.set_window_size(width, height)
        yield driver
    finally:
        driver.quit()
        shutil.rmtree(profile, ignore_errors=True)


def _old_chrome(webdriver, options):
    from selenium.webdriver.chrome.service import Service
    return webdriver.Chrome(service=Service(shutil.which("chromedriver")), options=options)


def wait_for(condition, what, deadline_s=30, state=lambda: ""):
    """Waits until condition() is true, and returns it. An element that went away meanwhile is no answer yet. state(): more for the failure."""
    from selenium.common.exceptions import WebDriverException
    end = time.monotonic() + deadline_s
    problem = ""
    while time.monotonic() < end:
        try:
            if found := condition():
                return found
        except WebDriverException as error:
            problem = f" ({error.msg})"
        time.sleep(0.02)
    raise AssertionError(f"{what}: not within {deadline_s} s{problem} {state()}".rstrip())
