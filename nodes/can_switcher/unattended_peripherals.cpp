// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "nodes/can_switcher/unattended_peripherals.hpp"

namespace srfs {

void UnattendedPeripherals::on_frame(std::uint32_t id, bool extended, MonotonicTime now) {
  constexpr std::uint32_t to_computer = 0x18DA01;  // docs/reference/icd_can.md, section 1
  if (!extended || id >> 8U != to_computer) return;
  for (std::size_t i = 0; i < buckets_.size(); ++i) {
    if (hw::peripherals[i].can_address == (id & 0xFFU)) buckets_[i].frames.add(now, forgiven_every);
  }
}

std::vector<const hw::Peripheral*> UnattendedPeripherals::babbling(
    const std::function<bool(std::string_view payload)>& attended) {
  std::vector<const hw::Peripheral*> found;
  for (std::size_t i = 0; i < buckets_.size(); ++i) {
    Bucket& bucket = buckets_[i];
    if (bucket.frames.level() <= tolerated_frames) continue;
    bucket.frames.empty();
    // The first time the frames may be older than the end of the process: they count from here.
    const bool before = bucket.unattended;
    bucket.unattended = !attended(hw::peripherals[i].payload);
    if (before && bucket.unattended) found.push_back(&hw::peripherals[i]);
  }
  return found;
}

}  // namespace srfs
