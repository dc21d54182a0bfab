# SPDX-FileCopyrightText: 2026 SRFS contributors
# SPDX-License-Identifier: Apache-2.0
"""msgs/srfs_msgs as a package of a ROS 2 workspace: it names the packages that its interfaces use, and Debian's rosidl generators build it.

Debian has the generators but not ROS 2's own interface packages. This test makes these from msgs/interfaces and installs each into its own
folder. As with colcon, a package finds only those that its package.xml names.
"""

import re
import shutil
import unittest
import xml.etree.ElementTree
from pathlib import Path

from rosidl_adapter.parser import parse_action_file, parse_message_file, parse_service_file
from support import BIN, TemporaryFolder

from srfs import ROOT
from srfs.flight.processes import output

OURS = ROOT / "msgs/srfs_msgs"
STANDARD = ROOT / "msgs/interfaces"
COLCON_DEADLINE_S = 1200
NO_INTERFACES = {"ament_cmake", "rosidl_default_generators", "rosidl_default_runtime"}

PACKAGE_XML = """<package format="3">
  <name>{name}</name>
  <version>0.0.0</version>
  <description>Made for a test.</description>
  <maintainer email="maintainers@srfs.invalid">SRFS maintainers</maintainer>
  <license>Apache-2.0</license>
  <buildtool_depend>ament_cmake</buildtool_depend>
  <buildtool_depend>rosidl_default_generators</buildtool_depend>
  {depends}
  <member_of_group>rosidl_interface_packages</member_of_group>
</package>
"""
CMAKE = """cmake_minimum_required(VERSION 3.8)
project({name})
find_package(ament_cmake REQUIRED)
foreach(package {depends})
  find_package(${{package}} REQUIRED)
endforeach()
find_package(rosidl_default_generators REQUIRED)
file(GLOB interfaces RELATIVE ${{CMAKE_CURRENT_SOURCE_DIR}} msg/*.msg srv/*.srv action/*.action)
rosidl_generate_interfaces(${{PROJECT_NAME}} ${{interfaces}} DEPENDENCIES {depends})
ament_package()
"""
# Debian has no rosidl_default_generators, which is only a list of generators.
GENERATORS = "".join(f"find_package({name} REQUIRED)\n" for name in ("ament_cmake", "rosidl_cmake", "rosidl_generator_c", "rosidl_generator_cpp"))

USER_CMAKE = """cmake_minimum_required(VERSION 3.8)
project(user CXX)
set(CMAKE_CXX_STANDARD 17)
find_package(srfs_msgs REQUIRED)
add_library(user STATIC user.cpp)
target_link_libraries(user PRIVATE srfs_msgs::srfs_msgs__rosidl_generator_cpp)
"""


def messages_of(package):
    """The messages that the package's files define, parsed by rosidl's own parser."""
    name = package.name
    for file in sorted(package.glob("msg/*.msg")):
        yield parse_message_file(name, str(file))
    for file in sorted(package.glob("srv/*.srv")):
        service = parse_service_file(name, str(file))
        yield from (service.request, service.response)
    for file in sorted(package.glob("action/*.action")):
        action = parse_action_file(name, str(file))
        yield from (action.goal, action.result, action.feedback)


def packages_used_by(package):
    used = {field.type.pkg_name for message in messages_of(package) for field in message.fields} - {None, package.name}
    if list(package.glob("action/*.action")):
        used.add("action_msgs")  # used by the services and topics of an action
    return used


def depends_of(package):
    tree = xml.etree.ElementTree.parse(package / "package.xml")
    return {element.text for tag in ("depend", "build_depend") for element in tree.iter(tag)} - NO_INTERFACES


def write_standard(name, package):
    """A standard interface package of ROS 2 as a source package."""
    shutil.copytree(STANDARD / name, package)
    depends = sorted(packages_used_by(package))
    (package / "package.xml").write_text(PACKAGE_XML.format(name=name, depends="".join(f"<depend>{d}</depend>" for d in depends)))
    (package / "CMakeLists.txt").write_text(CMAKE.format(name=name, depends=" ".join(depends)))


def write_generators(prefix):
    """What Debian lacks: the two lists of generators."""
    for name, text in (("rosidl_default_generators", GENERATORS), ("rosidl_default_runtime", "")):
        config = prefix / "share" / name / "cmake" / f"{name}Config.cmake"
        config.parent.mkdir(parents=True)
        config.write_text(text)


class InterfacePackageTest(unittest.TestCase):
    def test_both_files_name_the_packages_that_the_interfaces_use(self):
        used = packages_used_by(OURS)
        self.assertLessEqual({"builtin_interfaces", "rcl_interfaces", "action_msgs"}, used)
        cmake = (OURS / "CMakeLists.txt").read_text()
        found = set(re.findall(r"find_package\((\w+)", cmake)) - NO_INTERFACES
        (dependencies,) = re.findall(r"rosidl_generate_interfaces\([^)]* DEPENDENCIES ([^)]*)\)", cmake)
        self.assertEqual(found, used)
        self.assertEqual(set(dependencies.split()), used)
        self.assertEqual(depends_of(OURS), used)


