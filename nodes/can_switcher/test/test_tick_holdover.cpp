// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include <algorithm>
#include <optional>
#include <random>
#include <vector>

#include "nodes/can_switcher/tick_holdover.hpp"

namespace srfs {
namespace {

template <class Action>
std::optional<Action> part(const HoldoverActions& actions) {
  for (const HoldoverAction& action : actions) {
    if (const auto* const found = std::get_if<Action>(&action)) return *found;
  }
  return std::nullopt;
}

enum class Verdict : std::uint8_t {
  beat,
  repeated,  ///< not believed
  made,      ///< its beat was made already
};
struct Heard {
  Verdict verdict = Verdict::repeated;
  std::optional<ReportTicksBack> ended;
};
Heard hear(TickHoldover& holdover, const HeardTick& tick) {
  const std::uint32_t repeated_before = holdover.counters().repeated;
  const HoldoverActions actions = holdover.on_tick(tick);
  const bool is_repeated = holdover.counters().repeated > repeated_before;
  const auto beat = part<Beat>(actions);
  if (beat) {
    EXPECT_EQ(beat->received, tick.received);
    EXPECT_FALSE(beat->is_substitute);
  }
  return {beat          ? Verdict::beat
          : is_repeated ? Verdict::repeated
                        : Verdict::made,
          part<ReportTicksBack>(actions)};
}

enum class Substitute : std::uint8_t { not_due, beat, beat_in_outage };
Substitute substitute(TickHoldover& holdover, MonotonicTime now) {
  const HoldoverActions actions = holdover.on_deadline(now);
  const auto beat = part<Beat>(actions);
  if (!beat) {
    EXPECT_TRUE(actions.empty());
    return Substitute::not_due;
  }
  EXPECT_TRUE(beat->is_substitute);
  EXPECT_EQ(beat->received, now);
  const auto missing = part<ReportTicksMissing>(actions);
  if (missing) {
    EXPECT_EQ(missing->cycle, holdover.cycle());
    EXPECT_TRUE(std::holds_alternative<ReportTicksMissing>(actions.front()));
  }
  return missing ? Substitute::beat_in_outage : Substitute::beat;
}

constexpr nanoseconds period = milliseconds(100);
constexpr nanoseconds grace = milliseconds(25);

struct World {
  TickHoldover holdover;
  MonotonicTime now{seconds(10)};
  MissionCycle cycle = 500;

