// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <random>

#include <mission/structures.hpp>

#include "nodes/timing/mission_clock.hpp"
#include "nodes/timing/time_discipline.hpp"

namespace srfs {
namespace {

constexpr MonotonicTime start{seconds(50)};
constexpr UtcTime stored{seconds(1'780'000'000)};
constexpr std::int64_t gps_second = 1'795'248'000;

struct Fixture {
  MissionClock clock{stored, start};
  TimeDiscipline time{
      {}, ClockStart{.utc = stored, .valid = false, .error = {}, .drift_ppm = {}}, start, clock};
  std::int64_t n = 0;

  [[nodiscard]] static MonotonicTime edge(std::int64_t pulse) {
    return start + milliseconds(300) + seconds(pulse);
  }
  void pulse() { time.on_pulse(edge(n), edge(n)); }
  TimeOfDayVerdict named(nanoseconds off) {
    return time.on_time_of_day({.fix_valid = true, .utc = UtcTime(seconds(gps_second + n) + off)},
                               edge(n) + milliseconds(100));
  }
  void run(int seconds_, nanoseconds off = nanoseconds(0)) {
    for (int i = 0; i < seconds_; ++i, ++n) {
      pulse();
      named(off);
      time.on_time_passing(edge(n) + milliseconds(500));
    }
  }
};

TEST(TimeDiscipline, TelemetryTellsAnErrorThatIsNotKnownFromAVeryLargeOne) {
  Fixture f;
  EXPECT_TRUE(std::isnan(telemetered_error_us(f.time.error_at(start)))) << "the time is not valid";
  f.run(10);
  EXPECT_LT(telemetered_error_us(f.time.error_at(f.edge(9))), 1e6F);
  EXPECT_FLOAT_EQ(telemetered_error_us(microseconds(15)), 15);
  EXPECT_FLOAT_EQ(telemetered_error_us(largest_error), 1e9F);
  EXPECT_FLOAT_EQ(telemetered_error_us(10 * largest_error), 1e9F);
}

TEST(TimeDiscipline, StepsOnceToTheFirstTimeItIsTold) {
  Fixture f;
  f.run(10);
  EXPECT_TRUE(f.time.pulse_clock().time_valid());
  EXPECT_EQ(f.time.utc_at(f.edge(9)), UtcTime(seconds(gps_second + 9)));
}

TEST(TimeDiscipline, SlewsASecondTheReceiverInsistsOn) {
  Fixture f;
  f.run(10);
  f.run(10, -seconds(1));  // as after a leap second
  UtcTime shown = f.time.utc_at(f.edge(f.n));
  EXPECT_GT(*f.time.error_at(f.edge(f.n)), milliseconds(900)) << "it is still a second off, and says so";
  for (int i = 0; i < 210; ++i) {
    f.run(1, -seconds(1));
    const UtcTime next = f.time.utc_at(f.edge(f.n));
    EXPECT_GE(next - shown, milliseconds(994));
    EXPECT_LE(next - shown, milliseconds(1006));
    shown = next;
  }
  EXPECT_EQ(shown, UtcTime(seconds(gps_second + f.n - 1)));
  EXPECT_LT(*f.time.error_at(f.edge(f.n)), microseconds(100));
}

TEST(TimeDiscipline, BelievesNoMessageWithoutAFixOrBesideTheSecond) {
  Fixture f;
  f.pulse();
  const MonotonicTime at = f.edge(0) + milliseconds(100);
  const UtcTime second{seconds(gps_second)};
  EXPECT_EQ(f.time.on_time_of_day({.fix_valid = false, .utc = second}, at), TimeOfDayVerdict::not_a_second);
  EXPECT_EQ(f.time.on_time_of_day({.fix_valid = true, .utc = {}}, at), TimeOfDayVerdict::not_a_second);
  EXPECT_EQ(f.time.on_time_of_day({.fix_valid = true, .utc = second + milliseconds(200)}, at),
            TimeOfDayVerdict::not_a_second);
  EXPECT_EQ(f.time.on_time_of_day({.fix_valid = true, .utc = second}, at), TimeOfDayVerdict::waiting);
}

TEST(TimeDiscipline, ACommandSetsAnInvalidTime) {
  Fixture f;
  const MonotonicTime now = start + seconds(1);
  EXPECT_EQ(f.time.set_time({UtcTime(seconds(gps_second)), now, seconds(1), false}, now),
            SetTimeVerdict::stepped);
  EXPECT_TRUE(f.time.pulse_clock().time_valid());
  EXPECT_EQ(f.time.utc_at(now + seconds(2)), UtcTime(seconds(gps_second + 2)));
  EXPECT_GE(*f.time.error_at(now), seconds(1));
}

TEST(TimeDiscipline, ACommandStepsAValidTimeOnlyWhenAJumpIsAllowed) {
  Fixture f;
  f.run(10);
  const MonotonicTime now = f.edge(9) + milliseconds(600);
  const UtcTime before = f.time.utc_at(now);

  const TimeCommand far{before + seconds(1000), now, milliseconds(1), false};
  EXPECT_EQ(f.time.set_time(far, now), SetTimeVerdict::jump_refused);
  EXPECT_EQ(f.time.commanded_difference(), seconds(1000));
  EXPECT_EQ(f.time.utc_at(now), before);

  EXPECT_EQ(f.time.set_time({before + seconds(1), now, milliseconds(1), false}, now), SetTimeVerdict::slewed);
  EXPECT_EQ(f.time.utc_at(now), before);

  EXPECT_EQ(f.time.set_time({before - seconds(1000), now, milliseconds(1), true}, now),
            SetTimeVerdict::stepped);
  EXPECT_EQ(f.time.utc_at(now), before - seconds(1000));
}

TEST(TimeDiscipline, AReceiverThatContradictsTheOperatorIsRefused) {
  Fixture f;
  f.run(10);
  const MonotonicTime now = f.edge(9) + milliseconds(600);
  ASSERT_EQ(f.time.set_time({f.time.utc_at(now) + seconds(1000), now, nanoseconds(0), true}, now),
            SetTimeVerdict::stepped);
  f.pulse();
  EXPECT_EQ(f.named(nanoseconds(0)), TimeOfDayVerdict::jump_refused);
}

TEST(TimeDiscipline, RefusesACommandThatNamesNoTimeOrAnInstantLongGone) {
  Fixture f;
  const MonotonicTime now = start + seconds(500);
  const UtcTime good{seconds(gps_second)};
  EXPECT_EQ(f.time.set_time({UtcTime(seconds(0)), now, {}, true}, now), SetTimeVerdict::implausible);
  EXPECT_EQ(f.time.set_time({UtcTime(nanoseconds::max()), now, {}, true}, now), SetTimeVerdict::implausible);
  EXPECT_EQ(f.time.set_time({good, now - seconds(61), {}, true}, now), SetTimeVerdict::implausible);
  EXPECT_EQ(f.time.set_time({good, now + seconds(61), {}, true}, now), SetTimeVerdict::implausible);
  EXPECT_EQ(f.time.set_time({good, now, nanoseconds(-1), true}, now), SetTimeVerdict::implausible);
  EXPECT_FALSE(f.time.pulse_clock().time_valid());
}

TEST(TimeDiscipline, APulseFindsTheSecondAgainAfterATimeSetInHoldover) {
  Fixture f;
  f.run(40);
  f.n += 10;
  const MonotonicTime now = f.edge(f.n - 5) + milliseconds(250);
  f.time.on_time_passing(now);
  ASSERT_EQ(f.time.pulse_clock().state(), mission::SyncState::holdover);
  const UtcTime commanded = f.time.utc_at(now) + seconds(500) + milliseconds(120);
  ASSERT_EQ(f.time.set_time({commanded, now, milliseconds(200), true}, now), SetTimeVerdict::stepped);
  f.pulse();
  f.time.on_time_passing(f.edge(f.n) + seconds(30));
  EXPECT_EQ(f.time.utc_at(f.edge(f.n) + seconds(30)), UtcTime(seconds(gps_second + f.n + 530)));
}

// ---------------------------------------------------------------- arbitrary input

/// @param train_phase  of a pulse train that may be right or wrong
void give_anything(TimeDiscipline& time, std::mt19937_64& random, MonotonicTime now,
                   nanoseconds& train_phase) {
  const auto below = [&](std::uint64_t n) { return static_cast<std::int64_t>(random() % n); };
  switch (below(12)) {
    case 0:  // an edge at any time
      time.on_pulse(now - nanoseconds(below(3'000'000'000)), now);
      break;
    case 1:
      train_phase = nanoseconds(below(1'000'000'000));
      break;
    case 2:
    case 3:
    case 4: {  // an edge of the train
      const nanoseconds since = now.since_epoch() - train_phase;
      time.on_pulse(MonotonicTime(since - since % seconds(1) + train_phase), now);
      break;
    }
    case 5:  // a time of day near the mission's
      time.on_time_of_day({.fix_valid = random() % 8 != 0,
                           .utc = UtcTime(std::chrono::floor<seconds>(time.utc_at(now).since_epoch()) +
                                          seconds(below(5) - 2))},
                          now);
      break;
    case 6:  // any time of day
      time.on_time_of_day({.fix_valid = true, .utc = UtcTime(nanoseconds(below(7'200'000'000'000'000'000)))},
                          now);
      break;
    case 7:
      (void)time.set_time({time.utc_at(now) + nanoseconds(below(6'000'000'000) - 3'000'000'000),
                           now + nanoseconds(below(2'000'000'000) - 1'000'000'000),
                           {},
                           false},
                          now);
      break;
    case 8:
      (void)time.set_time({UtcTime(nanoseconds(static_cast<std::int64_t>(random()))),
                           MonotonicTime(nanoseconds(static_cast<std::int64_t>(random() >> 2U))),
                           {},
                           false},
                          now);
      break;
    default:
      time.on_time_passing(now);
      break;
  }
}

/// Every possible input of the timing node except an operator's time jump.
TEST(TimeDisciplineProperty, NoInputMakesTheTimeStepOrGoBackNorATickLeaveItsBound) {
  for (unsigned seed = 1; seed <= 60; ++seed) {
    std::mt19937_64 random(seed);
    const auto below = [&](std::uint64_t n) { return static_cast<std::int64_t>(random() % n); };
    const nanoseconds period = std::array{milliseconds(10), milliseconds(100), milliseconds(1000)}[seed % 3];
    Fixture f;
    TickGenerator ticks(period, 0, start);
    f.run(5);
    ASSERT_TRUE(f.time.pulse_clock().time_valid());

    MonotonicTime now = f.edge(f.n);
    while (ticks.next_due() <= now) (void)ticks.on_wakeup(now);
    MonotonicTime asked = now;
    UtcTime shown = f.time.utc_at(asked);
    std::optional<Tick> previous;
    nanoseconds train_phase{0};
    for (int i = 0; i < 4000; ++i) {
      now += nanoseconds(below(random() % 50 == 0 ? 5'000'000'000 : 50'000'000));
      give_anything(f.time, random, now, train_phase);
      const UtcTime next = f.time.utc_at(now);
      const auto elapsed = static_cast<double>((now - asked).count());
      ASSERT_GE(static_cast<double>((next - shown).count()), elapsed * 0.994 - 2) << seed << ' ' << i;
      ASSERT_LE(static_cast<double>((next - shown).count()), elapsed * 1.006 + 2) << seed << ' ' << i;
      shown = next;
      asked = now;

      if (const auto grid = f.time.pulse_clock().grid()) ticks.follow(*grid);
      while (const auto tick = ticks.on_wakeup(now)) {
        if (previous && tick->skipped == 0) {
          ASSERT_GE(tick->due - previous->due, period * 99 / 100) << seed << ' ' << i;
          ASSERT_LE(tick->due - previous->due, period * 101 / 100) << seed << ' ' << i;
        }
        previous = tick;
      }
    }
  }
}

}  // namespace
}  // namespace srfs
