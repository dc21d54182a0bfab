# SPDX-FileCopyrightText: 2026 SRFS contributors
# SPDX-License-Identifier: Apache-2.0
"""The scripts of packaging/initramfs with played folders and commands. python/srfs/vm/initramfs.py runs them in a real initramfs."""

import hashlib
import re
import shutil
import subprocess
import tempfile
import unittest
from pathlib import Path

SCRIPTS = Path(__file__).resolve().parents[3] / "packaging" / "initramfs"
PLAYED = ("blkid", "force_load", "mount", "reboot", "sleep", "sync", "umount")
REAL = ("basename", "cp", "grep", "mkdir", "readlink", "sed", "sha256sum")


class Scripts(unittest.TestCase):
    def setUp(self):
        self.folder = Path(tempfile.mkdtemp())
        self.addCleanup(shutil.rmtree, self.folder)
        self.said = self.folder / "said"
        self.said.touch()
        # Nothing else is found: no script can restart or mount anything here.
        self.commands = self.folder / "commands"
        self.commands.mkdir()
        for name in PLAYED:
            self.program(self.commands / name, f'echo "{name}${{1:+ }}$*" >> {self.said}')
        for name in REAL:
            (self.commands / name).symlink_to(shutil.which(name))

    def program(self, path, text):
        path.write_text(f"#!/bin/sh\n{text}\n")
        path.chmod(0o700)

    def copy_of_rescue(self, parent, name, end, settings="whole"):
        folder = parent / name
        folder.mkdir(parents=True)
        self.program(folder / "srfs_rescue", f'[ "$1" = --version ] && exit 0\necho "{name} $*" >> {self.said}\n{end}')
        (folder / "settings").write_text(settings)
        digests = ((hashlib.sha256((folder / file).read_bytes()).hexdigest(), file) for file in ("srfs_rescue", "settings"))
        (folder / "SHA256SUMS").write_text("".join(f"{digest}  {file}\n" for digest, file in digests))
        return folder

    def run_script(self, name, **environment):
        """What the played commands were called with, in order."""
        text = (SCRIPTS / name).read_text(encoding="utf-8")
        places = r"(?<!\w)/(?:srfs-rescue|var/lib|sys|usr/share/initramfs-tools)(?=[/ ])"
        script = self.folder / name
        script.write_text(re.sub(places, lambda place: f"{self.folder}{place[0]}", text), encoding="utf-8")
        done = subprocess.run(["/bin/sh", script], env={"PATH": str(self.commands), **environment}, stdin=subprocess.DEVNULL, capture_output=True, text=True, timeout=60, check=False)
        self.assertEqual(done.returncode, 0, done.stderr)
        return self.said.read_text().splitlines()


class PanicTest(Scripts):
    def setUp(self):
        super().setUp()
        self.copies = self.folder / "srfs-rescue"
        self.called = f"answer --settings {self.copies}/a/settings --settings {self.copies}/b/settings"

    def panic(self):
        said = self.run_script("panic")
        return [line.replace(self.called, "answers") for line in said if line.split()[0] in ("a", "b", "sleep", "reboot")]

    def test_where_nothing_is_prepared_nothing_restarts_the_computer(self):
        self.assertEqual(self.panic(), [])
        self.assertEqual(self.said.read_text(), "")

    def test_an_order_to_restart_restarts_at_once_and_wakes_no_second_copy(self):
        self.copy_of_rescue(self.copies, "a", "exit 75")
        self.copy_of_rescue(self.copies, "b", "exit 75")
        self.assertEqual(self.panic(), ["a answers", "reboot -f"])

    def test_the_settings_of_one_copy_serve_the_program_of_the_other(self):
        rotten = self.copy_of_rescue(self.copies, "a", "exit 75") / "srfs_rescue"
        rotten.write_text(rotten.read_text() + "# rotten\n")
        (self.copy_of_rescue(self.copies, "b", "exit 75") / "settings").write_text("rotten")
        self.assertEqual(self.panic(), ["b answers", "reboot -f"])

    def test_behind_a_program_that_crashes_or_finds_no_settings_the_other_copy_is_tried(self):
        self.copy_of_rescue(self.copies, "a", "kill -SEGV $$")
        self.copy_of_rescue(self.copies, "b", "exit 75")
        self.assertEqual(self.panic(), ["a answers", "b answers", "reboot -f"])

    def test_where_no_copy_answers_there_is_time_before_the_restart(self):
        self.copy_of_rescue(self.copies, "a", "exit 3")
        (self.copy_of_rescue(self.copies, "b", "exit 75") / "SHA256SUMS").unlink()
        self.assertEqual(self.panic(), ["a answers", "sleep 60", "reboot -f"])


class HookTest(Scripts):
    def setUp(self):
        super().setUp()
        functions = self.folder / "usr/share/initramfs-tools/hook-functions"
        functions.parent.mkdir(parents=True)
        functions.touch()

    def device(self, class_name, name, *drivers):
        """A device below one for each driver, the first of them the nearest; an empty name: a driver that is no module."""
        place = self.folder / "sys/devices"
        for driver in reversed(drivers):
            place /= driver or "built-in"
            (place / "driver").mkdir(parents=True)
            if driver:
                (self.folder / "sys/module" / driver).mkdir(parents=True)
                (place / "driver/module").symlink_to(self.folder / "sys/module" / driver)
        entry = self.folder / "sys/class" / class_name / name
        entry.mkdir(parents=True)
        (entry / "device").symlink_to(place)

    def test_without_a_prepared_copy_nothing_is_copied(self):
        self.assertEqual(self.run_script("hook", DESTDIR=str(self.folder / "made")), [])
        self.assertFalse((self.folder / "made").exists())

    def test_copies_and_drivers_of_line_and_watchdog_are_taken(self):
        (self.folder / "srfs_rs422").symlink_to("ttyUSB7")
        (self.folder / "ttyUSB7").touch()
        self.device("tty", "ttyUSB7", "ftdi_sio", "", "xhci_pci")
        self.device("tty", "ttyS0", "of_another_line")
        self.device("watchdog", "watchdog0", "dw_wdt")
        whole = self.copy_of_rescue(self.folder / "var/lib/srfs-rescue", "b", "exit 75", f"var /v\nrs422 serial:{self.folder}/srfs_rs422 115200\n")
        made = self.folder / "made"
        self.assertEqual(self.run_script("hook", DESTDIR=str(made)), ["force_load ftdi_sio", "force_load xhci_pci", "force_load dw_wdt"])
        for file in ("srfs_rescue", "settings", "SHA256SUMS"):
            self.assertEqual((made / "srfs-rescue/b" / file).read_bytes(), (whole / file).read_bytes())
        self.assertFalse((made / "srfs-rescue/a").exists())


if __name__ == "__main__":
    unittest.main()
