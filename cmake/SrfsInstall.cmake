# SPDX-FileCopyrightText: 2026 SRFS contributors
# SPDX-License-Identifier: Apache-2.0
# What a node outside this tree is built against: headers, libraries, find_package(srfs), and the settings that srfs-lane reads.
include(CMakePackageConfigHelpers)

set(SRFS_INSTALL_HEADERS ${CMAKE_INSTALL_INCLUDEDIR}/srfs)
set(SRFS_INSTALL_CMAKE ${CMAKE_INSTALL_LIBDIR}/cmake/srfs)

# In the build tree a target shows folders of this tree, installed the one folder of headers: nothing installed names this tree.
function(srfs_make_relocatable target)
  foreach(property INTERFACE_INCLUDE_DIRECTORIES INTERFACE_SYSTEM_INCLUDE_DIRECTORIES)
    get_target_property(folders ${target} ${property})
    if(NOT folders)
      continue()
    endif()
    set(shown "")
    foreach(folder IN LISTS folders)
      string(FIND "${folder}" "${PROJECT_SOURCE_DIR}" in_source)
      string(FIND "${folder}" "${PROJECT_BINARY_DIR}" in_build)
      if(in_source EQUAL 0 OR in_build EQUAL 0)
        list(APPEND shown $<BUILD_INTERFACE:${folder}> $<INSTALL_INTERFACE:${SRFS_INSTALL_HEADERS}>)
      else()
        list(APPEND shown ${folder})
      endif()
    endforeach()
    list(REMOVE_DUPLICATES shown)
    set_target_properties(${target} PROPERTIES ${property} "${shown}")
  endforeach()
endfunction()

