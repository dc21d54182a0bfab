# SPDX-FileCopyrightText: 2026 SRFS contributors
# SPDX-License-Identifier: Apache-2.0
# Run by CPack behind the installation into the package's folder (SrfsPackaging.cmake): what lies outside the prefix.
set(source ${CPACK_SRFS_SOURCE}/packaging)
set(root ${CPACK_TEMPORARY_INSTALL_DIRECTORY})  # file(COPY): file(INSTALL) would put DESTDIR before it

function(put file destination)
  cmake_path(GET destination PARENT_PATH folder)
  cmake_path(GET destination FILENAME name)
  cmake_path(GET file FILENAME old_name)
  file(COPY ${file} DESTINATION ${root}/${folder} ${ARGN})
  if(NOT name STREQUAL old_name)
    file(RENAME ${root}/${folder}/${old_name} ${root}/${folder}/${name})
  endif()
endfunction()

file(GLOB units ${source}/systemd/*.service ${source}/systemd/*.slice)
file(COPY ${units} DESTINATION ${root}/usr/lib/systemd/system)
put(${source}/systemd/user/srfs-ground.service usr/lib/systemd/user/srfs-ground.service)
put(${source}/systemd/manager.conf usr/lib/systemd/system.conf.d/50-srfs.conf)
put(${source}/70-srfs.rules usr/lib/udev/rules.d/70-srfs.rules)
put(${source}/sysctl.conf usr/lib/sysctl.d/60-srfs.conf)
put(${source}/modules-load.conf usr/lib/modules-load.d/srfs.conf)
put(${source}/modprobe.conf usr/lib/modprobe.d/srfs.conf)
put(${source}/limits.conf etc/security/limits.d/srfs.conf)
put(${CPACK_SRFS_SOURCE}/launch_config/board_rk3568.yaml etc/srfs/deployment.yaml)
file(COPY ${CPACK_SRFS_SOURCE}/docs DESTINATION ${root}/opt/srfs/share/doc/srfs)
put(${CPACK_SRFS_SOURCE}/LICENSE usr/share/doc/srfs/copyright)
put(${CPACK_SRFS_SOURCE}/CHANGELOG.md usr/share/doc/srfs/CHANGELOG.md)
put(${source}/srfs-start opt/srfs/lib/srfs-start FILE_PERMISSIONS
  OWNER_READ OWNER_WRITE OWNER_EXECUTE GROUP_READ GROUP_EXECUTE WORLD_READ WORLD_EXECUTE)
put(${source}/srfs usr/bin/srfs FILE_PERMISSIONS
  OWNER_READ OWNER_WRITE OWNER_EXECUTE GROUP_READ GROUP_EXECUTE WORLD_READ WORLD_EXECUTE)
file(CREATE_LINK ../../opt/srfs/bin/srfs-ground ${root}/usr/bin/srfs-ground SYMBOLIC)
foreach(page man/man1/srfs-ground.1 bash-completion/completions/srfs-ground)
  if(EXISTS ${root}/opt/srfs/share/${page})  # not of a cross-build that cannot run the program
    cmake_path(GET page PARENT_PATH folder)
    file(MAKE_DIRECTORY ${root}/usr/share/${folder})
    file(CREATE_LINK ../../../../opt/srfs/share/${page} ${root}/usr/share/${page} SYMBOLIC)
  endif()
endforeach()
