# SPDX-FileCopyrightText: 2026 SRFS contributors
# SPDX-License-Identifier: Apache-2.0
# C++ types of ROS 2 interfaces: those of one's own, and those of any interface package. The same in this tree and behind find_package(srfs).

# srfs_generate_interfaces(<target> [<files>] [PACKAGES <folders or names>]): the library <target> of C++ types, for target_link_libraries
# and DEPS; of msg/Count.msg of the package pack it has <pack/msg/count.hpp>, pack::msg::Count.
#   <files>   .msg, .srv and .action files of this folder: the interface package is called as the target
#   PACKAGES  whole interface packages: folders (with a '/'), or names: std_srvs
# Packages that are named, or used by an interface, are searched for in share/ of CMAKE_PREFIX_PATH and AMENT_PREFIX_PATH (a ROS 2), then in
# /usr/share, where Debian's ros-std-msgs, ros-geometry-msgs and others are in the notation of ROS 1. What SRFS has itself is not generated.
# The generator runs when CMake configures, again when an interface changes. Needs python3-rosidl. The texts are in share/<package> of the
# build folder; those of <files> are installed, too: AMENT_PREFIX_PATH shows them to `srfs record --mcap` and to other builds.
function(srfs_generate_interfaces target)
  cmake_parse_arguments(ARG "" "" "PACKAGES" ${ARGN})
  set(Python3_EXECUTABLE /usr/bin/python3 CACHE FILEPATH "Python that has rosidl_adapter")  # Debian's modules belong to it
  find_package(Python3 REQUIRED COMPONENTS Interpreter)
  set(generator ${SRFS_GENERATOR_FOLDER}/ros_messages.py)
  set(generated ${CMAKE_CURRENT_BINARY_DIR}/${target}_types)
  set(options --out ${generated} --texts ${CMAKE_BINARY_DIR}/share --ros1 /usr/share --inputs)
  foreach(folder IN LISTS SRFS_INTERFACE_FOLDERS)
    list(APPEND options --have ${folder})
  endforeach()
  string(REPLACE ":" ";" environment "$ENV{CMAKE_PREFIX_PATH}:$ENV{AMENT_PREFIX_PATH}")
  foreach(prefix IN LISTS CMAKE_PREFIX_PATH environment)
    list(APPEND options --path ${prefix}/share)
  endforeach()
  if(ARG_UNPARSED_ARGUMENTS)
    list(TRANSFORM ARG_UNPARSED_ARGUMENTS PREPEND ${CMAKE_CURRENT_SOURCE_DIR}/ REGEX "^[^/]" OUTPUT_VARIABLE files)
    list(APPEND options --own ${target} ${files})
  endif()
  set(packages)
  foreach(package IN LISTS ARG_PACKAGES)
    if(package MATCHES "/")
      get_filename_component(package ${package} ABSOLUTE)
      file(GLOB new CONFIGURE_DEPENDS ${package}/msg/*.msg ${package}/srv/*.srv ${package}/action/*.action)  # notices new files
    endif()
    list(APPEND packages ${package})
  endforeach()
  execute_process(COMMAND ${Python3_EXECUTABLE} -B ${generator} ${options} -- ${packages}
    OUTPUT_VARIABLE inputs ERROR_VARIABLE error RESULT_VARIABLE failed)
  if(failed)
    message(FATAL_ERROR "srfs_generate_interfaces(${target}): ${error}")
  endif()
  set_property(DIRECTORY APPEND PROPERTY CMAKE_CONFIGURE_DEPENDS ${generator} ${inputs})
  add_library(${target} INTERFACE)
  target_include_directories(${target} SYSTEM INTERFACE ${generated})
  target_link_libraries(${target} INTERFACE srfs::base srfs::msgs)
  if(ARG_UNPARSED_ARGUMENTS AND NOT SRFS_NO_INSTALL)
    install(DIRECTORY ${CMAKE_BINARY_DIR}/share/${target} DESTINATION share)
  endif()
endfunction()
