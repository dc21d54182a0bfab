# SPDX-FileCopyrightText: 2026 SRFS contributors
# SPDX-License-Identifier: Apache-2.0
# srfs_compile_alone(<sources>...): sources that cannot stand in one translation unit with their neighbours, because both have a name of
# their own for the same thing ("redefinition of (anonymous namespace)::start"). All others are compiled eight at a time where
# CMAKE_UNITY_BUILD is on (all presets but debug): half the time from nothing.
function(srfs_compile_alone)
  set_source_files_properties(${ARGN} PROPERTIES SKIP_UNITY_BUILD_INCLUSION ON)
endfunction()

# srfs_add_library(<name> [SHARED] [INSTALL] SOURCES ... [DEPS ...] [PRIVATE_DEPS ...]): a library of the house. SHARED for what
# several nodes use: its code is then in memory once, not once a process. Shared ones are installed and found as
# srfs::<name without srfs_>; INSTALL does the same for a static one.
function(srfs_add_library name)
  cmake_parse_arguments(ARG "SHARED;INSTALL" "" "SOURCES;DEPS;PRIVATE_DEPS" ${ARGN})
  set(kind STATIC)
  if(ARG_SHARED)
    set(kind SHARED)
  endif()
  add_library(${name} ${kind} ${ARG_SOURCES})
  target_include_directories(${name} PUBLIC ${srfs_SOURCE_DIR}/lib ${srfs_SOURCE_DIR})
  target_link_libraries(${name} PUBLIC ${ARG_DEPS} PRIVATE ${ARG_PRIVATE_DEPS})
  if(ARG_INSTALL)  # users of a static library would have to find what it links
    target_compile_options(${name} PRIVATE $<TARGET_PROPERTY:srfs_compile_options,INTERFACE_COMPILE_OPTIONS>)
  else()
    target_link_libraries(${name} PRIVATE $<BUILD_INTERFACE:srfs::compile_options>)
  endif()
  if(ARG_SHARED)
    set_target_properties(${name} PROPERTIES LIBRARY_OUTPUT_DIRECTORY ${CMAKE_BINARY_DIR}/lib
      VERSION ${PROJECT_VERSION} SOVERSION ${PROJECT_VERSION_MAJOR})
    target_link_options(${name} PRIVATE -Wl,-Bsymbolic-functions)
    set_property(GLOBAL APPEND PROPERTY SRFS_PROGRAMS ${name})
  endif()
  if(ARG_SHARED OR ARG_INSTALL)
    set_property(GLOBAL APPEND PROPERTY SRFS_LIBRARIES ${name})
    string(REGEX REPLACE "^srfs_" "" short ${name})
    add_library(srfs::${short} ALIAS ${name})
  endif()
endfunction()

# srfs_precompile(<target> <group> HEADERS ... DEPS ...): the target begins with the headers, parsed once for all targets of the
# group, which must have the same compiler options. Saves minutes where every core counts; sources include what they use all the same.
function(srfs_precompile name group)
  cmake_parse_arguments(ARG "" "" "HEADERS;DEPS;OPTIONS" ${ARGN})
  set(owner srfs_headers_of_${group})
  if(NOT TARGET ${owner})
    add_executable(${owner} ${srfs_SOURCE_DIR}/cmake/precompiled.cpp)
    if(SRFS_HEADER_LAUNCHER)
      set_target_properties(${owner} PROPERTIES CXX_COMPILER_LAUNCHER "${SRFS_HEADER_LAUNCHER}")
    endif()
    target_include_directories(${owner} PRIVATE ${srfs_SOURCE_DIR}/lib ${srfs_SOURCE_DIR})
    target_link_libraries(${owner} PRIVATE srfs::compile_options ${ARG_DEPS})
    target_compile_options(${owner} PRIVATE ${ARG_OPTIONS})
    # The time of a header in it would make one of ccache's useless ("has been modified since the precompiled header was built").
    target_compile_options(${owner} PRIVATE "$<$<CXX_COMPILER_ID:Clang>:SHELL:-Xclang -fno-pch-timestamp>")
    target_precompile_headers(${owner} PRIVATE ${ARG_HEADERS})
  endif()
  target_precompile_headers(${name} REUSE_FROM ${owner})
endfunction()

