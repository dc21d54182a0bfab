// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
// Wraps the C library's system calls for a program under test, to simulate disk faults on request.

#include "tests/node/ttc/disk_faults.hpp"

#include <array>
#include <atomic>
#include <cerrno>
#include <cstdarg>
#include <cstring>

#include <dlfcn.h>
#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

namespace {

using srfs::testing_support::DiskFault;

std::atomic<DiskFault> present{DiskFault::none};
std::array<char, 256> folder{};  // changed only while no fault is present

template <typename Function>
Function* real(const char* name) {
  return reinterpret_cast<Function*>(dlsym(RTLD_NEXT, name));
}

bool is_below(const char* path) {
  return std::strncmp(path, folder.data(), std::strlen(folder.data())) == 0;
}

/// Whether the fault affects @p fd: a regular file below the folder. Sets @p size to the file's size.
bool concerns(int fd, off_t& size) {
  if (present == DiskFault::none) return false;
  std::array<char, 32> link{};
  std::snprintf(link.data(), link.size(), "/proc/self/fd/%d", fd);
  std::array<char, 512> path{};
  if (readlink(link.data(), path.data(), path.size() - 1) <= 0 || !is_below(path.data())) return false;
  struct stat info {};
  if (fstat(fd, &info) != 0 || !S_ISREG(info.st_mode)) return false;
  size = info.st_size;
  return true;
}

/// @return errno of a write that ends at octet @p end; 0: the write succeeds
int fault_of_write(int fd, off_t end) {
  off_t size = 0;
  if (!concerns(fd, size)) return 0;
  if (present == DiskFault::read_only) return EROFS;
  if (present == DiskFault::failing) return EIO;
  return end > size ? ENOSPC : 0;
}

int fault_of_sync(int fd) {
  off_t size = 0;
  return concerns(fd, size) && present == DiskFault::failing ? EIO : 0;
}

ssize_t fail(int error) {
  errno = error;
  return -1;
}

int open_unless_read_only(const char* path, int flags, mode_t mode) {
  static auto* const next = real<int(const char*, int, ...)>("open");
  const bool writes = (flags & O_ACCMODE) != O_RDONLY || (flags & O_CREAT) != 0;
  if (present == DiskFault::read_only && writes && is_below(path)) return static_cast<int>(fail(EROFS));
  return next(path, flags, mode);
}

}  // namespace

namespace srfs::testing_support {

void set_disk_fault(DiskFault fault, const std::filesystem::path& below) {
  present = DiskFault::none;
  std::strncpy(folder.data(), below.c_str(), folder.size() - 1);
  present = fault;
}

}  // namespace srfs::testing_support

extern "C" {

int open(const char* path, int flags, ...) {
  va_list arguments;
  va_start(arguments, flags);
  const mode_t mode = (flags & (O_CREAT | O_TMPFILE)) != 0 ? va_arg(arguments, mode_t) : 0;
  va_end(arguments);
  return open_unless_read_only(path, flags, mode);
}

ssize_t write(int fd, const void* data, size_t octets) {
  static auto* const next = real<ssize_t(int, const void*, size_t)>("write");
  if (present != DiskFault::none) {
    const off_t at = lseek(fd, 0, SEEK_CUR);
    const int saved = errno;
    if (const int error = fault_of_write(fd, at + static_cast<off_t>(octets)); error != 0) return fail(error);
    errno = saved;
  }
  return next(fd, data, octets);
}

ssize_t pwrite(int fd, const void* data, size_t octets, off_t offset) {
  static auto* const next = real<ssize_t(int, const void*, size_t, off_t)>("pwrite");
  if (const int error = fault_of_write(fd, offset + static_cast<off_t>(octets)); error != 0)
    return fail(error);
  return next(fd, data, octets, offset);
}

int fdatasync(int fd) {
  static auto* const next = real<int(int)>("fdatasync");
  if (const int error = fault_of_sync(fd); error != 0) return static_cast<int>(fail(error));
  return next(fd);
}

int fsync(int fd) {
  static auto* const next = real<int(int)>("fsync");
  if (const int error = fault_of_sync(fd); error != 0) return static_cast<int>(fail(error));
  return next(fd);
}

int rename(const char* from, const char* to) noexcept {
  static auto* const next = real<int(const char*, const char*)>("rename");
  if (present == DiskFault::read_only && is_below(to)) return static_cast<int>(fail(EROFS));
  return next(from, to);
}

}  // extern "C"
