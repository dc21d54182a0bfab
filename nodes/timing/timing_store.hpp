// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>

#include "base/state_file.hpp"
#include "nodes/timing/cycle_reservation.hpp"

namespace srfs {

/// The timing record on disk, in two files written in turn, so that one damaged file never loses the count.
/// Blocks on the disk: at start and in a worker thread only.
class TimingStore {
 public:
  explicit TimingStore(const std::filesystem::path& folder);

  /// The newest usable record; an empty one when there is none. A damaged file is taken for the newer one:
  /// the ceiling is raised by two reservations then, the most it can have been ahead.
  [[nodiscard]] TimingRecord load();
  [[nodiscard]] Result<void, FileError> save(const TimingRecord& record);

 private:
  StateFile<TimingRecord> file_;
};

}  // namespace srfs
