# SPDX-FileCopyrightText: 2026 SRFS contributors
# SPDX-License-Identifier: Apache-2.0
"""A disk of VAR that fails: read-only, full. Each time the ground gets an answer, and brings the suite back once the disk works
(programs/rescue/README.md, "Failing storage").

VAR is an ext4 of its own. srfs_rescue, programs and simulated devices lie elsewhere, as on a board with a partition for data. Needs root.
"""

import contextlib
import json
import os
import pathlib
import subprocess
import tempfile
import unittest

from srfs.campaign import rescue
from srfs.flight import deployments, mission
from srfs.flight.processes import PATIENCE, wait_until

BIN = pathlib.Path(os.environ["SRFS_BIN"])
PATIENCE_S = 90 * PATIENCE
DISK_MIB = 256


def run(*words):
    return subprocess.run([str(word) for word in words], check=True, stdin=subprocess.DEVNULL, capture_output=True, text=True).stdout.strip()


def free_mib(folder):
    info = os.statvfs(folder)
    return info.f_bavail * info.f_frsize >> 20


def step_of(board):
    return json.loads(board.srfs(board.whole_bin, "rescue", "step", "--json").stdout)


class Disk:
    """An ext4 of its own on a loop device."""

    def __init__(self, image, mount_point):
        self.mount_point = mount_point
        image.touch()
        os.truncate(image, DISK_MIB << 20)
        self.device = run("losetup", "--find", "--show", image)
        run("mkfs.ext4", "-q", "-m", "0", self.device)
        self.mount()

    def mount(self):
        run("mount", "-o", "errors=remount-ro", self.device, self.mount_point)

    def unmount(self):
        wait_until(lambda: subprocess.run(["umount", self.mount_point], capture_output=True).returncode == 0, PATIENCE_S, "nothing uses the disk")

    def close(self):
        self.unmount()
        run("losetup", "--detach", self.device)


class FailingStorageTest(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        for module in ("loop", "ext4"):
            subprocess.run(["modprobe", module], check=False)  # built-in ones show below
        folder = pathlib.Path(cls.enterClassContext(tempfile.TemporaryDirectory(prefix="srfs-vm-storage-")))
        content = deployments.read("vcan")  # for an emulated processor
        content["devices"]["can"] = deployments.read("sim")["devices"]["can"]
        cls.board = rescue.Board(folder / "board", BIN, own_programs=False, content=content)
        # On a slow machine a payload may be fenced in its slot, and without a ring it is not restarted.
        cls.board.nodes = ["timing", "can_switcher", "ttc"]
        cls.board.var.mkdir()
        cls.disk = Disk(folder / "disk", cls.board.var)
        cls.addClassCleanup(cls.disk.close)
        cls.enterClassContext(cls.board)
        cls.addClassCleanup(mission.forget_memory, cls.board.var)
        cls.board.start()
        cls.come_up("the suite flies once")

    @classmethod
    def come_up(cls, what):
        try:
            wait_until(cls.board.all_active, 3 * PATIENCE_S, what)
        except Exception:
            print(cls.board.said.read_text()[-4000:])
            mission.show_logs(cls.board.var)
            raise

    def land(self):
        """The suite ends in order."""
        self.board.end_starter()
        self.board.srfs(self.board.whole_bin, "down")

    def start_until_answered(self):
        """Starts it. Returns what answers, rescue or suite."""
        self.board.start()
        wait_until(lambda: self.board.ping(5), 3 * PATIENCE_S, "the ground gets an answer")
        return self.board.speaker()

    def orders(self, *words):
        done, output = self.board.order(*words)
        self.assertTrue(done, output)

    def fill(self):
        """No block is left."""
        filler = self.board.var / "store" / "filler"
        with open(filler, "ab", buffering=0) as file:
            for octets in (1 << 20, 4096, 1):
                with contextlib.suppress(OSError):
                    while file.write(bytes(octets)):
                        pass
                with contextlib.suppress(OSError):
                    os.fsync(file.fileno())

    def test_on_a_read_only_disk_rescue_answers_within_one_start_of_the_computer(self):
        self.land()
        run("mount", "-o", "remount,ro", self.board.var)

        self.assertEqual(self.start_until_answered(), "rescue")

        self.assertIn("suite is down", self.board.ground("status", "--timeout", 60 * PATIENCE).stdout)
        run("mount", "-o", "remount,rw", self.board.var)
        self.orders("rescue.start_suite")
        self.come_up("the suite runs again")

    def test_a_full_disk_is_counted_on_answered_for_and_freed_by_one_order(self):
        self.land()
        self.fill()

        self.assertEqual(self.start_until_answered(), "rescue")

        step = step_of(self.board)
        self.assertEqual((step["step"], step["cause"]), ("rescue", "unhealthy_starts"), "counted on the full disk")
        self.assertTrue((self.board.var / "set_aside" / str(step["set_aside"]) / "store" / "filler").exists(), "and its measures taken")
        self.orders("rescue.reset", "part=stores")
        self.assertGreater(free_mib(self.board.var), DISK_MIB / 2)
        self.orders("rescue.start_suite")
        self.come_up("the suite runs again")


if __name__ == "__main__":
    unittest.main()
