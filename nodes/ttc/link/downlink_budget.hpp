// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>

#include "base/time.hpp"

namespace srfs {

/// How much of stored packets and files may go down while a mode bounds it: a token bucket for each, of half
/// the rate, and what one has no room for goes to the other. So neither starves beside the other, however
/// much each takes at once. Live telemetry, the beacon and reports are not counted. Pure.
class DownlinkBudget {
 public:
  enum class Share : std::uint8_t { playback, files };
  /// What a share saves up at most: one batch, or one turn of files, must fit.
  static constexpr std::size_t capacity = 32U << 10U;

  /// @param octets_s  nullopt: no bound
  void set_rate(std::optional<std::uint32_t> octets_s, MonotonicTime now) {
    if (rate_ == octets_s) return;
    rate_ = octets_s;
    saved_ = {};
    at_ = now;
  }
  [[nodiscard]] std::size_t room(Share share, std::size_t wanted, MonotonicTime now) const {
    if (!rate_) return wanted;
    return std::min(wanted, static_cast<std::size_t>(std::max(saved_at(now)[index(share)], 0.0)));
  }
  void spend(Share share, std::size_t octets, MonotonicTime now) {
    if (!rate_) return;
    saved_ = saved_at(now);
    saved_[index(share)] -= static_cast<double>(octets);
    at_ = now;
  }

 private:
  using Saved = std::array<double, 2>;

  static constexpr std::size_t index(Share share) { return static_cast<std::size_t>(share); }
  [[nodiscard]] Saved saved_at(MonotonicTime now) const {
    constexpr auto most = static_cast<double>(capacity);
    const double each = std::chrono::duration<double>(now - at_).count() * static_cast<double>(*rate_) / 2;
    Saved saved{saved_[0] + each, saved_[1] + each};
    for (std::size_t i = 0; i < saved.size(); ++i) {
      const double over = saved[i] - most;
      if (over <= 0) continue;
      saved[i] = most;
      saved[1 - i] = std::min(saved[1 - i] + over, most);
    }
    return saved;
  }

  std::optional<std::uint32_t> rate_;
  Saved saved_{};
  MonotonicTime at_;
};

}  // namespace srfs
