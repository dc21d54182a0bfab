// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>

#include "base/file.hpp"
#include "base/result.hpp"
#include "wire/tm_frame.hpp"

namespace srfs {

/// Which TM frame counters are to be on disk: some frames ahead of those in use, so that a start that finds
/// no others (after a reset of the computer) uses none twice, and the ground misses so many frames at most.
/// True while the line sends no more than frames_ahead - frames_used frames between two writes.
class FrameCountReserve {
 public:
  static constexpr std::uint8_t frames_ahead = 128;
  /// Written anew after so many of them: on a line of 115200 baud about once a second, idle once in minutes.
  static constexpr std::uint8_t frames_used = 32;

  /// What is to be written now. @param next those of the next frames
  [[nodiscard]] std::optional<wire::TmFrameCounts> wanted(const wire::TmFrameCounts& next) const;
  void on_stored(const wire::TmFrameCounts& stored) { stored_ = stored; }

 private:
  std::optional<wire::TmFrameCounts> stored_;
};

/// The TM frame counters to go on with, in a file with CRC-32C that is written in place. Blocks on the disk:
/// start-up and worker thread only.
class FrameCountFile {
 public:
  explicit FrameCountFile(std::filesystem::path path) : path_(std::move(path)) {}
  /// nullopt: never written, or damaged.
  [[nodiscard]] std::optional<wire::TmFrameCounts> load() const;
  /// Returns when it is on the medium.
  [[nodiscard]] Result<void, FileError> store(const wire::TmFrameCounts& next) const;

 private:
  std::filesystem::path path_;
};

}  // namespace srfs
