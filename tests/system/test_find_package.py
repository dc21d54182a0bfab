# SPDX-FileCopyrightText: 2026 SRFS contributors
# SPDX-License-Identifier: Apache-2.0
"""Other projects build against an installed SRFS that was moved elsewhere and contains no path of this tree."""

import os
import shutil
import subprocess
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
        found = self.folder / "found/share/found_msgs"  # as an installed package of ROS 2
        for file, text in ((found / "msg/Found.msg", "uint32 count\n"), (found / "srv/Find.srv", "uint32 least\n---\nFound found\n"),
                           (found / "msg/Unused.msg", "bool x\n"), (project / "beside_msgs/msg/Sample.msg", "builtin_interfaces/Time stamp\n")):  # fmt: skip
            file.parent.mkdir(parents=True, exist_ok=True)
            file.write_text(text)
        prefixes = f"{self.prefix};{self.folder / 'found'}"
        output("cmake", "-S", project, "-B", build, "-G", "Ninja", f"-DCMAKE_PREFIX_PATH={prefixes}", "-DCMAKE_BUILD_TYPE=Release")
        output("cmake", "--build", build)
        self.assertIn("100% tests passed", output("ctest", "--test-dir", build))
        for node in ("minimal_node", "messages_node", "payload_eps_node", "counter_node"):
            self.assertIn("--deployment", output(build / "bin" / node, "--help"))
            self.assertEqual(hardening.faults(hardening.read(build / "bin" / node), absolute_runpath=True), [])

        self.check_interfaces(project, build, found)

    def check_interfaces(self, project, build, found):
        """What is generated again, what is installed, and what is said of a wrong file."""
        output("cmake", "--install", build, "--prefix", self.folder / "own")
        self.assertEqual({str(p.relative_to(self.folder / "own/share")) for p in (self.folder / "own/share").rglob("*.msg")}, {"messages/msg/Own.msg"})
        header = build / "messages/messages_types/found_msgs/msg/found.hpp"
        (found / "msg/Found.msg").write_text("uint32 count\nuint32 another\n")
        output("cmake", "--build", build, "--target", "messages_node")
        self.assertIn("another", header.read_text())
        (project / "messages/msg/Own.msg").write_text("far_msgs/Far far\n")
        wrong = subprocess.run(["cmake", "--build", build, "--target", "messages_node"], stdin=subprocess.DEVNULL, capture_output=True, text=True, timeout=300)
        self.assertNotEqual(wrong.returncode, 0)
        self.assertRegex(" ".join((wrong.stdout + wrong.stderr).split()), r"messages/msg/Own\.msg: uses far_msgs/Far, which is not in .*ros-far-msgs")

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
