#!/bin/bash
# SPDX-FileCopyrightText: 2026 SRFS contributors
# SPDX-License-Identifier: Apache-2.0
# To be sourced: a bare Debian 12 in a folder, made with mmdebstrap. Nothing of this machine is changed. Needs root and a mirror.

# make_bare_debian FOLDER [options of mmdebstrap]
make_bare_debian() {
  local folder=$1 mirror=${SRFS_DEBIAN_MIRROR:-http://deb.debian.org/debian}
  shift
  mmdebstrap --quiet --mode=root "$@" bookworm "$folder" \
    "deb $mirror bookworm main" "deb $mirror bookworm-updates main" \
    "deb ${SRFS_DEBIAN_SECURITY_MIRROR:-http://deb.debian.org/debian-security} bookworm-security main"
}

# enter_bare_debian FOLDER COMMAND...: runs the command there with its own processes and network (loopback alone), as root.
enter_bare_debian() {
  # shellcheck disable=SC2016  # expanded inside
  unshare --net --mount --pid --ipc --fork --kill-child bash -c '
    ip link set lo up
    mount --bind "$1" "$1" # a root as a machine has it: the lane makes its mounts private
    mount -t proc proc "$1/proc"
    mount -t sysfs -o ro sysfs "$1/sys" 2> /dev/null || true
    mount -t tmpfs tmpfs "$1/dev/shm"
    mount -t devpts -o newinstance,ptmxmode=0666,mode=0620 devpts "$1/dev/pts"
    ln -sf pts/ptmx "$1/dev/ptmx" 2> /dev/null || true
    exec chroot "$1" /usr/bin/env -i PATH=/usr/sbin:/usr/bin:/sbin:/bin LANG=C.UTF-8 DEBIAN_FRONTEND=noninteractive "${@:2}"' bash "$@"
}
