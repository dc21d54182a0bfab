// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "nodes/image_acquisition/frame_removal.hpp"

#include <array>

namespace srfs {

std::optional<std::vector<std::size_t>> frames_to_remove(std::span<const StoredFrame> frames,
                                                         std::uint64_t quota, std::uint64_t needed,
                                                         std::uint32_t task_under_way) {
  using enum FrameStanding;
  constexpr std::array removable{sent, nothing, unmarked};
  if (needed > quota) return std::nullopt;
  std::uint64_t used = 0;
  for (const StoredFrame& frame : frames) used += frame.octets;
  std::vector<std::size_t> removed;
  for (const FrameStanding standing : removable) {
    for (std::size_t i = 0; i < frames.size() && used > quota - needed; ++i) {
      if (frames[i].standing != standing || frames[i].task == task_under_way) continue;
      removed.push_back(i);
      used -= frames[i].octets;
    }
  }
  if (used > quota - needed) return std::nullopt;
  return removed;
}

}  // namespace srfs
