// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>
#include <cstdint>
#include <optional>

#include "base/time.hpp"

namespace srfs {

/// How old a telecommand may be on a strict link, where counters are UTC in milliseconds. Two clocks say what
/// time it is for the ground: the spacecraft's, and the newest accepted counter carried on by the monotonic
/// clock. A spacecraft's clock that is ahead of the second one by more than the lifetime is not believed: it
/// would refuse everything, also the telecommand that sets it. Pure.
class TelecommandAge {
 public:
  /// @param lifetime  nullopt: age is not judged
  /// @param utc_ms    of the spacecraft; nullopt: not valid
  void set(std::optional<milliseconds> lifetime, std::optional<std::uint64_t> utc_ms) {
    lifetime_ = lifetime;
    utc_ms_ = utc_ms;
  }
  void on_accepted(std::uint64_t counter, MonotonicTime now) {
    counted_ = std::max(counter, counted_at(now).value_or(0));
    counted_since_ = now;
  }
  /// A frame with a lower counter is too old; nullopt: none is.
  [[nodiscard]] std::optional<std::uint64_t> oldest(MonotonicTime now) const {
    if (!lifetime_) return std::nullopt;
    const auto lifetime = static_cast<std::uint64_t>(lifetime_->count());
    const auto counted = counted_at(now);
    const bool believed = utc_ms_ && (!counted || *utc_ms_ <= *counted + lifetime);
    const auto time = believed ? utc_ms_ : counted;
    if (!time) return std::nullopt;
    return *time > lifetime ? *time - lifetime : 0;
  }

 private:
  /// Never goes back, so that frames that are held back more and more do not hold it back.
  [[nodiscard]] std::optional<std::uint64_t> counted_at(MonotonicTime now) const {
    if (!counted_) return std::nullopt;
    return *counted_ + static_cast<std::uint64_t>((now - counted_since_) / milliseconds(1));
  }
  std::optional<milliseconds> lifetime_;
  std::optional<std::uint64_t> utc_ms_;
  std::optional<std::uint64_t> counted_;
  MonotonicTime counted_since_;
};

}  // namespace srfs
