// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <optional>

#include "base/time.hpp"

namespace srfs {

/// How much of stored packets and files may go down while a mode bounds it (token bucket). Live telemetry,
/// the beacon and reports are not counted. Pure.
class DownlinkBudget {
 public:
  /// What is saved up at most: one batch must fit.
  static constexpr std::size_t capacity = 64U << 10U;

  /// @param octets_s  nullopt: no bound
  void set_rate(std::optional<std::uint32_t> octets_s, MonotonicTime now) {
    if (rate_ == octets_s) return;
    rate_ = octets_s;
    saved_ = 0;
    at_ = now;
  }
  [[nodiscard]] std::size_t room(std::size_t wanted, MonotonicTime now) const {
    if (!rate_) return wanted;
    return std::min(wanted, static_cast<std::size_t>(std::max(saved_at(now), 0.0)));
  }
  void spend(std::size_t octets, MonotonicTime now) {
    if (!rate_) return;
    saved_ = saved_at(now) - static_cast<double>(octets);
    at_ = now;
  }

 private:
  [[nodiscard]] double saved_at(MonotonicTime now) const {
    const double elapsed_s = std::chrono::duration<double>(now - at_).count();
    return std::min(saved_ + elapsed_s * static_cast<double>(*rate_), static_cast<double>(capacity));
  }

  std::optional<std::uint32_t> rate_;
  double saved_ = 0;
  MonotonicTime at_;
};

}  // namespace srfs
