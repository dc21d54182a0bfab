// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
// test_once.py preloads this library into ttc. It ends the process with SIGKILL at the n-th system call after
// the arrival of a telecommand. Only the calls that read octets, write the journal, or send to other nodes or
// the line count. The armed crash point is in a mapped file, so that only one process ends. For tools
// (test_added_node.py) only calls that change the disk count, from the start of the process.

#include <atomic>
#include <cstdint>
#include <cstdlib>

#include <dlfcn.h>
#include <fcntl.h>
#include <signal.h>
#include <stdio.h>
#include <sys/mman.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <sys/types.h>
#include <unistd.h>

namespace {

struct CrashPoint {
  std::atomic<std::uint64_t>
      calls;  ///< 0: not armed. N: the process ends before its N-th call, and the point is disarmed
  std::atomic<std::uint64_t> begun;  ///< a telecommand has arrived since arming: calls count
  std::atomic<std::uint64_t> changes_only;
};

CrashPoint* crash_point() {
  static CrashPoint* const mapped = []() -> CrashPoint* {
    const char* path = std::getenv("SRFS_CRASH_POINT");
    if (path == nullptr) return nullptr;
    const int fd = open(path, O_RDWR | O_CLOEXEC);
    if (fd < 0) return nullptr;
    void* page = mmap(nullptr, sizeof(CrashPoint), PROT_READ | PROT_WRITE, MAP_SHARED, fd, 0);
    close(fd);
    return page == MAP_FAILED ? nullptr : static_cast<CrashPoint*>(page);
  }();
  return mapped;
}

/// The pid of the process that loaded this library, not of a child that it forks to start another program.
const pid_t own_pid = getpid();

enum class Call { reads, speaks, writes, changes };

void count(Call call) {
  CrashPoint* point = crash_point();
  if (point == nullptr || point->begun == 0) return;
  const bool wanted =
      point->changes_only != 0 ? call == Call::writes || call == Call::changes : call != Call::changes;
  if (!wanted || (point->changes_only != 0 && getpid() != own_pid)) return;
  std::uint64_t before = point->calls.load();
  while (before > 0 && !point->calls.compare_exchange_weak(before, before - 1)) {
  }
  if (before == 1) kill(getpid(), SIGKILL);
}

/// Looks for the start sequence of a CLTU in the octets that were read.
void look_for_a_telecommand(const void* data, ssize_t octets) {
  CrashPoint* point = crash_point();
  if (point == nullptr || point->calls == 0 || octets < 2) return;
  const auto* bytes = static_cast<const std::uint8_t*>(data);
  for (ssize_t i = 0; i + 1 < octets; ++i) {
    if (bytes[i] == 0xEB && bytes[i + 1] == 0x90) point->begun = 1;
  }
}

template <typename Function>
Function* next(const char* name) {
  return reinterpret_cast<Function*>(dlsym(RTLD_NEXT, name));
}

}  // namespace

extern "C" {

ssize_t read(int fd, void* data, size_t octets) {
  static auto* const real = next<ssize_t(int, void*, size_t)>("read");
  count(Call::reads);
  const ssize_t taken = real(fd, data, octets);
  look_for_a_telecommand(data, taken);
  return taken;
}

ssize_t write(int fd, const void* data, size_t octets) {
  static auto* const real = next<ssize_t(int, const void*, size_t)>("write");
  count(Call::writes);
  return real(fd, data, octets);
}

ssize_t pwrite64(int fd, const void* data, size_t octets, off64_t offset) {
  static auto* const real = next<ssize_t(int, const void*, size_t, off64_t)>("pwrite64");
  count(Call::writes);
  return real(fd, data, octets, offset);
}

ssize_t pwrite(int fd, const void* data, size_t octets, off_t offset) {
  static auto* const real = next<ssize_t(int, const void*, size_t, off_t)>("pwrite");
  count(Call::writes);
  return real(fd, data, octets, offset);
}

int fdatasync(int fd) {
  static auto* const real = next<int(int)>("fdatasync");
  count(Call::writes);
  return real(fd);
}

ssize_t sendto(int fd, const void* data, size_t octets, int flags, const sockaddr* to, socklen_t length) {
  static auto* const real =
      next<ssize_t(int, const void*, size_t, int, const sockaddr*, socklen_t)>("sendto");
  count(Call::speaks);
  return real(fd, data, octets, flags, to, length);
}

ssize_t sendmsg(int fd, const msghdr* message, int flags) {
  static auto* const real = next<ssize_t(int, const msghdr*, int)>("sendmsg");
  count(Call::speaks);
  return real(fd, message, flags);
}

int fsync(int fd) {
  static auto* const real = next<int(int)>("fsync");
  count(Call::changes);
  return real(fd);
}

int rename(const char* from, const char* to) {
  static auto* const real = next<int(const char*, const char*)>("rename");
  count(Call::changes);
  return real(from, to);
}

int unlink(const char* path) {
  static auto* const real = next<int(const char*)>("unlink");
  count(Call::changes);
  return real(path);
}

int unlinkat(int folder, const char* path, int flags) {
  static auto* const real = next<int(int, const char*, int)>("unlinkat");
  count(Call::changes);
  return real(folder, path, flags);
}

int mkdir(const char* path, mode_t mode) {
  static auto* const real = next<int(const char*, mode_t)>("mkdir");
  count(Call::changes);
  return real(path, mode);
}

}  // extern "C"
