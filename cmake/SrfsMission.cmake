# SPDX-FileCopyrightText: 2026 SRFS contributors
# SPDX-License-Identifier: Apache-2.0
# What builds a mission: its payloads, its simulator. The same functions in this tree and behind find_package(srfs).

# What the structs are made with: the generator and SRFS' own part of the dictionary, installed or in the source tree.
function(srfs_generator_files result)
  file(GLOB files CONFIGURE_DEPENDS ${SRFS_GENERATOR_FOLDER}/*.py ${SRFS_GENERATOR_FOLDER}/*.jinja
    ${SRFS_GENERATOR_FOLDER}/../core/*.yaml ${SRFS_GENERATOR_FOLDER}/../mission/*.yaml)
  set(${result} ${files} PARENT_SCOPE)
endfunction()

# srfs_mission(<name> DICTIONARY <mission.yaml> [DEPLOYMENTS <files>]): outside this tree, once, before the mission's targets.
#   <mission/structures.hpp> of the mission's dictionary is what all targets of this folder and below include
#   share/<name>/ in the build folder and installed: the dictionary, the structs, and the deployments, which say `dictionary: .` and
#   `programs: ../../bin`
function(srfs_mission name)
  cmake_parse_arguments(ARG "" "DICTIONARY" "DEPLOYMENTS" ${ARGN})
  # Debian's Python modules belong to /usr/bin/python3, whatever stands first in PATH.
  set(Python3_EXECUTABLE /usr/bin/python3 CACHE FILEPATH "Python that has jinja2 and yaml")
  find_package(Python3 REQUIRED COMPONENTS Interpreter)
  get_filename_component(mission ${ARG_DICTIONARY} ABSOLUTE)
  get_filename_component(folder ${mission} DIRECTORY)
  file(GLOB files RELATIVE ${folder} CONFIGURE_DEPENDS ${folder}/mission.yaml ${folder}/*/dictionary.yaml)
  set(generated ${CMAKE_BINARY_DIR}/share/${name}/structures)  # the build lane on board compiles with them, too
  list(TRANSFORM files PREPEND ${folder}/ OUTPUT_VARIABLE dictionary)
  srfs_generator_files(generator)
  # What reads it in flight and on the ground knows each key: a misspelt one ends the build, with file and line.
  set(check)
  if(NOT CMAKE_CROSSCOMPILING)
    set(check COMMAND sh -c "SRFS_MISSION_DIR='${folder}' '${SRFS_PROGRAM_FOLDER}/srfs-ground' list > /dev/null")
  endif()
  # Files of an installation may be older than what was built before it.
  set(stamp ${CMAKE_CURRENT_BINARY_DIR}/structures_${srfs_VERSION}.stamp)
  add_custom_command(
    OUTPUT ${stamp}
    BYPRODUCTS ${generated}/mission/structures.hpp ${generated}/mission/structures.cpp
    COMMAND ${Python3_EXECUTABLE} -B ${SRFS_GENERATOR_FOLDER}/mission_structures.py --dictionary ${folder}
            --out ${generated}/mission/structures.hpp --source ${generated}/mission/structures.cpp
    ${check}
    COMMAND ${CMAKE_COMMAND} -E touch ${stamp}
    DEPENDS ${dictionary} ${generator}
    COMMENT "Generating C++ structs of the mission dictionary" VERBATIM)
  add_custom_target(${name}_dictionary DEPENDS ${stamp})
  set_property(GLOBAL PROPERTY SRFS_MISSION_DICTIONARY ${name}_dictionary)
  set_property(GLOBAL PROPERTY SRFS_MISSION_OF_THIS_BUILD ${folder})
  include_directories(BEFORE ${generated})
  # Part of each program: srfs::mission has the structures of the mission that SRFS was built with.
  add_library(${name}_structures OBJECT ${generated}/mission/structures.cpp)
  srfs_mission_compile(${name}_structures)
  target_link_libraries(${name}_structures PRIVATE srfs::mission)
  set_property(GLOBAL PROPERTY SRFS_MISSION_STRUCTURES $<TARGET_OBJECTS:${name}_structures>)
  foreach(file IN LISTS files)
    configure_file(${folder}/${file} ${CMAKE_BINARY_DIR}/share/${name}/${file} COPYONLY)
  endforeach()
  foreach(file IN LISTS ARG_DEPLOYMENTS)
    get_filename_component(file_name ${file} NAME)
    configure_file(${file} ${CMAKE_BINARY_DIR}/share/${name}/${file_name} COPYONLY)
  endforeach()
  install(DIRECTORY ${CMAKE_BINARY_DIR}/share/${name} DESTINATION share)
endfunction()

