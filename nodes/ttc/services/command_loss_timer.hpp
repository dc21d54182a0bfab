// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>
#include <cstdint>
#include <optional>
#include <string>
#include <string_view>

#include <mission/structures.hpp>

#include "base/time.hpp"

namespace srfs {

using mission::CommandLossStep;

/// Acts when no authenticated telecommand comes for a time: what keeps the ground from commanding may be on
/// board. First mode safe, then, for ever, in each restart_period(): receiver and line opened anew, the other
/// set of keys, restart of the computer, step_period() between two of them.
///
/// The time counts the life of the computer: it goes on across restarts of ttc and resets, less what passed
/// since the last record (a minute at most, half of a short life) and while the computer was off. So boot
/// loops neither reset nor shorten it, and a step of the clock means nothing. After a kill behind a
/// telecommand it may act a minute early. Pure.
class CommandLossTimer {
 public:
  static constexpr seconds longest_save_period{60};
  static constexpr seconds shortest_save_period{5};

  struct Step {
    CommandLossStep what = CommandLossStep::safe_mode;
    std::uint32_t number = 1;  ///< counted since the last telecommand
    nanoseconds silent{0};     ///< time without a telecommand
    nanoseconds until_next{0};
  };
  struct Loss {
    nanoseconds silent{0};
    std::uint32_t steps = 0;
  };

  /// @param boot_id of the kernel  @param stored  stored_text() of an earlier process; missing or damaged:
  /// the time begins anew  @param patience  time without a telecommand until the first step
  CommandLossTimer(std::string boot_id, std::string_view stored, seconds patience, MonotonicTime now);

  void set_patience(seconds patience) { patience_ = patience; }
  /// An authenticated telecommand came. @return the loss that it ends; nullopt: no step was taken
  std::optional<Loss> on_contact(MonotonicTime now);
  /// The step that is due; it counts as taken. To be carried out once stored_text() is on disk.
  [[nodiscard]] std::optional<Step> take_step(MonotonicTime now);
  /// Steps were taken since the last telecommand.
  [[nodiscard]] bool lost() const { return steps_ > 0; }

  /// What makes it last.
  [[nodiscard]] std::string stored_text(MonotonicTime now) const;
  /// Once when it is to be stored.
  [[nodiscard]] bool take_save(MonotonicTime now);

  [[nodiscard]] nanoseconds until_next(MonotonicTime now) const;
  [[nodiscard]] MonotonicTime next_due(MonotonicTime now) const {
    return std::min(now + until_next(now), next_save_);
  }
  [[nodiscard]] CommandLossStep next_step() const;
  /// Between two steps: an hour, less when the patience is short.
  [[nodiscard]] seconds step_period() const {
    return std::clamp<seconds>(patience_ / 4, seconds(1), std::chrono::hours(1));
  }
  /// Between two restarts of the computer: a day, less when the patience is short.
  [[nodiscard]] seconds restart_period() const {
    return std::clamp<seconds>(patience_, seconds(4), std::chrono::hours(24));
  }

 private:
  [[nodiscard]] nanoseconds silent(MonotonicTime now) const { return before_ + (now - begun_); }
  [[nodiscard]] nanoseconds next_step_at() const;  ///< as a time of silence
  void plan_save(MonotonicTime now);

  std::string boot_id_;
  seconds patience_;
  MonotonicTime begun_;    ///< of counting in this process, or last contact
  nanoseconds before_{0};  ///< counted before that
  std::uint32_t steps_ = 0;
  nanoseconds last_step_{0};  ///< time of silence at it
  MonotonicTime process_begun_;
  nanoseconds saved_{0};  ///< time of silence in the last record
  MonotonicTime next_save_;
};

}  // namespace srfs
