# SPDX-FileCopyrightText: 2026 SRFS contributors
# SPDX-License-Identifier: Apache-2.0
"""python/srfs/vm/guest.py without a virtual machine: the kernel cache, and the messages about a guest that fails."""

import argparse
import contextlib
import io
import json
import lzma
import pathlib
import shutil
import tempfile
import unittest
from unittest import mock

from srfs.vm import guest

PACKAGE = "linux-image-6.1.0-1-amd64"


class VmTest(unittest.TestCase):
    def setUp(self):
        self.folder = pathlib.Path(tempfile.mkdtemp(prefix="srfs-test-vm-"))
        self.addCleanup(shutil.rmtree, self.folder)
        self.said = []
        patch = mock.patch.dict("os.environ", XDG_CACHE_HOME=str(self.folder))
        patch.start()
        self.addCleanup(patch.stop)

    def kernel(self, name=PACKAGE):
        """Makes a kernel in the cache, as unpack() leaves it."""
        kernel = guest.cache_folder() / name
        (kernel / "lib").mkdir(parents=True)
        (kernel / "vmlinux").write_bytes(b"\x7fELF kernel")
        (kernel / "lib" / "vcan.ko").write_bytes(b"module")
        sizes = {"vmlinux": 11, "lib/vcan.ko": 6}
        (kernel / "contents.json").write_text(json.dumps({"vmlinux": guest.sha256(kernel / "vmlinux"), "sizes": sizes}))
        return kernel

    def kernel_folder(self, newest=PACKAGE, fetch=None, kind="amd64"):
        with mock.patch.object(guest, "newest_package", lambda kind: newest), mock.patch.object(guest, "fetch", fetch or self.no_network):
            return guest.kernel_folder(self.said.append, kind)

    def no_network(self, *arguments):
        raise guest.CannotRun("no network")


class CacheTest(VmTest):
    def test_a_whole_kernel_is_used_without_network(self):
        kernel = self.kernel()
        self.assertEqual(self.kernel_folder(), kernel)
        self.assertEqual(self.kernel_folder(newest=None), kernel, "apt's lists are empty")

    def test_every_damage_is_noticed_and_the_kernel_fetched_again(self):
        damages = {
            "another octet": lambda kernel: (kernel / "vmlinux").write_bytes(b"\x7fELF kernem"),
            "half a module": lambda kernel: (kernel / "lib" / "vcan.ko").write_bytes(b"mod"),
            "no module": lambda kernel: (kernel / "lib" / "vcan.ko").unlink(),
            "no list": lambda kernel: (kernel / "contents.json").unlink(),
            "half a list": lambda kernel: (kernel / "contents.json").write_text("{"),
        }
        for name, damage in damages.items():
            with self.subTest(name):
                kernel = self.kernel()
                damage(kernel)
                self.assertEqual(self.kernel_folder(fetch=lambda package, *more: package), PACKAGE)
                self.assertFalse(kernel.exists())

    def test_an_older_kernel_serves_while_the_newer_cannot_be_fetched(self):
        older = self.kernel("linux-image-6.1.0-0-amd64")
        self.assertEqual(self.kernel_folder(), older)
        self.assertIn("no network", self.said[0])

    def test_the_real_time_kernel_and_the_usual_one_are_kept_side_by_side(self):
        usual, real_time = self.kernel(), self.kernel("linux-image-6.1.0-1-rt-amd64")
        self.assertEqual(self.kernel_folder(newest=None), usual)
        self.assertEqual(self.kernel_folder(newest=None, kind="rt"), real_time)
        self.assertEqual(self.kernel_folder("linux-image-6.1.0-2-rt-amd64", kind="rt"), real_time, "the older of the same kind")

    def test_without_kernel_and_network_the_reason_is_said(self):
        with self.assertRaisesRegex(guest.CannotRun, "cannot be fetched.*no network"):
            self.kernel_folder()

    def test_what_an_interrupted_run_left_is_removed(self):
        half = guest.cache_folder() / "new.abc"
        half.mkdir(parents=True)
        self.kernel_folder(fetch=lambda *arguments: None)
        self.assertFalse(half.exists())

    def test_the_kernel_is_found_inside_its_compressed_image(self):
        image = self.folder / "vmlinuz"
        image.write_bytes(b"MZ \xfd7zXZ\x00 not yet " + lzma.compress(b"\x7fELF kernel") + b" and more")
        self.assertEqual(guest.extract_vmlinux(image), b"\x7fELF kernel")
        image.write_bytes(b"MZ nothing")
        with self.assertRaises(guest.CannotRun):
            guest.extract_vmlinux(image)


class GuestTest(VmTest):
    """A shell script replaces QEMU; its first argument is the exchange folder."""

    def guest(self, script, deadline_s=60):
        """(exit code, standard output) of a run whose guest executes `script`."""
        program = self.folder / "qemu"
        program.write_text(f"#!/bin/sh\ncd $1\n{script}\n")
        program.chmod(0o755)
        options = argparse.Namespace(deadline=deadline_s, keep=False, kernel="amd64")
        out = mock.Mock(buffer=io.BytesIO())
        with contextlib.ExitStack() as patches:
            patches.enter_context(mock.patch.object(guest, "kernel_folder", lambda say, kind: self.folder))
            patches.enter_context(mock.patch.object(guest, "prepare", lambda exchange, kernel, command: None))
            patches.enter_context(mock.patch.object(guest, "qemu_command", lambda kernel, exchange, *more: [str(program), str(exchange)]))
            patches.enter_context(mock.patch.object(guest.platform, "machine", lambda: "x86_64"))
            patches.enter_context(mock.patch.object(guest.shutil, "which", lambda name: name))
            patches.enter_context(mock.patch.object(guest.sys, "stdout", out))
            patches.enter_context(contextlib.redirect_stderr(io.StringIO()))
            return guest.run(["true"], options, self.said.append), out.buffer.getvalue()

    def test_output_and_exit_code_are_those_of_the_command(self):
        self.assertEqual(self.guest("echo hello > output; echo 4.5 > booted_s; echo 7 > exit_code"), (7, b"hello\n"))

    def test_a_guest_that_does_not_end_is_ended(self):
        self.assertEqual(self.guest("echo 4.5 > booted_s; exec sleep 1000", deadline_s=0.5)[0], guest.EXIT_HUNG)
        self.assertIn("hung", self.said[-1])

    def test_a_guest_that_goes_off_without_an_exit_code_has_reset_itself(self):
        self.assertEqual(self.guest("echo partly > output"), (guest.EXIT_RESET, b"partly\n"))
        self.assertIn("reset itself", self.said[-1])

    def test_another_processor_is_refused_in_words(self):
        with mock.patch.object(guest.platform, "machine", lambda: "aarch64"), self.assertRaisesRegex(guest.CannotRun, "modprobe vcan"):
            guest.run(["true"], None, self.said.append)


if __name__ == "__main__":
    unittest.main()