# srfs_add_node(<name> SOURCES ... [LOGIC <pure sources>] [STRUCTURES <header>] [TEST <sources>] [DEPS ...] [NO_INSTALL]): the program
# <name>_node, hardened like SRFS' own, installed into bin/.
#   LOGIC       the library <name>_logic, without DDS or hardware
#   STRUCTURES  generated from dictionary.yaml beside it, the node's fragment of the mission dictionary
#   TEST        unit test test_<name> of the logic
# SRFS_NO_INSTALL, set in a folder, holds for all nodes below.
function(srfs_add_node name)
  cmake_parse_arguments(ARG "NO_INSTALL" "STRUCTURES" "SOURCES;LOGIC;TEST;DEPS" ${ARGN})
  set(no_install)
  if(ARG_NO_INSTALL OR SRFS_NO_INSTALL)
    set(no_install NO_INSTALL)
  endif()
  set(logic)
  if(ARG_LOGIC)
    set(logic ${name}_logic)
    srfs_mission_library(${logic} SOURCES ${ARG_LOGIC} DEPS srfs::telecommand_journal srfs::mission)
  endif()
  srfs_mission_program(${name}_node ${no_install} SOURCES ${ARG_SOURCES} DEPS ${logic} srfs::node ${ARG_DEPS})
  if(COMMAND srfs_precompile)
    srfs_precompile(${name}_node nodes HEADERS <suite/node.hpp> DEPS srfs_suite)
  endif()
  if(ARG_TEST)
    srfs_add_unit_test(${name} SOURCES ${ARG_TEST} DEPS ${logic})
  endif()
  if(ARG_STRUCTURES)
    srfs_fragment_structures(${name} ${ARG_STRUCTURES})
  endif()
endfunction()

# srfs_find_opencv(): the target srfs::opencv, OpenCV's core and imgproc, for a method that is written in it; no target where they are not
# installed. Debian's CMake package of OpenCV is in libopencv-dev alone, which brings 300 others.
function(srfs_find_opencv)
  if(TARGET srfs::opencv)
    return()
  endif()
  find_path(SRFS_OPENCV_INCLUDE opencv2/imgproc.hpp PATH_SUFFIXES opencv4)
  find_library(SRFS_OPENCV_CORE opencv_core)
  find_library(SRFS_OPENCV_IMGPROC opencv_imgproc)
  if(NOT SRFS_OPENCV_INCLUDE OR NOT SRFS_OPENCV_CORE OR NOT SRFS_OPENCV_IMGPROC)
    message(STATUS "no OpenCV: install libopencv-core-dev and libopencv-imgproc-dev")
    return()
  endif()
  add_library(srfs::opencv INTERFACE IMPORTED)
  target_include_directories(srfs::opencv SYSTEM INTERFACE ${SRFS_OPENCV_INCLUDE})
  target_link_libraries(srfs::opencv INTERFACE ${SRFS_OPENCV_IMGPROC} ${SRFS_OPENCV_CORE})
endfunction()

# srfs_add_payload(<name> LOGIC <sources> [MODEL <sources>] [TEST <sources>] [DEPS ...] [NO_INSTALL]): a payload from its folder:
#   <name>_logic  its profile, without DDS or hardware
#   <name>_node   main.cpp and the library of all payloads
#   <name>_model  the model of its peripheral, for srfs_add_simulator; has make_<name>_model()
#   test_<name>   unit test of profile and model
function(srfs_add_payload name)
  cmake_parse_arguments(ARG "NO_INSTALL" "" "LOGIC;MODEL;TEST;DEPS" ${ARGN})
  set(no_install)
  if(ARG_NO_INSTALL)
    set(no_install NO_INSTALL)
  endif()
  srfs_mission_library(${name}_logic SOURCES ${ARG_LOGIC} DEPS srfs::payload_logic srfs::mission ${ARG_DEPS})
  srfs_add_node(${name} SOURCES main.cpp DEPS ${name}_logic srfs::payload ${no_install})
  set(tested ${name}_logic)
  if(ARG_MODEL)
    srfs_mission_library(${name}_model SOURCES ${ARG_MODEL} DEPS srfs::hw_sim srfs::mission)
    list(APPEND tested ${name}_model)
  endif()
  if(ARG_TEST)
    srfs_add_unit_test(${name} SOURCES ${ARG_TEST} DEPS ${tested})
  endif()
endfunction()

# srfs_add_simulator(<program> MODELS <payloads>): simulates the devices of a deployment with the models of these payloads.
function(srfs_add_simulator program)
  cmake_parse_arguments(ARG "" "" "MODELS" ${ARGN})
  set(SRFS_MAKERS "")
  set(SRFS_MODELS "")
  set(libraries "")
  foreach(payload IN LISTS ARG_MODELS)
    string(APPEND SRFS_MAKERS "std::unique_ptr<PeripheralModel> make_${payload}_model(const ModelContext&);\n")
    string(APPEND SRFS_MODELS "      {\"${payload}\", srfs::sim::make_${payload}_model},\n")
    list(APPEND libraries ${payload}_model)
  endforeach()
  configure_file(${SRFS_CMAKE_FOLDER}/simulator_main.cpp.in ${CMAKE_CURRENT_BINARY_DIR}/${program}_main.cpp @ONLY)
  srfs_mission_program(${program} SOURCES ${CMAKE_CURRENT_BINARY_DIR}/${program}_main.cpp DEPS ${libraries} srfs::hw_sim)
endfunction()
set(SRFS_CMAKE_FOLDER ${CMAKE_CURRENT_LIST_DIR})
