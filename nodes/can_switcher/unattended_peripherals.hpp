// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <functional>
#include <string_view>
#include <vector>

#include "base/leaky_bucket.hpp"
#include "base/time.hpp"
#include "suite/peripheral.hpp"

namespace srfs {

/// Finds peripherals that babble unattended. A payload switches its own peripheral off, unless it has no
/// process. Without a process the peripheral gets no requests, so all it sends beyond the rest of an answer
/// is babble. Pure.
class UnattendedPeripherals {
 public:
  static constexpr std::uint32_t tolerated_frames = 64;            ///< at once
  static constexpr nanoseconds forgiven_every = milliseconds(50);  ///< one frame of them

  /// Where peripherals are now; what was heard of those that stay there counts on.
  void place(const std::vector<suite::Peripheral>& peripherals);
  void on_frame(std::uint32_t id, bool extended, MonotonicTime now);
  /// Those to be switched off now: too many frames since their payload was first found without a process, and
  /// it still is. @p attended is asked only about those that sent too many: whether the payload has a process
  [[nodiscard]] std::vector<suite::Peripheral> babbling(
      const std::function<bool(std::string_view payload)>& attended);

 private:
  struct Bucket {
    suite::Peripheral peripheral;
    LeakyBucket frames;
    bool unattended = false;  ///< when it was full the last time
  };
  std::vector<Bucket> buckets_;
};

}  // namespace srfs