# How srfs-lane compiles a node, once for the installation and once for this build tree (lib/update/README.md).
function(srfs_write_node_build output)
  cmake_parse_arguments(ARG "" "LIBRARIES" "INCLUDE;READABLE" ${ARGN})
  set(flags -std=c++20)
  if(SRFS_SANITIZE)
    list(APPEND flags -fsanitize=${SRFS_SANITIZE} -fno-omit-frame-pointer)
  else()
    list(APPEND flags ${SRFS_HARDENING_COMPILE} ${SRFS_FORTIFY} ${SRFS_HARDENING_LINK})  # the linker's mean nothing to the compiler
  endif()
  get_property(libraries GLOBAL PROPERTY SRFS_LIBRARIES)
  list(REMOVE_ITEM libraries srfs_msgs srfs_node srfs_camera srfs_hw_sim)
  list(APPEND libraries fastrtps fastcdr fmt yaml-cpp crypto)
  # What is linked where it is installed, on the computer that compiles: a package may be written in OpenCV.
  set(where_installed /usr/lib/${CMAKE_LIBRARY_ARCHITECTURE}/libopencv_imgproc.so /usr/lib/${CMAKE_LIBRARY_ARCHITECTURE}/libopencv_core.so)
  list(APPEND ARG_INCLUDE /usr/include/opencv4)
  foreach(list flags libraries where_installed ARG_INCLUDE ARG_READABLE)
    list(JOIN ${list} "\", \"" joined)
    set(json_${list} "[\"${joined}\"]")
  endforeach()
  file(WRITE ${output} "{\"format\": \"srfs node build 1\", \"version\": \"${PROJECT_VERSION}\",
 \"flags\": ${json_flags},
 \"include\": ${json_ARG_INCLUDE},
 \"readable\": ${json_ARG_READABLE},
 \"library_folder\": \"${ARG_LIBRARIES}\",
 \"libraries\": ${json_libraries},
 \"where_installed\": ${json_where_installed}}
")
endfunction()

# All that a node may need; what it does not use is not loaded.
add_library(srfs_node INTERFACE)
add_library(srfs::node ALIAS srfs_node)
target_link_libraries(srfs_node INTERFACE srfs_suite srfs_hw srfs_msgs srfs_mission srfs_commanding srfs_payload)

# Writes the file that find_package(srfs) reads. ${mission}, ${generator} and ${interfaces}: where it finds the mission dictionary, what
# generates code, and the interface packages that SRFS has.
macro(srfs_configure_package output)
  configure_package_config_file(${PROJECT_SOURCE_DIR}/cmake/srfsConfig.cmake.in ${output}
    INSTALL_DESTINATION ${SRFS_INSTALL_CMAKE} PATH_VARS CMAKE_INSTALL_LIBDIR CMAKE_INSTALL_BINDIR mission generator interfaces
    NO_SET_AND_CHECK_MACRO)
endmacro()

# srfs_install_package(): called once at the end.
function(srfs_install_package)
  set_property(GLOBAL APPEND PROPERTY SRFS_LIBRARIES srfs_msgs srfs_node)

  get_property(libraries GLOBAL PROPERTY SRFS_LIBRARIES)
  foreach(library IN LISTS libraries)
    srfs_make_relocatable(${library})
    string(REGEX REPLACE "^srfs_" "" short ${library})
    set_target_properties(${library} PROPERTIES EXPORT_NAME ${short})
  endforeach()
  install(TARGETS ${libraries} EXPORT srfsTargets
    LIBRARY DESTINATION ${CMAKE_INSTALL_LIBDIR} ARCHIVE DESTINATION ${CMAKE_INSTALL_LIBDIR})
  install(EXPORT srfsTargets NAMESPACE srfs:: DESTINATION ${SRFS_INSTALL_CMAKE})

  set(installed ${PROJECT_BINARY_DIR}/installed)
  write_basic_package_version_file(${installed}/srfsConfigVersion.cmake COMPATIBILITY SameMinorVersion)
  set(mission ${CMAKE_INSTALL_DATADIR}/srfs/mission)
  set(generator ${CMAKE_INSTALL_DATADIR}/srfs/generator)
  set(interfaces ${CMAKE_INSTALL_DATADIR}/srfs/interfaces)
  srfs_configure_package(${installed}/srfsConfig.cmake)
  # This build tree is a package too: find_package(srfs) finds it with CMAKE_PREFIX_PATH. What configured it before may have left files that
  # would be found first.
  file(REMOVE ${PROJECT_BINARY_DIR}/srfsConfig.cmake ${PROJECT_BINARY_DIR}/srfsConfigVersion.cmake)
  set(mission ${PROJECT_SOURCE_DIR}/mission)
  set(generator ${PROJECT_SOURCE_DIR}/msgs/generator)
  set(interfaces ${SRFS_INTERFACE_FOLDERS})
  set(in_build ${PROJECT_BINARY_DIR}/${SRFS_INSTALL_CMAKE})
  srfs_configure_package(${in_build}/srfsConfig.cmake)
  set(mission_build SrfsInterfaces.cmake SrfsMission.cmake simulator_main.cpp.in)
  list(TRANSFORM mission_build PREPEND ${PROJECT_SOURCE_DIR}/cmake/)
  file(COPY ${installed}/srfsConfigVersion.cmake ${mission_build} DESTINATION ${in_build})
  export(EXPORT srfsTargets NAMESPACE srfs:: FILE ${in_build}/srfsTargets.cmake)
  install(FILES ${installed}/srfsConfig.cmake ${installed}/srfsConfigVersion.cmake ${mission_build}
    DESTINATION ${SRFS_INSTALL_CMAKE})

  set(headers FILES_MATCHING PATTERN "*.hpp" PATTERN test EXCLUDE PATTERN catalogue EXCLUDE PATTERN photograph EXCLUDE)
  install(DIRECTORY lib/ DESTINATION ${SRFS_INSTALL_HEADERS} ${headers})
  install(DIRECTORY nodes/payload DESTINATION ${SRFS_INSTALL_HEADERS}/nodes ${headers})
  install(DIRECTORY hw_sim DESTINATION ${SRFS_INSTALL_HEADERS} ${headers})
  install(DIRECTORY msgs/mission DESTINATION ${SRFS_INSTALL_HEADERS}/msgs ${headers})
  set(generated_messages ${PROJECT_BINARY_DIR}/msgs/generated)
  set(generated_structures ${PROJECT_BINARY_DIR}/msgs/mission/generated)
  install(DIRECTORY ${generated_messages}/ ${generated_structures}/ DESTINATION ${SRFS_INSTALL_HEADERS} ${headers})

  install(DIRECTORY programs/srfs/templates DESTINATION ${CMAKE_INSTALL_DATADIR}/srfs)
  install(DIRECTORY msgs/srfs_msgs msgs/interfaces/ DESTINATION ${CMAKE_INSTALL_DATADIR}/srfs/interfaces
    FILES_MATCHING PATTERN "*.msg" PATTERN "*.srv" PATTERN "*.action")

  srfs_write_node_build(${PROJECT_BINARY_DIR}/installed_node_build.json INCLUDE ${SRFS_INSTALL_HEADERS}
    READABLE ${SRFS_INSTALL_HEADERS} ${CMAKE_INSTALL_LIBDIR} ${CMAKE_INSTALL_DATADIR}/srfs LIBRARIES ${CMAKE_INSTALL_LIBDIR})
  install(FILES ${PROJECT_BINARY_DIR}/installed_node_build.json DESTINATION ${CMAKE_INSTALL_DATADIR}/srfs RENAME node_build.json)
  set(source ${PROJECT_SOURCE_DIR})
  srfs_write_node_build(${PROJECT_BINARY_DIR}/share/srfs/node_build.json
    INCLUDE ${source}/lib ${source} ${generated_messages} ${generated_structures}
    READABLE ${source}/lib ${source}/nodes ${source}/msgs ${generated_messages} ${generated_structures} lib LIBRARIES lib)
endfunction()
