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
/// that count once come first, until they are carried out. An order without an answer is tried again in the
/// next slot; after longest_silence tries it gives way to the next, as one that the peripheral refuses, and
/// is tried again in the next round. Pure.
class StandingOrders {
 public:
  static constexpr int longest_silence = 3;

  /// Another mode: begins anew.
  void set(std::vector<StandingOrder> once, std::vector<StandingOrder> hold, nanoseconds repeat,
           MonotonicTime now);
  /// The peripheral was reset or lost its power: what is held is sent again at once.
  void on_peripheral_restarted(MonotonicTime now);

  /// What to send now; nullptr: nothing is due.
  [[nodiscard]] const StandingOrder* next(MonotonicTime now) const;
  void on_done(MonotonicTime now) { advance(Answer::done, now); }
  /// @param for_ever  it will never take it: an order that counts once is given up
  void on_refused(bool for_ever, MonotonicTime now) {
    advance(for_ever ? Answer::impossible : Answer::refused, now);
  }
  /// @return it gave way to the next one
  [[nodiscard]] bool on_silence(MonotonicTime now);

  /// Once after each set(): every order was answered, those that count once are carried out or given up.
  /// @return how many the peripheral carried out
  [[nodiscard]] std::optional<std::uint8_t> take_first_round();

 private:
  [[nodiscard]] std::size_t size() const { return once_.size() + hold_.size(); }
  [[nodiscard]] const StandingOrder& at(std::size_t index) const {
    return index < once_.size() ? once_[index] : hold_[index - once_.size()];
  }
  enum class Answer : std::uint8_t { done, refused, impossible };
  void advance(Answer answer, MonotonicTime now);
  void begin_round();

  std::vector<StandingOrder> once_;  ///< that are still to be carried out
  std::vector<StandingOrder> hold_;
  nanoseconds repeat_{0};
  std::size_t next_ = 0;  ///< size(): the round is over
  MonotonicTime again_;   ///< the next round begins
  int silent_ = 0;        ///< tries of the order at next_ without an answer
  std::uint8_t once_done_ = 0;
  std::uint8_t hold_done_ = 0;  ///< in this round
  bool unreported_ = false;     ///< since set()
  bool report_ = false;
};

}  // namespace srfs
