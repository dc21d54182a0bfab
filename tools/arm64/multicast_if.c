// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
// Preloaded into emulated programs: QEMU's user-mode emulation (7.2) answers ENOPROTOOPT to IP_MULTICAST_IF, and Fast DDS then
// discovers nobody. On the loopback interface it makes no difference which interface was asked for.
#define _GNU_SOURCE
#include <netinet/in.h>
#include <sys/socket.h>
#include <sys/syscall.h>
#include <unistd.h>

int setsockopt(int fd, int level, int option, const void* value, socklen_t length) {
  if (level == IPPROTO_IP && option == IP_MULTICAST_IF) return 0;
  return (int)syscall(SYS_setsockopt, fd, level, option, value, length);
}