class WorkspaceTest(unittest.TestCase):
    @classmethod
    def setUpClass(cls):
        folder = TemporaryFolder()
        cls.addClassCleanup(folder.cleanup)
        cls.folder = Path(folder.name)
        write_generators(cls.folder / "install/ros")

    def prefixes_of(self, package):
        """Install folders of the packages that this package names, directly and indirectly."""
        found = set()
        waiting = depends_of(package)
        while waiting:
            name = waiting.pop()
            if name not in found:
                found.add(name)
                waiting |= depends_of(self.build_standard(name))
        return [self.folder / "install" / name for name in ("ros", *sorted(found))]

    def build_standard(self, name):
        """Builds and installs the standard package once. Returns its folder."""
        package = self.folder / "src" / name
        if not package.exists():
            write_standard(name, package)
            self.build(package)
        return package

    def build(self, package):
        build = self.folder / "build" / package.name
        prefixes = ";".join(map(str, self.prefixes_of(package)))
        output("cmake", "-S", package, "-B", build, "-G", "Ninja", f"-DCMAKE_PREFIX_PATH={prefixes}", "-DPython3_EXECUTABLE=/usr/bin/python3",
            f"-DCMAKE_INSTALL_PREFIX={self.folder / 'install' / package.name}", "-DBUILD_TESTING=OFF")  # fmt: skip
        output("cmake", "--build", build)
        output("cmake", "--install", build)

    def test_debians_generators_build_it_and_a_program_can_use_every_interface(self):
        package = self.folder / "src" / OURS.name
        shutil.copytree(OURS, package)
        self.build(package)
        installed = self.folder / "install/srfs_msgs"
        headers = sorted(p.relative_to(installed / "include/srfs_msgs") for p in installed.glob("include/srfs_msgs/srfs_msgs/*/*.hpp"))
        interfaces = [p for p in OURS.rglob("*") if p.suffix in (".msg", ".srv", ".action")]
        self.assertEqual(len(headers), len(interfaces))

        user = self.folder / "user"
        user.mkdir()
        (user / "user.cpp").write_text(
            "".join(f"#include <{header}>\n" for header in headers)
            + "srfs_msgs::action::CaptureImage::Impl::SendGoalService::Request goal;\n"
            + "rcl_interfaces::msg::Parameter first(const srfs_msgs::srv::SaveParameters::Request& r) { return r.values.front(); }\n"
        )
        (user / "CMakeLists.txt").write_text(USER_CMAKE)
        prefixes = ";".join(map(str, [installed, *self.prefixes_of(package)]))
        output("cmake", "-S", user, "-B", self.folder / "build/user", "-G", "Ninja", f"-DCMAKE_PREFIX_PATH={prefixes}", "-DPython3_EXECUTABLE=/usr/bin/python3")
        output("cmake", "--build", self.folder / "build/user")

    def test_a_package_that_srfs_new_writes_is_built_by_them_too(self):
        package = self.folder / "src/my_msgs"
        package.parent.mkdir(exist_ok=True)
        output(BIN / "srfs", "new", "interfaces", package.name, "--in", package.parent)
        self.build(package)
        self.assertTrue((self.folder / "install/my_msgs/include/my_msgs/my_msgs/msg/sample.hpp").exists())
        self.assertTrue((self.folder / "install/my_msgs/share/my_msgs/msg/Sample.msg").exists(), "where srfs_generate_interfaces finds it")


class ColconTest(unittest.TestCase):
    """What `srfs new` writes, in a colcon workspace beside packages of ROS 2, with an installed SRFS."""

    def test_a_node_is_built_and_tested_beside_packages_of_ros_2(self):
        with TemporaryFolder() as folder:
            prefix, workspace = Path(folder) / "srfs", Path(folder) / "workspace"
            output("cmake", "--install", BIN.parent, "--prefix", prefix, "--strip")
            (workspace / "src").mkdir(parents=True)
            output(prefix / "bin/srfs", "new", "node", "ticker", "--in", workspace / "src")
            write_generators(Path(folder) / "ros")
            for name in ("builtin_interfaces", "std_msgs"):
                write_standard(name, workspace / "src" / name)

            colcon = ("env", f"CMAKE_PREFIX_PATH={prefix}:{folder}/ros", "colcon", "--log-base", Path(folder) / "log")
            output(*colcon, "build", "--cmake-args", "-DPython3_EXECUTABLE=/usr/bin/python3", cwd=workspace, timeout_s=COLCON_DEADLINE_S)
            output(*colcon, "test", "--return-code-on-test-failure", cwd=workspace, timeout_s=COLCON_DEADLINE_S)

            installed = workspace / "install"
            self.assertIn("--deployment", output(installed / "ticker/bin/ticker_node", "--help"))
            self.assertTrue((installed / "std_msgs/include/std_msgs/std_msgs/msg/header.hpp").exists())
            (log,) = (workspace / "build/ticker/Testing").rglob("LastTest_*.log")
            self.assertEqual(log.read_text().count("Test Passed."), 1)


if __name__ == "__main__":
    unittest.main()