  /// A tick without delay. @param later time since the previous tick
  Verdict tick(nanoseconds later = period) { return late_tick(later, nanoseconds(0)).verdict; }
  Heard late_tick(nanoseconds later, nanoseconds late) {
    now += later;
    return hear(holdover, {.cycle = ++cycle, .due = now - late, .period = period, .received = now});
  }
  Verdict repeat(MissionCycle heard) {
    return hear(holdover, {.cycle = heard, .due = now, .period = period, .received = now}).verdict;
  }
  Substitute wait_for_substitute() {
    if (!holdover.next_substitute()) return Substitute::not_due;
    now = *holdover.next_substitute();
    return substitute(holdover, now);
  }
};
struct TickHoldoverTest : ::testing::Test, World {};

TEST_F(TickHoldoverTest, MakesNoTickBeforeItHeardOne) {
  EXPECT_FALSE(holdover.next_substitute());
  EXPECT_EQ(substitute(holdover, now + seconds(100)), Substitute::not_due);
  EXPECT_EQ(tick(), Verdict::beat);
  EXPECT_EQ(holdover.next_substitute(), now + period + grace);
}

TEST_F(TickHoldoverTest, GoesOnInTheSamePhaseWhileTicksAreMissing) {
  tick();
  const MonotonicTime last = now;
  EXPECT_EQ(substitute(holdover, last + period + grace - nanoseconds(1)), Substitute::not_due);
  EXPECT_EQ(wait_for_substitute(), Substitute::beat);
  EXPECT_EQ(now, last + period + grace);
  EXPECT_EQ(wait_for_substitute(), Substitute::beat_in_outage) << "two in a row are no late tick any more";
  EXPECT_EQ(now, last + 2 * period);
  EXPECT_EQ(wait_for_substitute(), Substitute::beat) << "told once";
  EXPECT_EQ(now, last + 3 * period);
  EXPECT_EQ(holdover.cycle(), cycle) << "a substitute has no number of its own";
  EXPECT_EQ(holdover.counters().substitutes, 3U);
  EXPECT_EQ(holdover.counters().outages, 1U);
}

TEST_F(TickHoldoverTest, ALateTickDoesNotBeatAgainAndIsNoOutage) {
  tick();
  const MonotonicTime due = now + period;
  EXPECT_EQ(wait_for_substitute(), Substitute::beat);
  const auto heard = late_tick(milliseconds(10), grace + milliseconds(10));
  EXPECT_EQ(heard.verdict, Verdict::made);
  EXPECT_FALSE(heard.ended);
  EXPECT_EQ(holdover.next_substitute(), due + period + grace) << "the phase is the tick's";
  now = due + period;
  EXPECT_EQ(tick(nanoseconds(0)), Verdict::beat);
}

TEST_F(TickHoldoverTest, TellsHowLongTheOutageWas) {
  tick();
  for (int i = 0; i < 5; ++i) (void)wait_for_substitute();
  cycle += 1000;  // a restarted timing node
  const auto heard = late_tick(period, nanoseconds(0));
  EXPECT_EQ(heard.verdict, Verdict::beat);
  ASSERT_TRUE(heard.ended);
  EXPECT_EQ(heard.ended->substitutes, 5U);
  EXPECT_EQ(heard.ended->lasted, 6 * period);
  EXPECT_EQ(holdover.next_substitute(), now + period + grace);
  EXPECT_EQ(holdover.counters().missed_cycles, 1000U);
}

TEST_F(TickHoldoverTest, AnotherPhaseAfterARestartMovesTheBeatWithoutADoubleOne) {
  for (const int shift_ms : {1, 20, 49, 50, 51, 80, 99}) {
    World world;
    world.tick();
    for (int i = 0; i < 3; ++i) (void)world.wait_for_substitute();
    const MonotonicTime last_beat = world.now;
    const bool soon = shift_ms < 50;
    EXPECT_EQ(world.tick(milliseconds(shift_ms)), soon ? Verdict::made : Verdict::beat) << shift_ms;
    if (soon) {
      EXPECT_EQ(world.tick(), Verdict::beat) << shift_ms;
    }
    EXPECT_GE(world.now - last_beat, period / 2) << shift_ms;
    EXPECT_LT(world.now - last_beat, period * 3 / 2) << shift_ms;
    EXPECT_EQ(world.tick(), Verdict::beat) << shift_ms << ": and on from there";
  }
}

TEST_F(TickHoldoverTest, AnotherPeriodAfterARestartIsKeptFromTheFirstTickOn) {
  tick();
  for (int i = 0; i < 3; ++i) (void)wait_for_substitute();
  now += period;
  const auto beat_at = [&](nanoseconds at) {
    now += at;
    return hear(holdover, {.cycle = ++cycle, .due = now, .period = milliseconds(20), .received = now})
        .verdict;
  };
  EXPECT_EQ(beat_at(nanoseconds(0)), Verdict::beat);
  EXPECT_EQ(beat_at(milliseconds(20)), Verdict::beat) << "faster ticks are not taken for repeated ones";
  EXPECT_EQ(holdover.next_substitute(), now + milliseconds(25));
}

TEST_F(TickHoldoverTest, ALongerPeriodBeginsWithTheTickThatSaysIt) {
  tick();
  now += period;
  EXPECT_EQ(hear(holdover, {.cycle = ++cycle, .due = now, .period = seconds(1), .received = now}).verdict,
            Verdict::beat);
  EXPECT_EQ(holdover.next_substitute(), now + milliseconds(1250));
}

TEST_F(TickHoldoverTest, RepeatedAndOlderTicksChangeNothing) {
  tick();
  const auto next = holdover.next_substitute();
  now += milliseconds(60);
  EXPECT_EQ(repeat(cycle), Verdict::repeated);
  EXPECT_EQ(repeat(cycle - 3), Verdict::repeated);
  EXPECT_EQ(holdover.next_substitute(), next);
  EXPECT_EQ(holdover.counters().repeated, 2U);
}

TEST_F(TickHoldoverTest, ASingleAbsurdTickNeitherBeatsNorMovesThePhase) {
  tick();
  const auto next = holdover.next_substitute();
  now += milliseconds(70);
  EXPECT_EQ(repeat(~MissionCycle{0}), Verdict::repeated);
  EXPECT_EQ(holdover.next_substitute(), next);
  EXPECT_EQ(tick(milliseconds(30)), Verdict::beat);
}

TEST_F(TickHoldoverTest, BelievesATimelineThatStartsAgainAfterItsSecondTickAlsoBetweenSubstitutes) {
  tick();
  (void)wait_for_substitute();
  (void)wait_for_substitute();
  cycle = 0;  // the timing node lost its count
  EXPECT_EQ(tick(milliseconds(90)), Verdict::repeated);
  EXPECT_EQ(wait_for_substitute(), Substitute::beat) << "until it is believed";
  EXPECT_EQ(tick(milliseconds(90)), Verdict::beat);
  EXPECT_EQ(holdover.cycle(), 2U);
}

TEST_F(TickHoldoverTest, OfANonsenseDueTimeTheReceiptCounts) {
  for (const MonotonicTime due : {MonotonicTime(seconds(0)), MonotonicTime(seconds(1'000'000))}) {
    now += period;
    EXPECT_EQ(hear(holdover, {.cycle = ++cycle, .due = due, .period = period, .received = now}).verdict,
              Verdict::beat);
    EXPECT_EQ(holdover.next_substitute(), now + period + grace);
  }
}

TEST_F(TickHoldoverTest, WithoutAPeriodItPassesTicksOnAndMakesNone) {
  for (const nanoseconds unknown : {nanoseconds(0), nanoseconds(seconds(61))}) {
    now += milliseconds(1);
    EXPECT_EQ(hear(holdover, {.cycle = ++cycle, .due = now, .period = unknown, .received = now}).verdict,
              Verdict::beat);
    EXPECT_FALSE(holdover.next_substitute());
  }
}

TEST_F(TickHoldoverTest, StopsWithATimingNodeThatWasStoppedOnPurposeUntilItTicksAgain) {
  tick();
  EXPECT_TRUE(holdover.stop(now + period + grace).empty()) << "no outage ends with it: none was told";
  EXPECT_FALSE(holdover.next_substitute());
  EXPECT_EQ(substitute(holdover, now + seconds(9)), Substitute::not_due);
  now += seconds(9);
  EXPECT_EQ(tick(), Verdict::beat);
  EXPECT_TRUE(holdover.next_substitute());

  (void)wait_for_substitute();
  (void)wait_for_substitute();
  const auto ended = part<ReportTicksBack>(holdover.stop(now));
  ASSERT_TRUE(ended);
  EXPECT_EQ(ended->substitutes, 2U);
}

TEST_F(TickHoldoverTest, RestsUntilTheFirstTickAfterAnActivation) {
  tick();
  holdover.rest();
  EXPECT_FALSE(holdover.next_substitute());
  EXPECT_EQ(tick(milliseconds(1)), Verdict::beat) << "no beat of before the rest is in its way";
}

TEST_F(TickHoldoverTest, OfWhatItSleptThroughItMakesOneTickAndKeepsThePhase) {
  tick();
  const MonotonicTime last = now;
  now += seconds(3) + milliseconds(40);
  EXPECT_EQ(substitute(holdover, now), Substitute::beat_in_outage);
  EXPECT_EQ(holdover.next_substitute(), last + seconds(3) + period);
}

/// A timing node that dies, hangs, is late, or returns with another phase or count.
struct UnreliableTiming {
  explicit UnreliableTiming(std::mt19937_64& random_) : random(random_) {}

