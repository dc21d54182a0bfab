// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>

#include "base/fd.hpp"

namespace srfs::update {

/// Control groups of one confined program: memory and number of processes over all of them together. Version
/// 2 or 1, whichever is mounted at /sys/fs/cgroup; with the package's units below srfs-build.slice. Removed
/// with this object, once no process is in them.
class ControlGroup {
 public:
  ControlGroup(std::uint64_t memory_octets, unsigned processes);
  ControlGroup(const ControlGroup&) = delete;
  ControlGroup& operator=(const ControlGroup&) = delete;
  ~ControlGroup();

  /// 0 or why there is none, an errno.
  [[nodiscard]] int memory_refusal() const { return memory_refusal_; }
  [[nodiscard]] int process_refusal() const { return process_refusal_; }
  /// The calling process enters them, and those that it starts from now on; also where /sys is not visible.
  void join();

  [[nodiscard]] bool out_of_memory() const;
  [[nodiscard]] bool too_many_processes() const;
  [[nodiscard]] std::optional<std::uint64_t> peak_octets() const;

  /// Removes the groups of owners that have ended.
  static void remove_abandoned();

 private:
  std::filesystem::path memory_;     ///< empty: none
  std::filesystem::path processes_;  ///< version 2: the same folder
  Fd memory_members_;
  Fd process_members_;
  int memory_refusal_ = 0;
  int process_refusal_ = 0;
};

}  // namespace srfs::update
