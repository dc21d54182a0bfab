// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <optional>

#include "base/fd.hpp"
#include "base/file.hpp"
#include "base/result.hpp"
#include "nodes/ttc/link/link_state.hpp"

namespace srfs {

/// Two checksummed copies of the link state in one file. A write always goes to the copy that is not the
/// newest valid one, so that a write cut short leaves the other. Blocks on the disk: start-up and worker
/// thread only.
class LinkStateFile {
 public:
  explicit LinkStateFile(std::filesystem::path path) : path_(std::move(path)) {}

  struct Found {
    LinkState state;
    bool existed = false;  ///< a file was there
    unsigned damaged_copies = 0;
  };
  /// The newer undamaged copy; a state of generation 0 when there is none.
  [[nodiscard]] Found load();
  /// Returns when the copy is on the medium (fdatasync). @param state generation higher than any written
  /// before
  Result<void, FileError> store(const LinkState& state);

 private:
  Result<void, FileError> open_file();
  std::filesystem::path path_;
  Fd fd_;
  unsigned newest_slot_ = 1;  ///< holds the newest valid copy; the other one is written next
};

}  // namespace srfs
