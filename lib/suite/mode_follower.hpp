// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <utility>

#include "base/time.hpp"
#include "suite/modes.hpp"

namespace srfs::suite {

/// One sample of /mode.
struct HeardMode {
  std::uint8_t number = 0;
  std::string name;
  std::uint32_t change = 0;
  std::string reason;
  MonotonicTime sent;
};

/// The mode that a node obeys.
struct ModeInForce {
  std::uint8_t number = 0;
  std::string name;
  std::uint32_t change = 0;
  bool by_itself = false;  ///< nobody said so: /mode is silent or damaged
  std::string reason;
};

/// Which mode a node obeys, from what it hears on /mode. Before the first sample it obeys none, for the time
/// of silence at most. Silence, and a sample that cannot be true, mean safe until the next good sample. Pure.
class ModeFollower {
 public:
  ModeFollower(ModeSettings settings, MonotonicTime now) : settings_(std::move(settings)), heard_(now) {}

  // Each returns whether in_force() is another one now.
  bool on_mode(const HeardMode& mode, MonotonicTime now);
  bool on_time(MonotonicTime now);

  [[nodiscard]] const std::optional<ModeInForce>& in_force() const { return in_force_; }
  [[nodiscard]] MonotonicTime next_due() const { return heard_ + settings_.silence; }
  [[nodiscard]] std::uint32_t damaged() const { return damaged_; }

 private:
  /// Empty: it can be true.
  [[nodiscard]] std::string why_impossible(const HeardMode& mode, MonotonicTime now) const;
  bool go_safe(std::string reason);

  ModeSettings settings_;
  MonotonicTime heard_;  ///< last good sample
  std::optional<ModeInForce> in_force_;
  std::uint32_t damaged_ = 0;
};

}  // namespace srfs::suite
