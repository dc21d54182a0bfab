# SPDX-FileCopyrightText: 2026 SRFS contributors
# SPDX-License-Identifier: Apache-2.0
"""Which libraries each program that flies loads, read from its ELF file and those of the project's libraries."""

import platform
import re
import unittest
from pathlib import Path

from support import BIN

from srfs import ROOT
from srfs.flight.processes import output

LIB = Path(BIN).parent / "lib"

# Loaded by every program that flies, or by several for the same reason.
EVERY = {"libc", "libgcc_s", "libm", "libstdc++", "ld-linux-x86-64", "ld-linux-aarch64", "libfmt", "libcrypto", "libyaml-cpp"}
MIDDLEWARE = {"libfastrtps", "libfastcdr"}
UPDATE = {"libseccomp", "libz"}  # lib/update: the sandbox, packages
DEVICES = {"libgpiod"}
RECORDINGS = {"libzstd"}  # lib/mcap

MAY_LOAD = {
    **{node: EVERY | MIDDLEWARE | UPDATE | DEVICES for node in (
        "timing", "can_switcher", "payload_adcs", "payload_eps", "payload_thermal", "payload_idle", "ttc", "image_acquisition", "maintenance")},
    "image_processing": EVERY | MIDDLEWARE | UPDATE | DEVICES | {"libpng16", "libaec"},  # thumbnails, strips
    "srfs-lane": EVERY | UPDATE,
    "srfs_rescue": set(),  # it must run when libraries are damaged
    "srfs": EVERY | MIDDLEWARE | UPDATE | DEVICES | RECORDINGS,
}  # fmt: skip
# Decoders of photographs, and what cfitsio brings: for programs on the ground.
GROUND_ONLY = {"libtiff", "libjpeg", "libcfitsio", "libcurl-gnutls"}


def needed(file: Path) -> set[str]:
    return set(re.findall(r"\(NEEDED\).*\[(.+?)\]", output("readelf", "-dW", file)))


def libraries(program: Path) -> set[str]:
    """All that the dynamic linker loads at the start: libtiff.so.6 is `libtiff`."""
    found: set[str] = set()
    todo = [program]
    while todo:
        for name in needed(todo.pop()) - found:
            found.add(name)
            if (LIB / name).exists():
                todo.append(LIB / name)
    return {name.partition(".so")[0] for name in found}


def of_others(names: set[str]) -> set[str]:
    return {name for name in names if not name.startswith("libsrfs_")}


class LinkedLibrariesTest(unittest.TestCase):
    @unittest.skipUnless(platform.machine() == "x86_64", "the linker packs no relocations for others")
    def test_the_program_of_which_several_copies_are_kept_is_small(self):
        program = Path(BIN) / "srfs_rescue"
        if ".symtab" in output("readelf", "-SW", program) or needed(program):
            self.skipTest("a debug build, or a sanitized one")
        self.assertLessEqual(program.stat().st_size, 6_000_000)

    def program(self, name):
        return Path(BIN) / (name if name.startswith("srfs") else f"{name}_node")

    def test_the_table_names_every_node_of_the_deployments(self):
        flown = set()
        for deployment in (ROOT / "launch_config").glob("*.yaml"):
            flown |= set(re.findall(r"executable: (\w+)_node", deployment.read_text()))
        self.assertEqual(flown - set(MAY_LOAD), set())

    def test_a_program_that_flies_loads_only_what_it_needs(self):
        for name, may_load in MAY_LOAD.items():
            with self.subTest(name):
                loaded = of_others(libraries(self.program(name)))
                self.assertEqual(loaded - may_load, set(), f"{name} loads what MAY_LOAD does not name: unlink it, or say here why it flies")

    def test_readers_of_photographs_stay_on_the_ground(self):
        for name in MAY_LOAD:
            self.assertEqual(libraries(self.program(name)) & GROUND_ONLY, set(), name)
        for name in ("srfs-detect", "srfs-product"):
            self.assertLessEqual({"libtiff", "libjpeg", "libcfitsio"}, libraries(self.program(name)), f"{name}: else this test would see nothing")

    def test_no_library_is_loaded_later(self):
        for library in LIB.glob("libsrfs_*.so"):
            loaded_by = re.findall(r"UND (dlopen\S*)", output("readelf", "--dyn-syms", "-W", library))
            if library.name not in ("libsrfs_crash_point.so", "libsrfs_disk_fault.so", "libsrfs_fault_injector.so"):  # of tests
                self.assertEqual(loaded_by, [], library.name)


if __name__ == "__main__":
    unittest.main()
