// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <sys/types.h>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <optional>
#include <string>

#include "base/result.hpp"
#include "wire/tm_frame.hpp"

namespace srfs {

/// The TM frame counters in use, in one word.
[[nodiscard]] std::uint64_t pack_frame_counts(const wire::TmFrameCounts& counts);
/// nullopt: not such a word.
[[nodiscard]] std::optional<wire::TmFrameCounts> unpack_frame_counts(std::uint64_t word);

/// The TM frame counters, and the numbers of sealed frames, in two words of shared memory that outlives the
/// process: its successor goes on with them, and the ground sees no false gap. A store costs no system call
/// and nothing is written to a disk. It ends with the suite and with the computer; then the FrameCountFile
/// and frame_number_file() count.
class FrameCountPage {
 public:
  /// @param file in a private folder (open_private). @param owner whose folder root takes, too
  [[nodiscard]] static Result<FrameCountPage, std::string> open(const std::filesystem::path& file,
                                                                std::optional<uid_t> owner);
  void write(const wire::TmFrameCounts& next);
  /// nullopt: nothing was written since the suite started.
  [[nodiscard]] std::optional<wire::TmFrameCounts> read() const;
  /// FrameNumbers::next(). Before the frame leaves: then a kill at any instruction leaves none that was used.
  void write_number(std::uint64_t next);
  [[nodiscard]] std::optional<std::uint64_t> read_number() const;

 private:
  struct Words {
    std::uint64_t counts;
    std::uint64_t number;
  };
  struct Unmap {
    void operator()(Words* words) const;
  };
  explicit FrameCountPage(Words* words) : words_(words) {}
  std::unique_ptr<Words, Unmap> words_;
};

}  // namespace srfs
