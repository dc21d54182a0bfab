// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <fcntl.h>
#include <stdlib.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <unistd.h>

#include <chrono>
#include <ctime>
#include <filesystem>
#include <stdexcept>
#include <string>
#include <system_error>

#include "base/fd.hpp"

namespace srfs::testing_support {

/// A unique folder, removed by the destructor. The owner holds a lock on the folder, which ends with its
/// process. The next program that creates a temporary folder removes the folders of killed tests.
/// (tests/system/support.py does the same for the system tests.)
class TemporaryFolder {
 public:
  TemporaryFolder() {
    static const bool swept = (remove_abandoned(), true);
    static_cast<void>(swept);
    std::string pattern = (std::filesystem::temp_directory_path() / prefix).string() + "XXXXXX";
    if (::mkdtemp(pattern.data()) == nullptr) throw std::runtime_error("no temporary folder");
    path_ = pattern;
    lock_ = lock(path_);
  }
  TemporaryFolder(const TemporaryFolder&) = delete;
  TemporaryFolder& operator=(const TemporaryFolder&) = delete;
  ~TemporaryFolder() { remove(path_); }

  [[nodiscard]] const std::filesystem::path& path() const { return path_; }

  /// Removes folders whose owner has ended. Keeps folders younger than one minute: the owner may be about to
  /// lock the folder.
  static void remove_abandoned(const std::filesystem::path& parent = std::filesystem::temp_directory_path(),
                               std::time_t youngest_s = 60) {
    std::error_code error;
    for (const auto& entry : std::filesystem::directory_iterator(parent, error)) {
      if (!entry.path().filename().string().starts_with(prefix)) continue;
      const Fd owner = lock(entry.path());
      struct stat folder {};
      if (!owner || ::fstat(owner.get(), &folder) != 0 || folder.st_uid != ::geteuid()) continue;
      // std::time() is up to one clock tick behind the kernel's file times.
      const std::time_t now = std::chrono::system_clock::to_time_t(std::chrono::system_clock::now());
      if (now - folder.st_mtime >= youngest_s) remove(entry.path());
    }
  }

  static constexpr const char* prefix = "srfs_test_";

 private:
  /// Locks the folder. @return empty if another process holds the lock
  static Fd lock(const std::filesystem::path& folder) {
    Fd fd(::open(folder.c_str(), O_RDONLY | O_DIRECTORY | O_NOFOLLOW | O_CLOEXEC));
    return fd && ::flock(fd.get(), LOCK_EX | LOCK_NB) == 0 ? std::move(fd) : Fd();
  }
  static void remove(const std::filesystem::path& folder) {
    std::error_code ignored;
    std::filesystem::remove_all(folder, ignored);
  }

  std::filesystem::path path_;
  Fd lock_;
};

}  // namespace srfs::testing_support