# srfs_add_executable(<name> SOURCES ... [DEPS ...]): an installed program (bin/).
function(srfs_add_executable name)
  cmake_parse_arguments(ARG "NO_INSTALL" "" "SOURCES;DEPS" ${ARGN})
  add_executable(${name} ${ARG_SOURCES})
  target_include_directories(${name} PRIVATE ${srfs_SOURCE_DIR}/lib ${srfs_SOURCE_DIR})
  target_link_libraries(${name} PRIVATE srfs::compile_options ${ARG_DEPS})
  set_target_properties(${name} PROPERTIES RUNTIME_OUTPUT_DIRECTORY ${CMAKE_BINARY_DIR}/bin)
  if(NOT ARG_NO_INSTALL)
    install(TARGETS ${name} RUNTIME DESTINATION ${CMAKE_INSTALL_BINDIR})
    set_property(GLOBAL APPEND PROPERTY SRFS_PROGRAMS ${name})
  endif()
  srfs_release_tests(${name})
endfunction()

# add_srfs_node(<folder> [LOGIC <pure sources> [TEST <test sources>]] [ADAPTER <sources>] [DEPS ...]): one node, from one list:
#   srfs_<folder>_logic    without DDS or hardware (maintenance: suite_files reaches locks and processes), with a unit test
#   srfs_<folder>_adapter  the node itself, for its program and for tests with real DDS
#   <folder>_node          main.cpp and the adapter
function(add_srfs_node name)
  cmake_parse_arguments(ARG "" "" "LOGIC;ADAPTER;DEPS;TEST" ${ARGN})
  set(deps srfs_suite srfs_hw srfs_msgs srfs_mission ${ARG_DEPS})
  if(ARG_LOGIC)
    srfs_add_library(srfs_${name}_logic SOURCES ${ARG_LOGIC} DEPS srfs_base srfs_wire srfs_mission)
    list(PREPEND deps srfs_${name}_logic)
  endif()
  if(ARG_ADAPTER)
    srfs_add_library(srfs_${name}_adapter SOURCES ${ARG_ADAPTER} DEPS ${deps})
    # Compiled as programs are: they share precompiled headers.
    set_target_properties(srfs_${name}_adapter PROPERTIES POSITION_INDEPENDENT_CODE OFF)
    target_compile_options(srfs_${name}_adapter PRIVATE ${CMAKE_CXX_COMPILE_OPTIONS_PIE})
    srfs_precompile(srfs_${name}_adapter nodes HEADERS <suite/node.hpp> DEPS srfs_suite)
    set(deps srfs_${name}_adapter)
  endif()
  srfs_add_executable(${name}_node SOURCES main.cpp DEPS ${deps})
  srfs_precompile(${name}_node nodes HEADERS <suite/node.hpp> DEPS srfs_suite)
  if(ARG_TEST AND ARG_LOGIC)
    srfs_add_unit_test(${name}_logic SOURCES ${ARG_TEST} DEPS srfs_${name}_logic)
  endif()
endfunction()

# How SrfsInterfaces and SrfsMission build in this tree.
set(SRFS_GENERATOR_FOLDER ${PROJECT_SOURCE_DIR}/msgs/generator)
set(SRFS_INTERFACE_FOLDERS ${PROJECT_SOURCE_DIR}/msgs ${PROJECT_SOURCE_DIR}/msgs/interfaces)
function(srfs_mission_library name)
  cmake_parse_arguments(ARG "" "" "SOURCES;DEPS" ${ARGN})
  srfs_add_library(${name} SOURCES ${ARG_SOURCES} DEPS ${ARG_DEPS})
  target_include_directories(${name} PUBLIC ${CMAKE_CURRENT_SOURCE_DIR})
endfunction()
function(srfs_mission_program name)
  srfs_add_executable(${name} ${ARGN})
endfunction()
# The fragment's header is committed: target <name>_structures writes it anew, a test says when it is stale.
function(srfs_fragment_structures name header)
  set(command ${Python3_EXECUTABLE} -B ${srfs_SOURCE_DIR}/msgs/generator/mission_structures.py
    --dictionary ${srfs_SOURCE_DIR}/mission --fragment ${CMAKE_CURRENT_SOURCE_DIR}/dictionary.yaml
    --out ${CMAKE_CURRENT_SOURCE_DIR}/${header})
  add_custom_target(${name}_structures COMMAND ${command} VERBATIM)
  if(SRFS_BUILD_TESTS)
    add_test(NAME unit.${name}_structures COMMAND ${command} --check)
    set_tests_properties(unit.${name}_structures PROPERTIES LABELS unit TIMEOUT 60)
  endif()
endfunction()

# Time limits end what hangs; on a busy machine everything takes many times as long.
# Tests of a cross-build run emulated, ten times slower, and know it (tests/build_kind.hpp).
if(CMAKE_CROSSCOMPILING)
  set(SRFS_UNIT_TEST_TIMEOUT 1800)
  set(SRFS_UNIT_TEST_DEFINITIONS SRFS_EMULATED)
