# SPDX-FileCopyrightText: 2026 SRFS contributors
# SPDX-License-Identifier: Apache-2.0
"""`srfs new` in the tree itself: each kind is built by the commands that it names, passes its test and flies. Outside the tree the tutorials do the
same (test_tutorials.py).

The tree and its build folder are covered by an overlay that this process and its children alone see. So what is there is built already, and nothing of
it is changed."""

import ctypes
import json
import os
import shlex
import subprocess
import unittest

from support import BIN, DEADLINE_S, ROOT, SystemTest

BUILD_DEADLINE_S = 3600  # a payload changes the mission's dictionary, which most sources include
CLONE_NEWNS = 0x20000
MS_REC = 0x4000
MS_PRIVATE = 1 << 18


def _checked(result, what):
    if result != 0:
        raise unittest.SkipTest(f"{what}: {os.strerror(ctypes.get_errno())}")


@unittest.skipUnless(os.geteuid() == 0, "covers the tree with an overlay, as root")
class OverlayTest(SystemTest):
    def setUp(self):
        super().setUp()
        libc = ctypes.CDLL(None, use_errno=True)
        changes, work = self.folder / "overlay/changes", self.folder / "overlay/work"
        for folder in (changes, work):
            folder.mkdir(parents=True)
        _checked(libc.unshare(CLONE_NEWNS), "a mount namespace")
        _checked(libc.mount(b"none", b"/", None, MS_REC | MS_PRIVATE, None), "mounts of its own")
        options = f"lowerdir={ROOT},upperdir={changes},workdir={work}"
        _checked(libc.mount(b"overlay", str(ROOT).encode(), b"overlay", 0, options.encode()), "an overlay")
        self.addCleanup(libc.umount2, str(ROOT).encode(), 2)

    def do(self, *command):
        done = subprocess.run([str(c) for c in command], stdin=subprocess.DEVNULL, capture_output=True, text=True, timeout=BUILD_DEADLINE_S, cwd=ROOT)
        self.assertEqual(done.returncode, 0, f"{command}\n{done.stdout[-4000:]}\n{done.stderr[-4000:]}")
        return done.stdout

    def new(self, kind, name, folder):
        """Writes it. Returns the commands to type next."""
        return json.loads(self.do(BIN / "srfs", "new", kind, name, "--in", folder, "--json"))["next"]

    def build_and_test(self, commands):
        """The first two of what it said to type next."""
        build, test = commands[:2]
        self.do(*shlex.split(build))
        self.assertIn("100% tests passed", self.do(*shlex.split(test), "--no-tests=error"))


class InTheTreeTest(OverlayTest):
    def test_a_node_with_a_telecommand_and_a_method_are_built_tested_and_flown(self):
        examples = ROOT / "examples"
        node = self.new("node", "ticker", examples)
        telecommand = self.new("telecommand", "set_start", examples / "ticker")
        method = self.new("method", "glint", examples)
        for commands in (node, telecommand, method):
            self.build_and_test(commands)
        with self.flight("sim") as flight:
            for commands in (node, method):
                self.do(*shlex.split(commands[2]), "--deployment", flight.deployment, "--var", self.var)
            ground = flight.ground()  # it reads the fragments that are there
            self.assertIsNotNone(ground.housekeeping("ticker", DEADLINE_S, matches=lambda f: f["ticks"] > 0))
            self.complete(ground, "tc ticker.set_start value=5")
            self.complete(ground, "tc ticker.clear")
            self.assertIsNotNone(ground.housekeeping("ticker", DEADLINE_S, matches=lambda f: f["clears"] == 1))
            self.assertIsNotNone(ground.housekeeping("image_glint", DEADLINE_S), "ttc knows its fragment")
            self.complete(ground, "tc image.capture task=1 frames=2 exposure_us=100000 interval_ms=300")
            self.assertIsNotNone(ground.housekeeping("image_glint", DEADLINE_S, matches=lambda f: f["frames"] == 2))


class PayloadInTheTreeTest(OverlayTest):
    def test_a_payload_with_a_telecommand_of_its_own_is_built_tested_and_flown(self):
        self.new("payload", "radiation", ROOT / "mission")
        self.build_and_test(self.new("telecommand", "set_gain", ROOT / "mission/payload_radiation"))
        self.do("cmake", "--build", BIN.parent, "--target", "programs")  # as ./run sim does
        with self.flight("sim") as flight:
            ground = flight.ground()
            self.assertIsNotNone(ground.housekeeping("payload_radiation", DEADLINE_S, matches=lambda f: f["threshold_v"] == 0.5))
            self.complete(ground, "tc radiation.set_threshold threshold_v=1")
            self.complete(ground, "tc radiation.set_gain value=5")
            self.assertIsNotNone(ground.housekeeping("payload_radiation", DEADLINE_S, matches=lambda f: f["threshold_v"] == 1))
            self.assertIsNotNone(ground.housekeeping("payload_radiation_work", DEADLINE_S, matches=lambda f: f["state"] == "active"))
            flight.control({"peripheral": "radiation", "fault": "burst"})
            self.wait_for_event(ground, "radiation.burst")
            self.assertIsNotNone(ground.housekeeping("payload_eps", DEADLINE_S), "the others fly on")
