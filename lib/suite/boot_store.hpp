// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <optional>

#include "base/file.hpp"
#include "wire/boot_record.hpp"

namespace srfs::suite {

/// The boot record on disk: two copies, each replaced atomically, one after the other. Written by
/// timing alone, whose BootRecorder decides what stands in it. Blocks on the disk: at start, at the end and
/// in a worker thread only.
class BootStore {
 public:
  explicit BootStore(std::filesystem::path folder) : folder_(std::move(folder)) {}

  /// The newest usable copy; nullopt when there is none.
  [[nodiscard]] std::optional<wire::BootRecord> load() const;
  [[nodiscard]] Result<void, FileError> save(const wire::BootRecord& record) const;

 private:
  std::filesystem::path folder_;
};

}  // namespace srfs::suite