else()
  set(SRFS_UNIT_TEST_TIMEOUT 600)
  set(SRFS_UNIT_TEST_DEFINITIONS)
endif()

set(SRFS_TEST_OPTIONS -O0 -U_FORTIFY_SOURCE)  # FORTIFY needs an optimising compiler

# srfs_add_unit_test(<name> [RELEASE] SOURCES ... DEPS ...): GoogleTest without DDS, hardware, clock or sleep. Label: unit.
# ./run test runs unit tests under ASan and UBSan alone; RELEASE, the second label release: in the release build, too. For tests of which
# sanitizers leave something out: random cases, vector code, locked memory (tests/unit/build/test_release_tests.py finds most of them).
function(srfs_add_unit_test name)
  if(NOT SRFS_BUILD_TESTS)
    return()
  endif()
  cmake_parse_arguments(ARG "RELEASE" "" "SOURCES;DEPS" ${ARGN})
  add_executable(test_${name} ${ARG_SOURCES})
  target_include_directories(test_${name} PRIVATE ${srfs_SOURCE_DIR}/lib ${srfs_SOURCE_DIR})
  target_compile_definitions(test_${name} PRIVATE SRFS_SOURCE_DIR="${srfs_SOURCE_DIR}" ${SRFS_UNIT_TEST_DEFINITIONS})
  target_link_libraries(test_${name} PRIVATE srfs::compile_options ${ARG_DEPS} GTest::gtest GTest::gmock GTest::gtest_main)
  target_compile_options(test_${name} PRIVATE ${SRFS_TEST_OPTIONS})  # half the time to compile; what is tested is optimised as configured
  srfs_precompile(test_${name} unit_tests HEADERS <gtest/gtest.h> DEPS GTest::gtest OPTIONS ${SRFS_TEST_OPTIONS})
  set_target_properties(test_${name} PROPERTIES RUNTIME_OUTPUT_DIRECTORY ${CMAKE_BINARY_DIR}/tests)
  add_test(NAME unit.${name} COMMAND test_${name})
  set_tests_properties(unit.${name} PROPERTIES LABELS unit TIMEOUT ${SRFS_UNIT_TEST_TIMEOUT})
  set_property(GLOBAL APPEND PROPERTY SRFS_UNIT_TESTS test_${name})
  if(ARG_RELEASE)
    set_property(TEST unit.${name} APPEND PROPERTY LABELS release)
    srfs_release_tests(test_${name})
  endif()
endfunction()

# What ./run test needs in the release build besides the programs.
function(srfs_release_tests)
  set_property(GLOBAL APPEND PROPERTY SRFS_RELEASE_TESTS ${ARGN})
endfunction()

# srfs_add_node_test(<name> SOURCES ... DEPS ...): GoogleTest over real DDS or real descriptors, own DDS domain
# (tests/dds_domain.hpp). Label: node.
function(srfs_add_node_test name)
  if(NOT SRFS_BUILD_TESTS)
    return()
  endif()
  cmake_parse_arguments(ARG "" "" "SOURCES;DEPS" ${ARGN})
  add_executable(node_test_${name} ${ARG_SOURCES})
  target_include_directories(node_test_${name} PRIVATE ${srfs_SOURCE_DIR}/lib ${srfs_SOURCE_DIR})
  target_compile_definitions(node_test_${name} PRIVATE SRFS_SOURCE_DIR="${srfs_SOURCE_DIR}" SRFS_BINARY_DIR="${CMAKE_BINARY_DIR}")
  target_link_libraries(node_test_${name} PRIVATE srfs::compile_options ${ARG_DEPS} GTest::gtest GTest::gmock GTest::gtest_main)
  target_compile_options(node_test_${name} PRIVATE ${SRFS_TEST_OPTIONS})  # half the time to compile; what is tested is optimised as configured
  if(srfs_suite IN_LIST ARG_DEPS)
    srfs_precompile(node_test_${name} node_tests HEADERS <gtest/gtest.h> <suite/node.hpp> DEPS GTest::gtest srfs_suite OPTIONS ${SRFS_TEST_OPTIONS})
  else()
    srfs_precompile(node_test_${name} unit_tests HEADERS <gtest/gtest.h> DEPS GTest::gtest OPTIONS ${SRFS_TEST_OPTIONS})
  endif()
  set_target_properties(node_test_${name} PROPERTIES RUNTIME_OUTPUT_DIRECTORY ${CMAKE_BINARY_DIR}/tests)
  add_test(NAME node.${name} COMMAND node_test_${name})
  set_tests_properties(node.${name} PROPERTIES LABELS node TIMEOUT 600)
  srfs_release_tests(node_test_${name})
  # Debian's Fast DDS is not instrumented and has findings of its own.
  if(SRFS_SANITIZE STREQUAL "thread")
    set_tests_properties(node.${name} PROPERTIES ENVIRONMENT "TSAN_OPTIONS=suppressions=${srfs_SOURCE_DIR}/tests/tsan_suppressions.txt")
  elseif(SRFS_SANITIZE)
    set_tests_properties(node.${name} PROPERTIES ENVIRONMENT "ASAN_OPTIONS=new_delete_type_mismatch=0")
  endif()
