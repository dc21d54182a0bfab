// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "nodes/can_switcher/unattended_peripherals.hpp"

#include <algorithm>
#include <utility>

namespace srfs {

void UnattendedPeripherals::place(const std::vector<suite::Peripheral>& peripherals) {
  std::vector<Bucket> placed;
  for (const suite::Peripheral& peripheral : peripherals) {
    const auto known = std::find_if(buckets_.begin(), buckets_.end(),
                                    [&](const Bucket& bucket) { return bucket.peripheral == peripheral; });
    placed.push_back(known != buckets_.end() ? std::move(*known) : Bucket{peripheral, {}, false});
  }
  buckets_ = std::move(placed);
}

void UnattendedPeripherals::on_frame(std::uint32_t id, bool extended, MonotonicTime now) {
  for (Bucket& bucket : buckets_) {
    if (bucket.peripheral.sends(id, extended)) bucket.frames.add(now, forgiven_every);
  }
}

std::vector<suite::Peripheral> UnattendedPeripherals::babbling(
    const std::function<bool(std::string_view payload)>& attended) {
  std::vector<suite::Peripheral> found;
  for (Bucket& bucket : buckets_) {
    if (bucket.frames.level() <= tolerated_frames) continue;
    bucket.frames.empty();
    // The first time the frames may be older than the end of the process: they count from here.
    const bool before = bucket.unattended;
    bucket.unattended = !attended(bucket.peripheral.payload);
    if (before && bucket.unattended) found.push_back(bucket.peripheral);
  }
  return found;
}

}  // namespace srfs