  std::mt19937_64& random;
  MonotonicTime due{seconds(1)};  // of the next tick
  MonotonicTime arrives = due;
  MissionCycle cycle = 100;
  MissionCycle step = 1;

  std::int64_t between(std::int64_t low, std::int64_t high) {
    return low + static_cast<std::int64_t>(random() % static_cast<std::uint64_t>(high - low + 1));
  }
  HeardTick tick() {
    cycle += step;
    step = 1;
    return {.cycle = cycle, .due = due, .period = period, .received = arrives};
  }
  /// To the next tick. @return whether the count starts anew
  bool go_on() {
    due += period + microseconds(between(-1000, 1000));  // slewed
    switch (random() % 20) {
      case 0:  // killed: another phase, the count at its next reservation
        due += milliseconds(between(1, 2000));
        step = static_cast<MissionCycle>(between(1, 1000));
        arrives = due + microseconds(between(0, 1000));
        return false;
      case 1: {  // stopped: the same phase, but late
        const std::int64_t missed = between(0, 20);
        due += period * missed;
        step = static_cast<MissionCycle>(missed) + 1;
        arrives = due + milliseconds(between(0, 90));
        return false;
      }
      case 2:  // disk lost: the count starts anew
        due += milliseconds(between(1, 500));
        cycle = random() % 50;
        arrives = due;
        return true;
      default:
        arrives = due + microseconds(between(0, 1000));
        return false;
    }
  }
};

/// Ticks are repeated and forged, too. The beat stays regular.
TEST(TickHoldoverProperty, WhateverTimingDoesTheBeatNeitherStopsNorDoubles) {
  for (std::uint64_t seed = 1; seed <= 300; ++seed) {
    std::mt19937_64 random(seed);
    UnreliableTiming timing(random);
    TickHoldover holdover;
    std::vector<MonotonicTime> beats;
    const MonotonicTime end = timing.due + seconds(60);
    bool lost_count = false;

    while (timing.due < end) {
      const auto next = holdover.next_substitute();
      if (next && *next < timing.arrives) {
        // Up to a millisecond late, as on a loaded machine.
        const MonotonicTime at = std::min(*next + microseconds(timing.between(0, 1000)), timing.arrives);
        ASSERT_NE(substitute(holdover, at), Substitute::not_due);
        beats.push_back(at);
        continue;
      }
      const HeardTick tick = timing.tick();
      const Verdict verdict = hear(holdover, tick).verdict;
      if (verdict == Verdict::beat) beats.push_back(tick.received);
      ASSERT_TRUE(verdict != Verdict::repeated || lost_count) << "seed " << seed;
      lost_count = verdict == Verdict::repeated;  // accepted when the next tick continues the count
      if (random() % 10 == 0) {
        ASSERT_EQ(hear(holdover, tick).verdict, Verdict::repeated);
      }
      if (random() % 50 == 0) {
        HeardTick forged = tick;
        forged.cycle += 5'000'000;
        ASSERT_EQ(hear(holdover, forged).verdict, Verdict::repeated);
      }
      lost_count = timing.go_on() || lost_count;
    }

    ASSERT_GT(beats.size(), 500U);
    for (std::size_t i = 1; i < beats.size(); ++i) {
      const nanoseconds apart = beats[i] - beats[i - 1];
      // A real tick still beats when it is late by up to the grace; this widens both limits.
      ASSERT_GE(apart, period / 2 - grace - milliseconds(2)) << "seed " << seed << ", beat " << i;
      ASSERT_LE(apart, period * 3 / 2 + grace + milliseconds(2)) << "seed " << seed << ", beat " << i;
    }
    // Each restart shifts the phase forward by less than a period; no other time is lost.
    const double expected = static_cast<double>((beats.back() - beats.front()) / period);
    ASSERT_GT(static_cast<double>(beats.size()), 0.93 * expected) << "seed " << seed;
    ASSERT_LT(static_cast<double>(beats.size()), 1.07 * expected) << "seed " << seed;
  }
}

}  // namespace
}  // namespace srfs
