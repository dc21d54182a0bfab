# SPDX-FileCopyrightText: 2026 SRFS contributors
# SPDX-License-Identifier: Apache-2.0
"""The build dependencies are listed in three places, which must agree: CMake requires them, packages.txt installs them, package.xml names them
for colcon and rosdep."""

import re
import unittest
import xml.etree.ElementTree
from pathlib import Path

ROOT = Path(__file__).resolve().parents[3]

# Package that CMake requires -> the Debian package that contains it.
OF_CMAKE = {
    "Python3": "python3",
    "fastcdr": "libfastcdr-dev",
    "fastrtps": "libfastrtps-dev",
    "fmt": "libfmt-dev",
    "yaml-cpp": "libyaml-cpp-dev",
    "CLI11": "libcli11-dev",
    "nlohmann_json": "nlohmann-json3-dev",
    "OpenSSL": "libssl-dev",
    "ZLIB": "zlib1g-dev",
    "Eigen3": "libeigen3-dev",
    "Threads": None,  # part of the C library
    "TIFF": "libtiff-dev",
    "PNG": "libpng-dev",
    "JPEG": "libjpeg-dev",
    "PkgConfig": "pkg-config",
    "cfitsio": "libcfitsio-dev",
    "gpiod": "libgpiod-dev",
    "aec": "libaec-dev",
    "GTest": "libgtest-dev",
    "fec": "libfec-dev",
    "seccomp": "libseccomp-dev",
    "SQLite3": "libsqlite3-dev",
    "libpq": "libpq-dev",
    "Boost": "libboost-dev",
    "zstd": "libzstd-dev",
    "ncursesw": "libncurses-dev",
}
# Needed, but not required by CMake: programs, header-only libraries, Python modules of the generators.
OF_OTHERS = {
    "cmake": "cmake",
    "ninja": "ninja-build",
    "GTest::gmock": "libgmock-dev",
    "#include <tl/expected.hpp>": "libexpected-dev",
    "import jinja2": "python3-jinja2",
    "import yaml": "python3-yaml",
    "from rosidl_adapter": "python3-rosidl",
}
# rosdep's key of a Debian package, if it differs from the package's name.
ROSDEP_KEY = {
    "libfastcdr-dev": "fastcdr",
    "libfastrtps-dev": "fastrtps",
    "libfmt-dev": "fmt",
    "libyaml-cpp-dev": "yaml-cpp",
    "libcli11-dev": "cli11",
    "nlohmann-json3-dev": "nlohmann-json-dev",
    "zlib1g-dev": "zlib",
    "libeigen3-dev": "eigen",
    "libjpeg-dev": "libjpeg",
    "libgtest-dev": "gtest",
    "libgmock-dev": "google-mock",
}
NOT_IN_PACKAGE_XML = {
    "ccache",  # nothing needs it
    "g++",  # rosdep takes a compiler for granted
}


def built_with():
    """Packages that belong to no group: those to build and run."""
    lines = [line.split() for line in (ROOT / "packages.txt").read_text().splitlines() if line and not line.startswith("#")]
    return {words[0] for words in lines if len(words) == 1}


def cmake_files():
    """CMake files of this project, without those of packages that are built separately."""
    foreign = [ROOT / "msgs/srfs_msgs", ROOT / "tests/find_package", ROOT / "examples/mission_minimal", ROOT / "examples/mission_two_buses", ROOT / "examples/tick_counter"]
    for folder in ("cmake", "lib", "msgs", "nodes", "mission", "hw_sim", "ground", "programs", "tools", "examples", "tests"):
        for pattern in ("CMakeLists.txt", "*.cmake"):
            yield from (f for f in (ROOT / folder).rglob(pattern) if not any(f.is_relative_to(other) for other in foreign))
    yield ROOT / "CMakeLists.txt"


def required_by_cmake():
    text = "\n".join(re.sub(r"#.*", "", file.read_text()) for file in cmake_files())
    return (set(re.findall(r"find_package\(([\w-]+)[^)]*REQUIRED", text)) | set(re.findall(r"pkg_check_modules\((\w+) REQUIRED", text))
            | set(re.findall(r"find_library\(\w+ (\w+) REQUIRED", text)))  # fmt: skip


class PackageLists(unittest.TestCase):
    def test_what_cmake_requires_is_installed(self):
        required = required_by_cmake()
        self.assertEqual(required, set(OF_CMAKE), "a library was added or removed: OF_CMAKE names its Debian package")
        self.assertLessEqual({OF_CMAKE[name] for name in required} - {None}, built_with())

    def test_nothing_is_installed_that_nothing_needs(self):
        needed = set(OF_CMAKE.values()) | set(OF_OTHERS.values()) | NOT_IN_PACKAGE_XML
        self.assertEqual(built_with() - needed, set())

    def test_package_xml_names_all_of_it_once(self):
        tags = ("buildtool_depend", "build_depend", "depend", "test_depend")
        tree = xml.etree.ElementTree.parse(ROOT / "package.xml").getroot()
        named = [element.text for tag in tags for element in tree.findall(tag)]
        self.assertEqual(sorted(named), sorted({ROSDEP_KEY.get(package, package) for package in built_with() - NOT_IN_PACKAGE_XML}))


if __name__ == "__main__":
    unittest.main()
