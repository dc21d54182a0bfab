// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
// test_remote_files.py preloads this library into ttc to simulate a full or read-only disk below the folder
// of files. Each change by the thread ttc_files fails with the error number in a mapped file (0: no fault).

#include <atomic>
#include <cerrno>
#include <cstdarg>
#include <cstdint>
#include <cstdlib>
#include <cstring>

#include <dlfcn.h>
#include <fcntl.h>
#include <pthread.h>
#include <sys/mman.h>
#include <sys/stat.h>
#include <unistd.h>

namespace {

std::atomic<std::uint32_t>* error_in_force() {
  static auto* const mapped = []() -> std::atomic<std::uint32_t>* {
    const char* path = std::getenv("SRFS_DISK_FAULT");
    if (path == nullptr) return nullptr;
    const int fd = open(path, O_RDWR | O_CLOEXEC);
    if (fd < 0) return nullptr;
    void* page = mmap(nullptr, sizeof(std::uint32_t), PROT_READ | PROT_WRITE, MAP_SHARED, fd, 0);
    close(fd);
    return page == MAP_FAILED ? nullptr : static_cast<std::atomic<std::uint32_t>*>(page);
  }();
  return mapped;
}

/// @return whether the call must fail; then errno holds the error
bool fails() {
  static thread_local bool asking = false;  // the open() above calls this function too
  if (asking) return false;
  asking = true;
  const auto* error = error_in_force();
  asking = false;
  if (error == nullptr || *error == 0) return false;
  char name[16] = {};
  pthread_getname_np(pthread_self(), name, sizeof(name));
  if (std::strcmp(name, "ttc_files") != 0) return false;
  errno = static_cast<int>(*error);
  return true;
}

template <typename Function>
Function* next(const char* name) {
  return reinterpret_cast<Function*>(dlsym(RTLD_NEXT, name));
}

}  // namespace

extern "C" {

int mkdirat(int folder, const char* path, mode_t mode) {
  static auto* const real = next<int(int, const char*, mode_t)>("mkdirat");
  return fails() ? -1 : real(folder, path, mode);
}

int unlinkat(int folder, const char* path, int flags) {
  static auto* const real = next<int(int, const char*, int)>("unlinkat");
  return fails() ? -1 : real(folder, path, flags);
}

int renameat(int from, const char* old_path, int to, const char* new_path) {
  static auto* const real = next<int(int, const char*, int, const char*)>("renameat");
  return fails() ? -1 : real(from, old_path, to, new_path);
}

int openat(int folder, const char* path, int flags, ...) {
  static auto* const real = next<int(int, const char*, int, ...)>("openat");
  mode_t mode = 0;
  if ((flags & O_CREAT) != 0) {
    va_list arguments;
    va_start(arguments, flags);
    mode = va_arg(arguments, mode_t);
    va_end(arguments);
    if (fails()) return -1;
  }
  return real(folder, path, flags, mode);
}
}
