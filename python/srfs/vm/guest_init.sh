#!/bin/bash
# SPDX-FileCopyrightText: 2026 SRFS contributors
# SPDX-License-Identifier: Apache-2.0
# Process 1 of the guest after initramfs_init.sh: runs the command that lies in /run/vm/command, leaves its exit code in
# /run/vm/exit_code and switches the machine off. What the command prints goes to /run/vm/output, which the host shows meanwhile.
export PATH=/usr/local/sbin:/usr/local/bin:/usr/sbin:/usr/bin:/sbin:/bin HOME=/root TERM=dumb LANG=C.UTF-8
up() { cut -d' ' -f1 /proc/uptime; }
up > /run/vm/booted_s

release=$(uname -r)
mkdir -p "/lib/modules/$release" # in memory: nothing of the host's is written
mount --bind "$(cat /run/vm/modules)" "/lib/modules/$release"
ip link set lo up
hostname guest

setsid --wait bash /run/vm/command < /dev/null >> /run/vm/output 2>&1 # the second time after a reset
code=$?
up > /run/vm/ended_s
echo "$code" > /run/vm/exit_code
sync
echo o > /proc/sysrq-trigger
sleep 60
