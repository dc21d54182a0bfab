# SPDX-FileCopyrightText: 2026 SRFS contributors
# SPDX-License-Identifier: Apache-2.0
"""The Debian package: its content, its dependencies and its units. tools/package/install_test installs it."""

import os
import re
import shutil
import stat
import subprocess
import unittest
from pathlib import Path

from support import BIN, TemporaryFolder

from srfs import ROOT, hardening
from srfs.flight.processes import output

BUILD = Path(BIN).parent


class DebianPackageTest(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        folder = TemporaryFolder()
        cls.addClassCleanup(folder.cleanup)
        cls.folder = Path(folder.name)
        # Fast packing; the compression ratio does not matter here.
        output("cpack", "--config", BUILD / "CPackConfig.cmake", "-G", "DEB", "-B", cls.folder, "-D", f"CPACK_OUTPUT_FILE_PREFIX={cls.folder}",
            "-D", "CPACK_DEBIAN_COMPRESSION_TYPE=gzip", cwd=cls.folder)  # fmt: skip
        (cls.package,) = cls.folder.glob("*.deb")
        cls.root = cls.folder / "root"
        output("dpkg-deb", "-x", cls.package, cls.root)
        output("dpkg-deb", "-e", cls.package, cls.folder / "control")

    def field(self, name):
        return output("dpkg-deb", "-f", self.package, name).strip()

    def test_what_a_board_needs_is_in_it(self):
        programs = {p.name for p in (self.root / "opt/srfs/bin").iterdir()}
        nodes = re.findall(r"executable: (\w+)", (ROOT / "launch_config/board_rk3568.yaml").read_text())
        self.assertLessEqual({"srfs", "srfs-lane", "srfs-ground", "srfs-product", "srfs_rescue", "hw_sim", *nodes}, programs)
        for path in (
            "opt/srfs/lib/libsrfs_ros.so.0",
            "opt/srfs/lib/libsrfs_suite.so.0",
            "opt/srfs/lib/srfs-start",
            "opt/srfs/lib/cmake/srfs/srfsConfig.cmake",
            "opt/srfs/include/srfs/suite/node.hpp",
            "opt/srfs/share/srfs/node_build.json",
            "opt/srfs/share/srfs/mission",
            "opt/srfs/share/srfs/launch_config/sim.yaml",
            "opt/srfs/share/srfs/web/index.html",
            "opt/srfs/share/srfs/web/views/commands.js",
            "opt/srfs/share/srfs/web/layouts/overview.json",
            "etc/srfs/deployment.yaml",
            "usr/bin/srfs",
            "usr/bin/srfs-ground",
            "usr/share/man/man1/srfs-ground.1",
            "usr/share/bash-completion/completions/srfs-ground",
            "usr/lib/systemd/system/srfs.service",
            "usr/lib/systemd/user/srfs-ground.service",
            "usr/lib/udev/rules.d/70-srfs.rules",
            "usr/lib/sysctl.d/60-srfs.conf",
            "usr/lib/modules-load.d/srfs.conf",
            "usr/share/initramfs-tools/conf-hooks.d/srfs-rescue",
        ):
            self.assertTrue((self.root / path).exists(), path)
        for script in ("hooks/srfs-rescue", "scripts/panic/srfs-rescue"):
            path = self.root / "usr/share/initramfs-tools" / script
            self.assertEqual(stat.S_IMODE(path.stat().st_mode), 0o755, script)
            output("sh", "-n", path)
        self.assertEqual((self.root / "etc/srfs/deployment.yaml").read_text(), (ROOT / "launch_config/board_rk3568.yaml").read_text())

    def test_every_file_in_etc_is_kept_over_an_upgrade_when_it_was_changed(self):
        files = {"/" + str(p.relative_to(self.root)) for p in (self.root / "etc").rglob("*") if p.is_file()}
        self.assertEqual(files, set((self.folder / "control/conffiles").read_text().split()))

    def test_nobody_else_can_change_what_is_installed(self):
        for line in output("dpkg-deb", "-c", self.package).splitlines():
            mode, owner = line.split()[:2]
            self.assertEqual(owner, "root/root", line)
            self.assertTrue(mode[0] == "l" or (mode[5] == "-" and mode[8] == "-"), line)
        for script in ("postinst", "prerm", "postrm"):
            self.assertEqual(stat.S_IMODE((self.folder / "control" / script).stat().st_mode), 0o755, script)
            output("sh", "-n", self.folder / "control" / script)

    def test_programs_are_stripped_and_nothing_names_the_build(self):
        text = output("file", *(self.root / "opt/srfs/bin").iterdir()) if shutil.which("file") else ""
        self.assertNotIn("not stripped", text)
        found = []
        for file in self.root.rglob("*"):
            if file.suffix in (".cmake", ".hpp", ".json", ".service", ".conf") and file.is_file():
                content = file.read_text(errors="replace")
                found += [str(file) for place in (ROOT, BUILD, self.folder) if str(place) in content]
        self.assertEqual(found, [])

    def test_every_program_and_library_in_it_is_hardened(self):
        self.assertEqual(hardening.faults_below(self.root / "opt/srfs/bin", self.root / "opt/srfs/lib"), [])

    @unittest.skipUnless(shutil.which("dpkg-shlibdeps"), "no dpkg-dev here")
    def test_it_depends_on_the_packages_of_the_libraries_that_it_loads(self):
        (self.folder / "debian").mkdir(exist_ok=True)
        (self.folder / "debian/control").write_text("Source: srfs\n\nPackage: srfs\nArchitecture: any\n")
        elf = [p for place in ("bin", "lib") for p in (self.root / "opt/srfs" / place).iterdir()
               if p.is_file() and not p.is_symlink() and p.read_bytes()[:4] == b"\x7fELF"]  # fmt: skip
        out = output("dpkg-shlibdeps", "--ignore-missing-info", "-O", f"-l{self.root}/opt/srfs/lib", *elf, cwd=self.folder)
        needed = set(re.findall(r"(?:=|, )([a-z0-9.+-]+)", out.partition("shlibs:Depends")[2]))
        listed = set(re.findall(r"(?:^|, )([a-z0-9.+-]+)", self.field("Depends")))
        self.assertEqual(listed - {"adduser", "iproute2", "libgcc-s1", "zlib1g"}, needed - {"libgcc-s1", "zlib1g"})

    @unittest.skipUnless(shutil.which("systemd-analyze"), "no systemd here")
    def test_the_units_are_sound(self):
        units = self.folder / "units"
        shutil.copytree(self.root / "usr/lib/systemd/system", units)
        for unit in units.iterdir():  # the package is not installed, so verify with the unpacked paths
            unit.write_text(unit.read_text().replace("=/opt/srfs/", f"={self.root}/opt/srfs/"))
        done = subprocess.run(["systemd-analyze", "verify", "--man=no", *map(str, units.iterdir())], capture_output=True, text=True,
                              env={**os.environ, "SYSTEMD_UNIT_PATH": f"{units}:"}, timeout=60)  # fmt: skip
        self.assertEqual([line for line in done.stderr.splitlines() if "srfs" in line], [])
        self.assertEqual(done.returncode, 0, done.stderr)

    @unittest.skipUnless(shutil.which("systemd-analyze"), "no systemd here")
    def test_the_units_may_do_no_more_than_they_need(self):
        # The suite sets users, priorities and control groups, and builds in namespaces: that is what remains of 9.6.
        for unit, most in (("srfs", 5.3), ("srfs-image", 3.0), ("srfs-build", 3.0)):
            told = output("systemd-analyze", "security", "--offline=true", "--no-pager", self.root / f"usr/lib/systemd/system/{unit}.service")
            self.assertLessEqual(float(re.search(r"Overall exposure level for \S+: ([0-9.]+)", told).group(1)), most, told)

    def test_the_engineers_command_means_the_board_unless_told_otherwise(self):
        self.assertEqual((self.root / "usr/bin/srfs").stat().st_mode & 0o111, 0o111)
        script = (self.root / "usr/bin/srfs").read_text().replace("/opt/srfs", f"{self.root}/opt/srfs")
        script = script.replace("/etc/srfs", f"{self.root}/etc/srfs").replace("/var/lib/srfs", str(self.folder / "var"))
        told = subprocess.run(["sh", "-c", script, "srfs", "status", "--json"], stdin=subprocess.DEVNULL, capture_output=True, text=True, timeout=60)
        self.assertIn('"maintenance"', told.stdout, told.stderr)  # no node runs, hence an exit code other than 0


if __name__ == "__main__":
    unittest.main()
