// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <vector>

namespace srfs {

/// What is known of a stored frame, in the order in which frames make room (lib/image/file/frame_mark.hpp).
enum class FrameStanding : std::uint8_t {
  sent,      ///< its detections, or all of it, are on the ground
  nothing,   ///< processed, nothing found
  unmarked,  ///< not processed
  detected,  ///< with a detection that was not sent: never removed
};

struct StoredFrame {
  std::uint32_t task = 0;
  std::uint16_t number = 0;  ///< from 1
  std::uint64_t octets = 0;
  FrameStanding standing = FrameStanding::unmarked;  ///< when it was last checked
};

/// Chooses what to remove for a new frame: by standing, and of one standing the oldest first. Never frames
/// with a detection that was not sent, nor those of the task under way.
/// @param frames oldest first; @param quota octets of all together; @param needed octets of the new one
/// @return indices in order of removal, maybe none; nullopt: so much room may not be made, nothing goes
[[nodiscard]] std::optional<std::vector<std::size_t>> frames_to_remove(std::span<const StoredFrame> frames,
                                                                       std::uint64_t quota,
                                                                       std::uint64_t needed,
                                                                       std::uint32_t task_under_way);

}  // namespace srfs
