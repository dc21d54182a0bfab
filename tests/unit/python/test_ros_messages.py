# SPDX-FileCopyrightText: 2026 SRFS contributors
# SPDX-License-Identifier: Apache-2.0
"""The generator of C++ types (msgs/generator/ros_messages.py): where it finds the types that interfaces use, what it refuses, and the
notation of ROS 1. lib/ros/test/test_own_interfaces.cpp compiles what it writes."""

import subprocess
import sys
import tempfile
import unittest
from pathlib import Path

import ros_messages
from ros_messages import Folders, in_ros2_notation

from srfs import ROOT

GENERATOR = ROOT / "msgs/generator/ros_messages.py"
OURS = [ROOT / "msgs", ROOT / "msgs/interfaces"]


class GeneratorTest(unittest.TestCase):
    def setUp(self):
        folder = tempfile.TemporaryDirectory()
        self.addCleanup(folder.cleanup)
        self.folder = Path(folder.name)

    def interface(self, name, text):
        """Writes "package/msg/Name.msg"."""
        file = self.folder / name
        file.parent.mkdir(parents=True, exist_ok=True)
        file.write_text(text)
        return file

    def generate(self, *options):
        command = [sys.executable, "-B", GENERATOR, "--out", self.folder / "out", *options]
        return subprocess.run(list(map(str, command)), stdin=subprocess.DEVNULL, capture_output=True, text=True)

    def headers(self):
        return {str(p.relative_to(self.folder / "out")) for p in (self.folder / "out").rglob("*.hpp")}

    def refusal(self, text, *options):
        """What it says of a message of this text; it writes nothing."""
        done = self.generate("--own", "own", self.interface("own/msg/Wrong.msg", text), *options)
        self.assertEqual((done.returncode, self.headers()), (1, set()), done.stderr)
        self.assertEqual(done.stderr.count("\n"), 1, "one line")
        self.assertIn("own/msg/Wrong.msg: ", done.stderr)
        return done.stderr


class WhereTypesComeFrom(GeneratorTest):
    def test_what_is_used_comes_along_and_what_is_there_does_not(self):
        own = self.interface("own/msg/Own.msg", "first/A a\nbuiltin_interfaces/Time at\n")
        self.interface("share/first/msg/A.msg", "B[] b\n")
        self.interface("share/first/msg/B.msg", "std_msgs/Header header\n")
        self.interface("share/first/msg/Unused.msg", "bool x\n")
        have = [word for folder in OURS for word in ("--have", folder)]
        done = self.generate("--own", "own", own, "--path", self.folder / "share", *have, "--texts", self.folder / "texts", "--inputs")
        self.assertEqual(done.returncode, 0, done.stderr)
        self.assertEqual(self.headers(), {"own/msg/own.hpp", "first/msg/a.hpp", "first/msg/b.hpp"})
        self.assertEqual({Path(file).name for file in done.stdout.split(";")}, {"Own.msg", "A.msg", "B.msg"})
        self.assertEqual((self.folder / "texts/own/msg/Own.msg").read_text(), own.read_text())

    def test_a_package_is_a_folder_or_a_name_and_the_first_place_that_has_it_counts(self):
        for place in ("one", "two"):
            self.interface(f"{place}/pack/msg/Same.msg", f"bool {place}\n")
        self.interface("two/pack/srv/Ask.srv", "---\n")
        paths = ("--path", self.folder / "one", "--path", self.folder / "two")
        self.assertEqual(self.generate("pack", *paths).returncode, 0)
        self.assertEqual(self.headers(), {"pack/msg/same.hpp"})
        self.assertIn("bool one", (self.folder / "out/pack/msg/same.hpp").read_text())
        self.assertEqual(self.generate(self.folder / "two/pack", *paths).returncode, 0)
        self.assertEqual(self.headers(), {"pack/msg/same.hpp", "pack/srv/ask.hpp"})

    def test_a_file_that_did_not_change_is_not_touched(self):
        own = self.interface("own/msg/Own.msg", "bool x\n")
        self.assertEqual(self.generate("--own", "own", own).returncode, 0)
        before = (self.folder / "out/own/msg/own.hpp").stat().st_mtime_ns
        self.assertEqual(self.generate("--own", "own", own).returncode, 0)
        self.assertEqual((self.folder / "out/own/msg/own.hpp").stat().st_mtime_ns, before)


