// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <srfs_msgs/msg/payload_telemetry.hpp>
#include <srfs_msgs/msg/time_tick.hpp>

#include "base/octets.hpp"
#include "base/time.hpp"
#include "ros/time_message.hpp"

namespace srfs::suite {

/// What a node knows of the mission's time: the last tick, carried on by the monotonic clock.
class MissionTime {
 public:
  /// A tick from the far future is impossible and is ignored.
  void on_tick(const srfs_msgs::msg::TimeTick& tick) {
    constexpr std::uint64_t farthest_ns = 1ULL << 61;  // 73 years of uptime
    if (tick.monotonic_ns > farthest_ns || tick.utc.nanosec >= 1'000'000'000) return;
    tick_ = tick;
    known_ = true;
  }
  /// The epoch of UTC while no tick was heard.
  [[nodiscard]] UtcTime utc_at(MonotonicTime t) const {
    if (!known_) return UtcTime();
    return ros::from_message(tick_.utc) +
           (t - MonotonicTime(nanoseconds(static_cast<std::int64_t>(tick_.monotonic_ns))));
  }
  [[nodiscard]] bool valid() const { return known_ && tick_.time_valid; }
  [[nodiscard]] MissionCycle cycle() const { return tick_.cycle; }

 private:
  srfs_msgs::msg::TimeTick tick_;
  bool known_ = false;
};

/// A housekeeping structure of the mission dictionary, ready to publish.
template <class Structure>
[[nodiscard]] srfs_msgs::msg::PayloadTelemetry telemetry_message(const std::string& source,
                                                                 const Structure& structure,
                                                                 MissionCycle cycle, UtcTime utc,
                                                                 bool time_valid, MonotonicTime at) {
  srfs_msgs::msg::PayloadTelemetry m;
  m.source = source;
  m.apid = Structure::apid;
  m.structure_id = Structure::structure_id;
  m.cycle = cycle;
  m.utc = ros::to_message(utc);
  m.time_valid = time_valid;
  m.monotonic_ns = static_cast<std::uint64_t>(at.ns());
  m.data = structure.encoded();
  return m;
}

}  // namespace srfs::suite
