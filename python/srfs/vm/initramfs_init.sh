#!/bin/sh
# SPDX-FileCopyrightText: 2026 SRFS contributors
# SPDX-License-Identifier: Apache-2.0
# First program of the guest, from its initramfs: the host's root file system (9p, read-only) under a tmpfs, then on to
# guest_init.sh. Only busybox and the modules named in /modules are here. Writes to the console, which the host shows on failure.
export PATH=/bin
busybox mount -t proc proc /proc
busybox mount -t sysfs sysfs /sys
busybox mount -t devtmpfs devtmpfs /dev

give_up() {
  echo "initramfs: $*" > /dev/console
  echo b > /proc/sysrq-trigger # a reset without an exit code: the host says so
  busybox sleep 60
}

while read -r module; do
  busybox insmod "/m/$module" || give_up "cannot load $module"
done < /modules

share=trans=virtio,version=9p2000.L,msize=262144
busybox mount -t 9p -o "ro,$share,cache=loose" root /mnt/lower || give_up "the host's root is not there"
busybox mount -t tmpfs -o size=60% tmpfs /mnt/over
busybox mkdir /mnt/over/upper /mnt/over/work
busybox mount -t overlay -o lowerdir=/mnt/lower,upperdir=/mnt/over/upper,workdir=/mnt/over/work overlay /mnt/root || give_up "no overlay"

for folder in proc sys dev; do busybox mount --move "/$folder" "/mnt/root/$folder"; done
busybox mkdir -p /mnt/root/dev/pts /mnt/root/dev/shm
busybox mount -t devpts devpts /mnt/root/dev/pts
busybox mount -t tmpfs tmpfs /mnt/root/dev/shm
busybox mount -t tmpfs tmpfs /mnt/root/run
busybox mkdir /mnt/root/run/vm # what host and guest tell each other: python/srfs/vm/guest.py
busybox mount -t 9p -o "$share" vm /mnt/root/run/vm || give_up "the host's exchange folder is not there"
exec busybox switch_root /mnt/root /bin/bash /run/vm/guest_init.sh
