// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>

#include "base/time.hpp"

namespace srfs {

/// Keeps the octets waiting in the serial driver few, so that what is urgent never stands behind what is not:
/// a model of the line that drains at its rate (8N1: ten bits an octet).
class LinePacer {
 public:
  /// @param baud bits per second. @param backlog_limit octets in flight below which more may be written
  LinePacer(std::uint32_t baud, std::size_t backlog_limit)
      : octet_time_ns_(10e9 / static_cast<double>(baud)), backlog_limit_(backlog_limit) {}

  void on_written(std::size_t octets, MonotonicTime now) {
    if (empty_at_ < now) empty_at_ = now;
    empty_at_ += duration_of(octets);
  }
  /// Octets that the line has not sent yet, as far as the model knows.
  [[nodiscard]] std::size_t backlog(MonotonicTime now) const {
    if (empty_at_ <= now) return 0;
    return static_cast<std::size_t>(static_cast<double>((empty_at_ - now).count()) / octet_time_ns_);
  }
  [[nodiscard]] bool has_room(MonotonicTime now) const { return now >= room_at(); }
  /// When has_room() turns true.
  [[nodiscard]] MonotonicTime room_at() const { return empty_at_ - duration_of(backlog_limit_); }

 private:
  [[nodiscard]] nanoseconds duration_of(std::size_t octets) const {
    return nanoseconds(static_cast<std::int64_t>(static_cast<double>(octets) * octet_time_ns_));
  }
  double octet_time_ns_;
  std::size_t backlog_limit_;
  MonotonicTime empty_at_;
};

}  // namespace srfs