endfunction()

# srfs_add_fuzzer(<name> SOURCE <file> DEPS ...): a libFuzzer target (clang, -DSRFS_BUILD_FUZZERS=ON). With gcc the
# same source is built as a unit test that replays its seed corpus tests/fuzz/corpus/<name>/ (see tests/fuzz/replay_main.cpp).
function(srfs_add_fuzzer name)
  cmake_parse_arguments(ARG "" "SOURCE" "DEPS" ${ARGN})
  if(SRFS_BUILD_FUZZERS)
    add_executable(fuzz_${name} ${ARG_SOURCE})
    target_link_options(fuzz_${name} PRIVATE -fsanitize=fuzzer)
    # libFuzzer writes what it finds into the first folder; the seeds stay as they are.
    set(found ${CMAKE_BINARY_DIR}/corpus/${name})
    file(MAKE_DIRECTORY ${found})
    add_test(NAME fuzz.${name} COMMAND fuzz_${name} -runs=200000 -seed=1 -max_total_time=60
      ${found} ${srfs_SOURCE_DIR}/tests/fuzz/corpus/${name})
    set_tests_properties(fuzz.${name} PROPERTIES LABELS fuzz TIMEOUT 180)
    set_property(GLOBAL APPEND PROPERTY SRFS_FUZZERS fuzz_${name})
  elseif(SRFS_BUILD_TESTS)
    if(NOT TARGET fuzz_replay)
      add_library(fuzz_replay OBJECT ${srfs_SOURCE_DIR}/tests/fuzz/replay_main.cpp)
      target_link_libraries(fuzz_replay PRIVATE srfs::compile_options)
    endif()
    add_executable(fuzz_${name} ${ARG_SOURCE} $<TARGET_OBJECTS:fuzz_replay>)
    add_test(NAME unit.fuzz_${name} COMMAND fuzz_${name} ${srfs_SOURCE_DIR}/tests/fuzz/corpus/${name})
    set_tests_properties(unit.fuzz_${name} PROPERTIES LABELS unit TIMEOUT ${SRFS_UNIT_TEST_TIMEOUT})
    set_property(GLOBAL APPEND PROPERTY SRFS_UNIT_TESTS fuzz_${name})
  else()
    return()
  endif()
  target_include_directories(fuzz_${name} PRIVATE ${srfs_SOURCE_DIR}/lib ${srfs_SOURCE_DIR})
  target_link_libraries(fuzz_${name} PRIVATE srfs::compile_options ${ARG_DEPS})
  set_target_properties(fuzz_${name} PROPERTIES RUNTIME_OUTPUT_DIRECTORY ${CMAKE_BINARY_DIR}/tests)
endfunction()

# srfs_add_group_targets(): called once at the end. `programs`: all that is installed; `unit_tests`: the programs of the label unit;
# `release_tests`: what all other tests and those of the label release need; `fuzzers`: those of the label fuzz; `generated`: the
# headers that a tool needs to read the sources.
function(srfs_add_group_targets)
  add_custom_target(generated DEPENDS srfs_msgs_generate srfs_mission_generate)
  get_property(programs GLOBAL PROPERTY SRFS_PROGRAMS)
  add_custom_target(programs DEPENDS ${programs})
  get_property(unit_tests GLOBAL PROPERTY SRFS_UNIT_TESTS)
  add_custom_target(unit_tests DEPENDS ${unit_tests})
  get_property(release_tests GLOBAL PROPERTY SRFS_RELEASE_TESTS)
  add_custom_target(release_tests DEPENDS programs ${release_tests})
  get_property(fuzzers GLOBAL PROPERTY SRFS_FUZZERS)
  if(fuzzers)
    add_custom_target(fuzzers DEPENDS ${fuzzers})
  endif()
endfunction()
