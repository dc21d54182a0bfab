# SPDX-FileCopyrightText: 2026 SRFS contributors
# SPDX-License-Identifier: Apache-2.0
"""Other projects build against an installed SRFS that was moved elsewhere and contains no path of this tree."""

import os
import shutil
import textwrap
import unittest
from pathlib import Path

from support import BIN, TemporaryFolder

from srfs import hardening, tutorial
from srfs.flight import mission
from srfs.flight.processes import output

SOURCE = Path(__file__).resolve().parents[2]
BUILD = Path(BIN).parent


class FindPackageTest(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        folder = TemporaryFolder()
        cls.addClassCleanup(folder.cleanup)
        cls.folder = Path(folder.name)
        output("cmake", "--install", BUILD, "--prefix", cls.folder / "first", "--strip")
        cls.prefix = cls.folder / "moved"
        (cls.folder / "first").rename(cls.prefix)

    def test_no_file_that_others_read_names_the_build(self):
        found = []
        for file in self.prefix.rglob("*"):
            if file.suffix not in (".cmake", ".hpp", ".json", ".xml") or not file.is_file():
                continue
            text = file.read_text(errors="replace")
            found += [str(file) for place in (SOURCE, BUILD, self.folder / "first") if str(place) in text]
        self.assertEqual(found, [])

    def test_nodes_outside_the_tree_are_built_and_run(self):
        project = self.folder / "project"
        shutil.copytree(SOURCE / "tests/find_package", project)
        shutil.copytree(SOURCE / "mission/payload_eps", project / "payload_eps")
        build = self.folder / "project_build"
        output(self.prefix / "bin/srfs", "new", "node", "counter", "--in", project)  # the installed templates and generator
        output("cmake", "-S", project, "-B", build, "-G", "Ninja", f"-DCMAKE_PREFIX_PATH={self.prefix}", "-DCMAKE_BUILD_TYPE=Release")
        output("cmake", "--build", build)
        self.assertIn("100% tests passed", output("ctest", "--test-dir", build))
        for node in ("minimal_node", "payload_eps_node", "counter_node"):
            self.assertIn("--deployment", output(build / "bin" / node, "--help"))
            self.assertEqual(hardening.faults(hardening.read(build / "bin" / node), absolute_runpath=True), [])

    def test_nodes_and_deployments_of_the_last_release_are_moved_by_the_steps_of_the_page(self):
        page = "docs/how-to/move_a_mission.md"
        release = max(folder for folder in (SOURCE / "tests/compatibility").iterdir() if folder.is_dir())
        project = self.folder / release.name
        shutil.copytree(release, project / "mission", ignore=shutil.ignore_patterns("launch_config"))
        shutil.copytree(release / "launch_config", project / "launch_config")
        shell = tutorial.Shell(project, {**os.environ, "SRFS": str(self.prefix)})
        self.addCleanup(shell.end)
        section = (SOURCE / page).read_text().split(f"## From {release.name}\n")[1].split("\n## ")[0]
        for step in tutorial.steps_of(page, textwrap.dedent(section.replace("\n   ", "\n"))):
            shell.do(page, step, 120)
        # Step 5, as its table says; the payload's place is no part of what is built.
        (project / "mission/payload_impact/CMakeLists.txt").write_text("srfs_add_payload(payload_impact LOGIC impact_profile.cpp)\n")
        (project / "mission/image_straylight/CMakeLists.txt").write_text(
            "srfs_add_node(image_straylight SOURCES main.cpp LOGIC straylight.cpp TEST test/test_straylight.cpp)\n")  # fmt: skip
        (project / "mission/payload_idle/CMakeLists.txt").write_text("srfs_add_node(payload_idle SOURCES main.cpp)\n")
        (project / "CMakeLists.txt").write_text(
            "cmake_minimum_required(VERSION 3.25)\nproject(moved LANGUAGES CXX)\nfind_package(srfs REQUIRED)\nenable_testing()\n"
            "find_package(GTest REQUIRED)\nadd_subdirectory(mission/payload_impact)\nadd_subdirectory(mission/image_straylight)\n"
            "add_subdirectory(mission/payload_idle)\n")  # fmt: skip
        build = self.folder / "moved_build"
        output("cmake", "-S", project, "-B", build, "-G", "Ninja", f"-DCMAKE_PREFIX_PATH={self.prefix}")
        output("cmake", "--build", build)
        self.assertIn("100% tests passed", output("ctest", "--test-dir", build))
        for node in ("payload_impact_node", "image_straylight_node", "payload_idle_node"):
            self.assertIn("--deployment", output(build / "bin" / node, "--help"))
        with mission.Mission(self.folder / "var", project / "launch_config/sim.yaml", self.prefix / "bin", print) as flight:
            outcome = flight.ground().command("tc eps.switch_load load=2 state=off")
            self.assertEqual((outcome or {}).get("stage"), "completed", outcome)

    def test_the_installed_lane_builds_against_its_own_installation(self):
        sources = self.folder / "sources"
        shutil.copytree(SOURCE / "mission/payload_eps", sources / "mission/payload_eps", ignore=shutil.ignore_patterns("test", "*_model.*"))
        output(self.prefix / "bin/srfs-lane", "build", "--sources", sources, "--name", "payload_eps", "--option", "-O0", "--work", self.folder / "work",
            "--out", self.folder / "candidate", "--log", self.folder / "log", "--no-precompiled-header", "--uid", "64045", "--normal-priority")  # fmt: skip
        self.assertIn("--deployment", output(self.folder / "candidate", "--help"))
        self.assertEqual(hardening.faults(hardening.read(self.folder / "candidate"), absolute_runpath=True), [])
        self.assertIn(str(self.prefix), output("ldd", self.folder / "candidate"))


if __name__ == "__main__":
    unittest.main()
