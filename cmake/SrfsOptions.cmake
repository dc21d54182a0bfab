# SPDX-FileCopyrightText: 2026 SRFS contributors
# SPDX-License-Identifier: Apache-2.0
# Compiler settings of every target: one interface target, warnings are errors.
set(CMAKE_CXX_STANDARD 20)
set(CMAKE_CXX_STANDARD_REQUIRED ON)
set(CMAKE_CXX_EXTENSIONS OFF)
set(CMAKE_EXPORT_COMPILE_COMMANDS ON)
set(CMAKE_POSITION_INDEPENDENT_CODE ON)

if(NOT CMAKE_BUILD_TYPE AND NOT CMAKE_CONFIGURATION_TYPES)
  set(CMAKE_BUILD_TYPE RelWithDebInfo CACHE STRING "Build type" FORCE)
endif()

# Lines and functions for backtraces, without the types of all variables: those cost a third of the time to compile. The
# debug preset has them.
# FORTIFY needs an optimising compiler: what is built with -O0 takes it back (SRFS_TEST_OPTIONS).
include(CheckCXXSourceCompiles)
set(CMAKE_TRY_COMPILE_CONFIGURATION RelWithDebInfo)
check_cxx_source_compiles("#ifndef _FORTIFY_SOURCE\n#error none\n#endif\nint main() {}" SRFS_COMPILER_FORTIFIES)
unset(CMAKE_TRY_COMPILE_CONFIGURATION)
if(NOT SRFS_COMPILER_FORTIFIES)
  set(SRFS_FORTIFY -D_FORTIFY_SOURCE=3)
endif()
set(CMAKE_CXX_FLAGS_RELWITHDEBINFO "-O2 -g1 -DNDEBUG ${SRFS_FORTIFY}")
set(CMAKE_CXX_FLAGS_RELEASE "-O3 -DNDEBUG ${SRFS_FORTIFY}")
set(CMAKE_CXX_FLAGS_MINSIZEREL "-Os -DNDEBUG ${SRFS_FORTIFY}")

find_program(SRFS_CCACHE ccache)
if(SRFS_CCACHE AND NOT CMAKE_CXX_COMPILER_LAUNCHER)
  # what ccache asks for with precompiled headers
  set(SRFS_CCACHE_SETTINGS ${CMAKE_COMMAND} -E env CCACHE_SLOPPINESS=pch_defines,time_macros)
  set(CMAKE_CXX_COMPILER_LAUNCHER ${SRFS_CCACHE_SETTINGS} ${SRFS_CCACHE})
  # A precompiled header knows by their content the files that say #pragma once: one of older comments would let them be read twice.
  set(SRFS_HEADER_LAUNCHER ${SRFS_CCACHE_SETTINGS} CCACHE_COMMENTS=1 SRFS_CCACHE=${SRFS_CCACHE} ${PROJECT_SOURCE_DIR}/cmake/ccache_header)
endif()

set(SRFS_SANITIZE "" CACHE STRING "Sanitizers: empty, 'address,undefined' or 'thread'")
option(SRFS_WERROR "Warnings are errors" ON)

add_library(srfs_compile_options INTERFACE)
add_library(srfs::compile_options ALIAS srfs_compile_options)
target_compile_options(srfs_compile_options INTERFACE
  -Wall -Wextra -Wpedantic -Wshadow -Wnon-virtual-dtor -Woverloaded-virtual -Wcast-align
  -Wdouble-promotion -Wformat=2 -Wimplicit-fallthrough -Wconversion -Wno-sign-conversion)
if(CMAKE_CXX_COMPILER_ID STREQUAL "GNU" AND CMAKE_CXX_COMPILER_VERSION VERSION_LESS 13)
  # gcc 12 reports these inside libstdc++ for correct std::string and std::vector code when it optimises (PR105329, PR105651).
  target_compile_options(srfs_compile_options INTERFACE -Wno-restrict -Wno-array-bounds -Wno-stringop-overflow -Wno-stringop-overread)
endif()
if(SRFS_WERROR)
  target_compile_options(srfs_compile_options INTERFACE -Werror)
endif()
if(SRFS_SANITIZE)
  target_compile_definitions(srfs_compile_options INTERFACE SRFS_SANITIZED)  # clang and gcc have different names for it
  target_compile_options(srfs_compile_options INTERFACE -fsanitize=${SRFS_SANITIZE} -fno-omit-frame-pointer
    -fno-sanitize-recover=all $<$<CXX_COMPILER_ID:GNU>:-Wno-maybe-uninitialized>)
  target_link_options(srfs_compile_options INTERFACE -fsanitize=${SRFS_SANITIZE})
else()
  # Hardening of everything that flies, also of what is compiled on board and of nodes outside this tree (SrfsInstall): stack protector,
  # landing pads for indirect branches (IBT, BTI), the standard library's own assertions, and a dynamic linker that resolves all symbols first and makes their table read-only.
  # tests/system/test_hardening.py checks it. The linker writes no IBT or BTI note: Debian's start files (crt1.o, crti.o) have no landing
  # pads, and forcing the note would promise some. They return where they were called from, so the note of the shadow stack holds.
  set(SRFS_HARDENING_COMPILE -fstack-protector-strong -fstack-clash-protection -D_GLIBCXX_ASSERTIONS)
  set(SRFS_HARDENING_LINK -Wl,-z,relro,-z,now)
  if(CMAKE_SYSTEM_PROCESSOR MATCHES "^(x86_64|AMD64)$")
    list(APPEND SRFS_HARDENING_COMPILE -fcf-protection=full)
    list(APPEND SRFS_HARDENING_LINK -Wl,-z,shstk)
  elseif(CMAKE_SYSTEM_PROCESSOR MATCHES "^(aarch64|arm64)$")
    list(APPEND SRFS_HARDENING_COMPILE -mbranch-protection=standard)
  endif()
  target_compile_options(srfs_compile_options INTERFACE ${SRFS_HARDENING_COMPILE})
  target_link_options(srfs_compile_options INTERFACE ${SRFS_HARDENING_LINK})
  include(CheckPIESupported)
  check_pie_supported(LANGUAGES CXX)  # -pie, whatever the compiler's default
endif()
if(SRFS_BUILD_FUZZERS)
  # Coverage of the libraries is what steers the fuzzer.
  target_compile_options(srfs_compile_options INTERFACE -fsanitize=fuzzer-no-link)
endif()
