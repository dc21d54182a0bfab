# SPDX-FileCopyrightText: 2026 SRFS contributors
# SPDX-License-Identifier: Apache-2.0
# The Debian package of what flies: `cpack -G DEB` in a build folder whose target `programs` is built. Programs, libraries, headers and
# deployments in /opt/srfs (the installation, as it stands); units, rules and settings of packaging/ beside it (packaging/stage.cmake).
set(CPACK_GENERATOR DEB)
set(CPACK_PACKAGE_NAME srfs)
set(CPACK_PACKAGE_VENDOR SRFS)
set(CPACK_PACKAGE_CONTACT "SRFS flight software <srfs@localhost>")
set(CPACK_PACKAGE_DESCRIPTION_SUMMARY "Flight software of the Space Ranger CubeSat")
set(CPACK_PACKAGE_DESCRIPTION "Lifecycle nodes on Fast DDS that watch and restart each other, the engineer's and the operator's tools,
the bounded build lane for uplinked sources with the headers and libraries that it builds against.
Installing starts and enables nothing.")
set(CPACK_PACKAGING_INSTALL_PREFIX /opt/srfs)
set(CPACK_STRIP_FILES ON)
set(CMAKE_SKIP_INSTALL_ALL_DEPENDENCY ON)  # the package needs `programs`, not the tests
set(CPACK_OUTPUT_FILE_PREFIX ${PROJECT_BINARY_DIR})
set(CPACK_SRFS_SOURCE ${PROJECT_SOURCE_DIR})
set(CPACK_PRE_BUILD_SCRIPTS ${PROJECT_SOURCE_DIR}/packaging/stage.cmake)

set(CPACK_DEBIAN_FILE_NAME DEB-DEFAULT)
set(CPACK_DEBIAN_COMPRESSION_TYPE xz)
set(CPACK_DEBIAN_PACKAGE_SECTION misc)
if(CMAKE_SYSTEM_PROCESSOR STREQUAL "aarch64")
  set(CPACK_DEBIAN_PACKAGE_ARCHITECTURE arm64)
endif()
# Named here and not found by dpkg-shlibdeps, which knows no libraries of another architecture; tests/system/test_debian_package.py compares.
set(CPACK_DEBIAN_PACKAGE_DEPENDS
  "libc6 (>= 2.36), libgcc-s1, libstdc++6 (>= 12)"
  "libaec0, libcfitsio10, libfastcdr1, libfastrtps2.9, libfmt9, libgpiod2, libjpeg62-turbo, libncursesw6, libpng16-16, libseccomp2, libsqlite3-0, libssl3, libtiff6, libtinfo6"
  "libyaml-cpp0.7, libzstd1, zlib1g"
  "adduser, iproute2")
# What the lane compiles with (lib/update/README.md); without it everything but updates from source works.
set(CPACK_DEBIAN_PACKAGE_RECOMMENDS
  "g++, libexpected-dev, libfastcdr-dev, libfastrtps-dev, libfmt-dev, libssl-dev, libyaml-cpp-dev, nlohmann-json3-dev")
# What a mission of one's own is built with (examples/mission_minimal), beside the recommended ones.
# OpenCV: for uplinked image methods that are written in it (examples/image_motion).
# libpq5: srfs-ground loads it for an archive in a PostgreSQL.
set(CPACK_DEBIAN_PACKAGE_SUGGESTS
  "cmake, libeigen3-dev, libgmock-dev, libopencv-core-dev, libopencv-imgproc-dev, libpq5, ninja-build, python3-jinja2, python3-rosidl, python3-yaml")
list(JOIN CPACK_DEBIAN_PACKAGE_DEPENDS ", " CPACK_DEBIAN_PACKAGE_DEPENDS)
set(CPACK_DEBIAN_PACKAGE_CONTROL_STRICT_PERMISSION ON)
foreach(script postinst prerm postrm conffiles)
  list(APPEND CPACK_DEBIAN_PACKAGE_CONTROL_EXTRA ${PROJECT_SOURCE_DIR}/packaging/${script})
endforeach()
include(CPack)
