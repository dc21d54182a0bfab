# SPDX-FileCopyrightText: 2026 SRFS contributors
# SPDX-License-Identifier: Apache-2.0
# Cross-building for the board: Debian's g++-aarch64-linux-gnu against the sysroot that tools/arm64/make_sysroot makes.
set(CMAKE_SYSTEM_NAME Linux)
set(CMAKE_SYSTEM_PROCESSOR aarch64)

if(DEFINED ENV{XDG_CACHE_HOME})
  set(cache $ENV{XDG_CACHE_HOME})
else()
  set(cache $ENV{HOME}/.cache)
endif()
set(SRFS_ARM64_SYSROOT ${cache}/srfs/arm64/sysroot CACHE PATH "Made by tools/arm64/make_sysroot")
list(APPEND CMAKE_TRY_COMPILE_PLATFORM_VARIABLES SRFS_ARM64_SYSROOT)
if(NOT EXISTS ${SRFS_ARM64_SYSROOT}/.srfs_packages)
  message(FATAL_ERROR "No sysroot in ${SRFS_ARM64_SYSROOT}: run tools/arm64/make_sysroot, or ./run arm64")
endif()
set(CMAKE_SYSROOT ${SRFS_ARM64_SYSROOT})
set(CMAKE_C_COMPILER aarch64-linux-gnu-gcc)
set(CMAKE_CXX_COMPILER aarch64-linux-gnu-g++)
set(CMAKE_LIBRARY_ARCHITECTURE aarch64-linux-gnu)

# Programs (generators, ccache) are this machine's; libraries, headers and packages the sysroot's alone.
set(CMAKE_FIND_ROOT_PATH ${CMAKE_SYSROOT})
set(CMAKE_FIND_ROOT_PATH_MODE_PROGRAM NEVER)
set(CMAKE_FIND_ROOT_PATH_MODE_LIBRARY ONLY)
set(CMAKE_FIND_ROOT_PATH_MODE_INCLUDE ONLY)
set(CMAKE_FIND_ROOT_PATH_MODE_PACKAGE ONLY)
set(ENV{PKG_CONFIG_DIR} "")
set(ENV{PKG_CONFIG_SYSROOT_DIR} ${CMAKE_SYSROOT})
set(ENV{PKG_CONFIG_LIBDIR} ${CMAKE_SYSROOT}/usr/lib/aarch64-linux-gnu/pkgconfig:${CMAKE_SYSROOT}/usr/share/pkgconfig)

# ctest runs the tests on this machine: in user-mode emulation, with the sysroot's libraries.
find_program(SRFS_QEMU_AARCH64 qemu-aarch64-static)
if(SRFS_QEMU_AARCH64)
  set(CMAKE_CROSSCOMPILING_EMULATOR ${SRFS_QEMU_AARCH64} -L ${CMAKE_SYSROOT})
endif()
