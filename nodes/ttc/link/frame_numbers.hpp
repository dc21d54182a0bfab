// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>

#include "base/state_file.hpp"
#include "base/time.hpp"

namespace srfs {

/// The sequence numbers of sealed TM frames (ICD 3.4): each higher than all before, over every restart. An
/// odd one is the spacecraft's clock, twice the milliseconds of UTC since 1970 and one; the ground may judge
/// its age. An even one says nothing about the time: the clock is not valid, or the numbers are ahead of it.
///
/// Numbers are used below a reserve that is on the disk: a start that finds nothing else goes on from there.
/// A clock that jumps ahead is followed when the reserve is. Only while the disk takes nothing are numbers
/// beyond it used: telemetry that is sent counts more. Pure.
class FrameNumbers {
 public:
  /// Of the clock: a minute.
  static constexpr std::uint64_t reserved_ahead = 120'000;
  /// Numbers so much ahead of the clock still are the clock: of frames in one millisecond.
  static constexpr std::uint64_t clock_slack = 2'000;

  /// @param first  first_frame_number(). @param reserved  below it numbers may be used; what is on the disk
  explicit FrameNumbers(std::uint64_t first = 0, std::uint64_t reserved = 0)
      : next_(first), reserved_(reserved) {}

  /// The number of the next frame. @param utc  nullopt: not valid
  [[nodiscard]] std::uint64_t take(std::optional<UtcTime> utc);
  /// No number below it is used from now on.
  [[nodiscard]] std::uint64_t next() const { return next_; }
  /// What is to be on the disk now; nullopt: what is there will do for half a minute.
  [[nodiscard]] std::optional<std::uint64_t> wanted(std::optional<UtcTime> utc) const;
  void on_reserved(std::uint64_t reserved) { reserved_ = reserved; }

 private:
  std::uint64_t next_;
  std::uint64_t reserved_;
};

/// The odd number of a time.
[[nodiscard]] std::uint64_t frame_number_of(UtcTime utc);

/// The first number of a start.
/// @param in_memory  FrameNumbers::next() of the process before, in the same run of the suite; nullopt: none
/// @param reserved   what is on the disk; nullopt: nothing, or it is damaged
/// @param clock      the computer's, valid or not: used when nothing else is known
[[nodiscard]] std::uint64_t first_frame_number(std::optional<std::uint64_t> in_memory,
                                               std::optional<std::uint64_t> reserved, UtcTime clock);

/// The reserve, in @p path with .0 and .1 behind it.
[[nodiscard]] StateFile<std::uint64_t> frame_number_file(const std::filesystem::path& path);

}  // namespace srfs
