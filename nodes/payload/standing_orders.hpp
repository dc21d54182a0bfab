// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "base/octets.hpp"
#include "base/time.hpp"

namespace srfs {

/// One order of the mode for the peripheral.
struct StandingOrder {
  std::uint8_t function = 0;
  Octets arguments;
  std::string text;  ///< as the deployment has it

  friend bool operator==(const StandingOrder&, const StandingOrder&) = default;
};

/// What the mode holds a peripheral to: a level. Orders go out one after the other; when all were answered
/// they go out again after the repeat time, or at once when the peripheral may have forgotten them. Orders
/// that count once come before the first round. An order without an answer is tried again in the next slot;
/// one that the peripheral refuses gives way to the next, and is tried again in the next round. Pure.
class StandingOrders {
 public:
  /// Another mode: begins anew. The same orders go on where they are.
  void set(std::vector<StandingOrder> once, std::vector<StandingOrder> hold, nanoseconds repeat,
           MonotonicTime now);
  /// The peripheral was reset or lost its power: what is held is sent again at once.
  void on_peripheral_restarted(MonotonicTime now);

  /// What to send now; nullptr: nothing is due.
  [[nodiscard]] const StandingOrder* next(MonotonicTime now) const;
  void on_done(MonotonicTime now) { advance(true, now); }
  void on_refused(MonotonicTime now) { advance(false, now); }

  /// Once after each set(): every order was answered. @return how many the peripheral carried out
  [[nodiscard]] std::optional<std::uint8_t> take_first_round();

 private:
  [[nodiscard]] std::size_t size() const { return once_.size() + hold_.size(); }
  [[nodiscard]] const StandingOrder& at(std::size_t index) const {
    return index < once_.size() ? once_[index] : hold_[index - once_.size()];
  }
  void advance(bool done, MonotonicTime now);

  std::vector<StandingOrder> once_;
  std::vector<StandingOrder> hold_;
  nanoseconds repeat_{0};
  std::size_t next_ = 0;      ///< size(): the round is over
  MonotonicTime again_;       ///< the next round begins
  std::uint8_t done_ = 0;     ///< in the first round
  bool first_round_ = false;  ///< under way
  bool report_ = false;
};

}  // namespace srfs
