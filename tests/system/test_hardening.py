# SPDX-FileCopyrightText: 2026 SRFS contributors
# SPDX-License-Identifier: Apache-2.0
"""All flight software is hardened: installed, built, and compiled on board. For the Debian package, see test_debian_package.py."""

import subprocess
import unittest
from pathlib import Path

from support import BIN, TemporaryFolder
from test_lane import LaneTest

from srfs import ROOT, hardening
from srfs.flight.processes import output

BUILD = Path(BIN).parent
BIG = 200_000  # octets; a stripped file of this size has a buffer on the stack somewhere

# Contains what the compiler guards: a buffer on the stack and a copy of unknown length into it.
GUARDED = """#include <cstdio>
#include <cstring>
int main(int argc, char** argv) {
  char text[16];
  std::memcpy(text, argv[0], static_cast<unsigned>(argc));
  return std::puts(text);
}
"""


def built_with(folder, *options):
    """Compiles GUARDED with these options. Returns what hardening.read() finds in the program."""
    source, program = folder / "guarded.cpp", folder / "guarded"
    source.write_text(GUARDED)
    output("g++", "-O2", *options, source, "-o", program)
    return hardening.read(program)


class HardeningTest(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        folder = TemporaryFolder()
        cls.addClassCleanup(folder.cleanup)
        cls.folder = Path(folder.name)
        output("cmake", "--install", BUILD, "--prefix", cls.folder, "--strip")
        cls.files = hardening.elf_files(cls.folder / "bin", cls.folder / "lib")

    def test_every_installed_program_and_library_is_hardened(self):
        names = {path.name for path in self.files}
        self.assertLessEqual({"ttc_node", "maintenance_node", "srfs", "srfs-lane", "hw_sim"}, names)
        self.assertTrue(any(name.startswith("libsrfs_ros.so") for name in names))
        self.assertEqual(hardening.faults_below(self.folder / "bin", self.folder / "lib"), [])

    def test_buffers_are_guarded(self):
        # srfs_rescue has its C library in it, and names no symbol of another file.
        big = [path for path in self.files if path.stat().st_size > BIG and path.name != "srfs_rescue"]
        self.assertGreater(len(big), 8)
        self.assertEqual([path.name for path in big if not hardening.has_stack_protector(hardening.read(path))], [])
        fortified = {path.name.partition(".")[0] for path in self.files if hardening.is_fortified(hardening.read(path))}
        self.assertLessEqual({"libsrfs_base", "libsrfs_hw", "libsrfs_suite", "libsrfs_mission", "libsrfs_image"}, fortified)

    def test_what_runs_from_the_build_folder_is_hardened_too(self):
        self.assertEqual(hardening.faults_below(BUILD / "bin", BUILD / "lib"), [])

    def test_each_fault_is_found(self):
        for option, fault in (
            ("-no-pie", "not position independent"),
            ("-Wl,-z,norelro", "no RELRO"),
            ("-Wl,-z,lazy", "no BIND_NOW"),
            ("-Wl,-z,execstack", "executable stack"),
            ("-Wl,-rpath,$ORIGIN:", "empty element"),
            ("-Wl,-rpath,/tmp/lib", "RUNPATH with /tmp/lib"),
        ):
            with self.subTest(option):
                told = hardening.faults(built_with(self.folder, "-Wl,-z,now", option))
                self.assertTrue(any(fault in line for line in told), told)
        unguarded = built_with(self.folder, "-fno-stack-protector", "-U_FORTIFY_SOURCE")
        self.assertFalse(hardening.has_stack_protector(unguarded))
        self.assertFalse(hardening.is_fortified(unguarded))
        output("g++", "-shared", "-fPIC", "-fcf-protection=none" if unguarded.machine == hardening.X86_64 else "-mbranch-protection=none",
            "-x", "c++", self.folder / "guarded.cpp", "-o", self.folder / "bare.so")  # fmt: skip
        self.assertEqual(hardening.read(self.folder / "bare.so").without_pad, ["main"])

    def test_the_checker_is_a_program_that_says_how_many_files_it_saw(self):
        def check(folder):
            return subprocess.run(["python3", "-B", "-m", "srfs.hardening", folder], capture_output=True, text=True, timeout=60)

        whole = check(self.folder / "bin")
        self.assertEqual(whole.returncode, 0, whole.stdout)
        self.assertRegex(whole.stdout, r"^[1-9]\d* programs and libraries, 0 faults\n$")
        self.assertEqual(check(ROOT / "docs").returncode, 1, "nothing to check is no success")


class CompiledOnBoardTest(LaneTest):
    def test_a_program_of_the_build_lane_is_hardened(self):
        code, report = self.build(self.sources(main=GUARDED), "--no-precompiled-header", "--option", "-O2")
        self.assertEqual((code, report["outcome"]), (0, "built"), self.log())
        self.assertEqual(self.log(), "")
        program = hardening.read(self.folder / "probe")
        self.assertEqual(hardening.faults(program, absolute_runpath=True), [])
        self.assertTrue(hardening.has_stack_protector(program))
        self.assertTrue(hardening.is_fortified(program))

    def test_without_optimisation_it_compiles_without_a_warning(self):
        code, report = self.build(self.sources(main=GUARDED), "--no-precompiled-header", "--option", "-O0")
        self.assertEqual((code, report["outcome"]), (0, "built"), self.log())
        self.assertEqual(self.log(), "")
        self.assertTrue(hardening.has_stack_protector(hardening.read(self.folder / "probe")))


if __name__ == "__main__":
    unittest.main()
