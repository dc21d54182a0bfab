// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <optional>
#include <variant>

#include "base/action_queue.hpp"
#include "base/time.hpp"

namespace srfs {

/// A tick as it arrived.
struct HeardTick {
  MissionCycle cycle = 0;
  MonotonicTime due;      ///< as timing reports it; for a nonsense value, its receipt
  nanoseconds period{0};  ///< as timing says; out of range: not known, nothing is substituted
  MonotonicTime received;
};

// What the holdover decides; carried out by the adapter in the given order.

/// The next slot is due.
struct Beat {
  MonotonicTime received;      ///< when its tick arrived, or when a substitute took its place
  bool is_substitute = false;  ///< no tick was heard
};
/// It is certain that this is not just one late tick. Once for each outage, before its next Beat.
struct ReportTicksMissing {
  MissionCycle cycle = 0;  ///< heard last
};
/// The outage that was reported is over, by a tick or because timing was stopped on purpose.
struct ReportTicksBack {
  std::uint32_t substitutes = 0;
  nanoseconds lasted{0};  ///< from the last real tick on
};

using HoldoverAction = std::variant<Beat, ReportTicksMissing, ReportTicksBack>;
using HoldoverActions = ActionList<HoldoverAction, 2>;

/// The beat of the switching: timing's ticks, and while they stay away substitutes at their period and phase.
/// So a dead, stopped or late timing node costs no slot. It starts with a real tick only. A substitute has no
/// cycle number: the numbers are timing's alone, so none can collide when timing is back.
///
/// - Without a tick for a period and the grace, a substitute is made, then one a period, until a believed
///   tick arrives.
/// - A real tick that was due less than half a period after the last beat is that beat: it moves the phase,
///   and does not beat again (a substitute took its place, or timing came back in another phase).
/// - So two beats lie at least half a period apart, and at most one and a half plus the lateness of
///   their source.
///
/// Pure; one thread.
class TickHoldover {
 public:
  /// A Beat, unless the tick was heard before, is far from the numbers so far, or stands for a beat that was
  /// made already.
  [[nodiscard]] HoldoverActions on_tick(const HeardTick& tick);

  /// When the next substitute is due; nullopt: none will be made. To be armed after each call.
  [[nodiscard]] std::optional<MonotonicTime> next_substitute() const;
  /// A Beat when it is due. However late it is called, one at most: those before it were missed.
  [[nodiscard]] HoldoverActions on_deadline(MonotonicTime now);
  /// Timing was stopped on purpose: no substitutes until the next real tick.
  [[nodiscard]] HoldoverActions stop(MonotonicTime now);
  /// From the activation on: what was heard before counts for the numbers only.
  void rest();

  [[nodiscard]] MissionCycle cycle() const { return last_cycle_.value_or(0); }

  struct Counters {
    std::uint32_t ticks = 0;  ///< real ones that were believed
    std::uint32_t repeated = 0;
    std::uint32_t missed_cycles = 0;  ///< cycle numbers between two ticks that were never received
    std::uint32_t substitutes = 0;
    std::uint32_t made = 0;  ///< real ticks whose beat was made already
    std::uint32_t outages = 0;
  };
  [[nodiscard]] const Counters& counters() const { return counters_; }

  /// How much later than due a tick may be before a substitute takes its place.
  static nanoseconds grace(nanoseconds period);
  /// So long without a tick, and two periods at least, is an outage worth an event.
  static constexpr nanoseconds least_outage = milliseconds(100);
  static constexpr nanoseconds longest_period = seconds(60);

 private:
  /// A tick of the numbers heard so far. A cycle far ahead or behind is doubted (a forged or misdelivered
  /// tick must not stop the rotation), and believed when the next one goes on from there (timing lost its
  /// count).
  bool follows(MissionCycle cycle);
  [[nodiscard]] HoldoverActions end_outage(MonotonicTime at);
  static constexpr MissionCycle longest_gap = 1'000'000;

  nanoseconds period_{0};                   ///< 0: not known
  bool turning_ = false;                    ///< a tick was heard, and timing was not stopped since
  MonotonicTime phase_;                     ///< when the last tick, heard or made, was due
  std::optional<MonotonicTime> last_beat_;  ///< when it was due, of a substitute when it was made
  MonotonicTime last_real_;                 ///< when the last real tick was due
  std::uint32_t in_a_row_ = 0;              ///< substitutes since
  bool told_ = false;                       ///< this outage was reported
  std::optional<MissionCycle> last_cycle_;
  std::optional<MissionCycle> doubted_cycle_;
  Counters counters_;
};

}  // namespace srfs
