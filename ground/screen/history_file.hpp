// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "base/result.hpp"
#include "base/time.hpp"

namespace srfs::ground::screen {

/// The lines that were typed at the consoles of one folder, which share the file: each adds its lines under
/// a lock and gets those of the others. Bounds: LineEditor::history_max lines, octets_max octets; the oldest
/// are forgotten. The errors are ready to print. Blocks on the disk, and up to lock_patience on another
/// console.
class HistoryFile {
 public:
  static constexpr std::size_t octets_max = 1 << 20;
  static constexpr milliseconds lock_patience{500};

  explicit HistoryFile(std::filesystem::path file) : file_(std::move(file)) {}

  /// The oldest first.
  [[nodiscard]] Result<std::vector<std::string>, std::string> lines() const;
  /// @return the lines with this one, and with those that other consoles have added
  [[nodiscard]] Result<std::vector<std::string>, std::string> add(const std::string& line) const;

 private:
  std::filesystem::path file_;
};

}  // namespace srfs::ground::screen
