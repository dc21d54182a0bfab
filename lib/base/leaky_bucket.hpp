// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>
#include <cstdint>

#include "base/time.hpp"

namespace srfs {

/// Counts what comes and forgives one at a steady pace: distinguishes an endless stream from a burst, in
/// memory that does not grow with it. Pure.
class LeakyBucket {
 public:
  void add(MonotonicTime now, nanoseconds forgiven_every) {
    if (level_ == 0) leaked_ = now;
    const std::int64_t forgiven = std::max<std::int64_t>(0, (now - leaked_) / forgiven_every);
    leaked_ += forgiven_every * forgiven;
    level_ -= static_cast<std::uint32_t>(std::min<std::int64_t>(level_, forgiven));
    ++level_;
  }
  [[nodiscard]] std::uint32_t level() const { return level_; }
  void empty() { level_ = 0; }

 private:
  std::uint32_t level_ = 0;
  MonotonicTime leaked_;
};

}  // namespace srfs
