// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <optional>
#include <utility>
#include <vector>

#include <mission/structures.hpp>

#include "base/time.hpp"
#include "nodes/ttc/command/telecommand.hpp"

namespace srfs {

/// Names one telecommand with its arguments.
struct HazardName {
  std::uint16_t apid = 0;
  std::uint8_t service = 0;
  std::uint8_t subtype = 0;
  std::uint32_t digest = 0;  ///< CRC-32C of the packet data behind the secondary header
  friend bool operator==(const HazardName&, const HazardName&) = default;
};

[[nodiscard]] HazardName hazard_name(const Telecommand& telecommand);

/// Something was armed, or (with a reason) is armed no more.
struct HazardNews {
  HazardName name;
  std::optional<mission::DisarmReason> reason;
};

/// A hazardous telecommand runs only if it was armed: one at a time, for a while, once. What is armed is
/// nowhere on disk, so a restart disarms. Pure; one thread.
class HazardGuard {
 public:
  explicit HazardGuard(milliseconds window) : window_(window) {}

  /// Replaces what was armed before.
  void arm(const HazardName& name, MonotonicTime now);
  void disarm(mission::DisarmReason reason);
  [[nodiscard]] bool is_armed(const HazardName& name, MonotonicTime now) const;
  /// Ends the arming when its window is over.
  void on_time(MonotonicTime now);
  [[nodiscard]] std::optional<MonotonicTime> next_due() const;

  [[nodiscard]] milliseconds window() const { return window_; }
  /// Since the last call; at most two for each telecommand, and one for a window that ended.
  [[nodiscard]] std::vector<HazardNews> take_news() { return std::exchange(news_, {}); }

 private:
  struct Armed {
    HazardName name;
    MonotonicTime until;
  };
  milliseconds window_;
  std::optional<Armed> armed_;
  std::vector<HazardNews> news_;
};

}  // namespace srfs