class WhatIsRefused(GeneratorTest):
    def test_a_wrong_file_is_named_in_one_line(self):
        self.assertIn("uint12", self.refusal("uint12 x\n"))
        self.assertIn("builtin_interfaces/Time", self.refusal("time x\n"))
        self.assertIn("inf", self.refusal("float32 x inf\n"))
        self.assertIn("300", self.refusal("uint8 X=300\n"))

    def test_a_type_that_is_nowhere_is_named_with_what_to_do(self):
        said = self.refusal("geometry_msgs/Pose p\n", "--ros1", self.folder / "share")
        self.assertIn(f"geometry_msgs/Pose, which is not in {self.folder}/share", said)
        self.assertIn("ros-geometry-msgs", said)

    def test_a_type_that_has_itself_as_a_part(self):
        self.interface("p/msg/A.msg", "B[] b\n")
        self.interface("p/msg/B.msg", "A[<=2] a\n")
        self.interface("p/msg/C.msg", "A a\n")
        done = self.generate(self.folder / "p")
        self.assertIn("parts: p/A, p/B", done.stderr)
        self.assertEqual(self.headers(), set())

    def test_what_is_no_interface(self):
        done = self.generate("--own", "own", self.interface("own/msg/Own.idl", ""))
        self.assertIn("not a .msg, .srv or .action file", done.stderr)
        self.assertIn("no interfaces", self.generate("none", "--path", self.folder).stderr)


class Ros1(GeneratorTest):
    def test_types_and_fields_are_written_as_in_ros_2(self):
        ros1 = "# Header of it\nHeader header\n time[2] T # when\nfloat64[9]  K\nbyte OK=0\nstring S= time x\nPoint[] points\n---\nduration d\n"
        ros2 = ("# Header of it\nstd_msgs/Header header\nbuiltin_interfaces/Time[2] t # when\nfloat64[9]  k\nbyte OK=0\nstring S= time x\n"
                "Point[] points\n---\nbuiltin_interfaces/Duration d\n")  # fmt: skip
        self.assertEqual(in_ros2_notation(ros1, "any"), ros2)
        self.assertEqual(in_ros2_notation(ros2, "any"), ros2)

    @unittest.skipUnless(Path("/usr/share/sensor_msgs/msg").is_dir(), "packages ros-*-msgs of Debian")
    def test_debians_packages_are_read_whole_and_mean_what_those_of_ros_2_do(self):
        packages = ("std_msgs", "std_srvs", "geometry_msgs", "sensor_msgs", "diagnostic_msgs")
        have = [word for folder in OURS for word in ("--have", folder)]
        done = self.generate(*packages, *have, "--ros1", "/usr/share", "--texts", self.folder / "texts")
        self.assertEqual(done.returncode, 0, done.stderr)
        self.assertGreater(len(self.headers()), 90)
        # As in ROS 2's common_interfaces: no number in a header, which is SRFS' own, and names in lower case.
        self.assertNotIn("std_msgs/msg/header.hpp", self.headers())
        self.assertNotIn("sensor_msgs/msg/image.hpp", self.headers())
        folders = Folders(paths=[self.folder / "texts"])
        fields = {i.path.stem: [(str(f.type), f.name) for f in i.structs()[0][0][1]] for i in folders.package("sensor_msgs")}
        self.assertEqual([name for _, name in fields["CameraInfo"]], ["header", "height", "width", "distortion_model", "d", "k", "r", "p", "binning_x", "binning_y", "roi"])
        self.assertEqual(fields["TimeReference"], [("std_msgs/Header", "header"), ("builtin_interfaces/Time", "time_ref"), ("string", "source")])


class Literals(unittest.TestCase):
    def test_texts_and_numbers_are_what_cpp_reads_as_the_same(self):
        for value, kind, expected in (("a\"b\\", "string", r'"a\"b\\"'), ("é", "string", r'"\303\251"'), ("€\n", "wstring", r'u"\U000020ac\012"'),
                                      (-(2**63), "int64", "-9223372036854775807 - 1"), (2**64 - 1, "uint64", "18446744073709551615ULL"),
                                      (1, "float32", "1.0"), (True, "bool", "true")):  # fmt: skip
            self.assertEqual(ros_messages.literal(value, kind), expected)


if __name__ == "__main__":
    unittest.main()
