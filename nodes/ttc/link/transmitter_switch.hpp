// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>
#include <string>
#include <string_view>

#include "base/time.hpp"

namespace srfs {

/// Whether the downlink may transmit. Silence is commanded for a time and ends by itself, in every case: a
/// restart of the node goes on with it, one of the computer lets its whole time run anew, but only once, and
/// a record that is missing or damaged means that there is none. Pure.
class TransmitterSwitch {
 public:
  /// From the command to the silence: the end of the command still goes down.
  static constexpr seconds grace{2};
  static constexpr seconds longest{86'400};

  /// @param boot_id of the kernel  @param stored  stored_text() of an earlier process, or empty
  TransmitterSwitch(std::string boot_id, std::string_view stored, MonotonicTime now);

  /// @param duration  1 s to longest, from the end of the grace on; replaces a silence there is
  void switch_off(seconds duration, MonotonicTime now);
  void switch_on() { silence_.reset(); }

  [[nodiscard]] bool may_transmit(MonotonicTime now) const {
    return !silence_ || now < silence_->from || now >= silence_->until;
  }
  /// Rest of the silence, its grace included; zero: none.
  [[nodiscard]] nanoseconds rest(MonotonicTime now) const;
  /// When may_transmit() changes next.
  [[nodiscard]] std::optional<MonotonicTime> next_due(MonotonicTime now) const;
  /// @return once, when the silence is over
  [[nodiscard]] bool take_end(MonotonicTime now);
  /// What makes it last; empty: no silence.
  [[nodiscard]] std::string stored_text() const;

 private:
  struct Silence {
    MonotonicTime from;
    MonotonicTime until;
    seconds duration;
    bool renewed = false;  ///< begun anew by a start of the computer
  };

  std::string boot_id_;
  std::optional<Silence> silence_;
};

}  // namespace srfs
