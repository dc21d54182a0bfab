// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include <mission/structures.hpp>

#include "nodes/timing/pulse_clock.hpp"

namespace srfs {
namespace {

constexpr MonotonicTime start{seconds(50)};
constexpr UtcTime stored{seconds(1'760'000'000)};
constexpr std::int64_t gps_second = 1'795'248'000;

/// A receiver whose second lasts `second_ns` of our monotonic clock.
struct Receiver {
  double second_ns = 1e9;
  std::int64_t n = 0;
  nanoseconds phase = milliseconds(300);

  [[nodiscard]] MonotonicTime edge(std::int64_t pulse) const {
    return start + phase + nanoseconds(std::llround(static_cast<double>(pulse) * second_ns));
  }
  MonotonicTime pulse(PulseClock& clock, nanoseconds jitter = nanoseconds(0)) {
    const MonotonicTime e = edge(n) + jitter;
    clock.on_time_passing(e);
    clock.on_pulse(e, e);
    clock.on_time_of_day(UtcTime(seconds(gps_second + n)), e + milliseconds(150));
    ++n;
    return e;
  }
};

PulseVerdict pulse_at(PulseClock& clock, MonotonicTime edge) {
  return clock.on_pulse(edge, edge + microseconds(50));
}
PulseClock make_clock(const PulseClockSettings& settings = {}) {
  return {settings, ClockStart{.utc = stored, .valid = false, .error = nanoseconds(0), .drift_ppm = {}},
          start};
}

TEST(PulseClock, HasNoValidTimeAndNoGridBeforeTheFirstPulse) {
  const PulseClock clock = make_clock();
  EXPECT_EQ(clock.state(), mission::SyncState::unlocked);
  EXPECT_FALSE(clock.time_valid());
  EXPECT_FALSE(clock.grid().has_value());
  EXPECT_EQ(clock.utc_at(start + seconds(3)), stored + seconds(3));
}

TEST(PulseClock, LocksOnASteadyPulseAndTakesTheSecondTheReceiverNames) {
  PulseClock clock = make_clock();
  Receiver gps;
  for (int i = 0; i < 8; ++i) gps.pulse(clock);
  EXPECT_EQ(clock.state(), mission::SyncState::locked);
  EXPECT_TRUE(clock.time_valid());
  EXPECT_EQ(clock.utc_at(gps.edge(7)), UtcTime(seconds(gps_second + 7)));
}

TEST(PulseClock, EstimatesTheDriftOfTheLocalClock) {
  PulseClock clock = make_clock();
  Receiver gps{.second_ns = 1e9 + 42'000};
  for (int i = 0; i < 60; ++i) gps.pulse(clock);
  EXPECT_EQ(clock.state(), mission::SyncState::locked);
  EXPECT_NEAR(clock.drift_ppm(), 42.0, 0.1);
  EXPECT_LT(std::abs(clock.offset().count()), 100);
}

TEST(PulseClock, DampsTheJitterOfThePulse) {
  PulseClock clock = make_clock();
  Receiver gps;
  std::mt19937 random(2);  // NOLINT(bugprone-random-generator-seed): a failure must repeat
  std::normal_distribution<double> jitter(0, 20e3);
  double squares = 0;
  for (int i = 0; i < 400; ++i) {
    gps.pulse(clock, nanoseconds(std::llround(jitter(random))));
    if (i >= 100) {
      const auto error = static_cast<double>((clock.grid()->edge - gps.edge(i)).count());
      squares += error * error;
    }
  }
  EXPECT_EQ(clock.state(), mission::SyncState::locked);
  EXPECT_LT(std::sqrt(squares / 300), 20e3);
}

TEST(PulseClock, IgnoresASinglePulseOutOfPlace) {
  PulseClock clock = make_clock();
  Receiver gps;
  for (int i = 0; i < 8; ++i) gps.pulse(clock);
  EXPECT_EQ(pulse_at(clock, gps.edge(7) + milliseconds(430)), PulseVerdict::outlier);
  gps.pulse(clock);
  EXPECT_EQ(clock.state(), mission::SyncState::locked);
  EXPECT_EQ(clock.counters().outliers, 1U);
  EXPECT_EQ(clock.utc_at(gps.edge(8)), UtcTime(seconds(gps_second + 8)));
}

TEST(PulseClock, BelievesASteppedPulseOnlyAfterAMinuteInWhichNoneCameWhereExpected) {
  PulseClock clock = make_clock();
  Receiver gps;
  for (int i = 0; i < 8; ++i) gps.pulse(clock);
  gps.phase += milliseconds(200);
  for (int i = 0; i < 59; ++i) gps.pulse(clock);
  EXPECT_EQ(clock.counters().phase_adoptions, 0U);
  EXPECT_EQ(clock.state(), mission::SyncState::holdover);
  for (int i = 0; i < 8; ++i) gps.pulse(clock);
  EXPECT_EQ(clock.counters().phase_adoptions, 1U);
  EXPECT_EQ(clock.state(), mission::SyncState::locked);
  EXPECT_EQ(clock.utc_at(gps.edge(74)), UtcTime(seconds(gps_second + 74)));
}

TEST(PulseClock, ASpoofedStepThatEndsLeavesNoTrace) {
  PulseClock clock = make_clock();
  Receiver gps;
  for (int i = 0; i < 40; ++i) gps.pulse(clock);
  gps.phase += milliseconds(3);
  for (int i = 0; i < 50; ++i) gps.pulse(clock);
  gps.phase -= milliseconds(3);
  for (int i = 0; i < 6; ++i) gps.pulse(clock);
  EXPECT_EQ(clock.state(), mission::SyncState::locked);
  EXPECT_EQ(clock.counters().phase_adoptions, 0U);
  EXPECT_LT(std::abs((clock.utc_at(gps.edge(95)) - UtcTime(seconds(gps_second + 95))).count()), 100);
}

TEST(PulseClock, AFirstPulseThatWasFalseIsForgottenSoon) {
  PulseClock clock = make_clock();
  Receiver gps;
  pulse_at(clock, gps.edge(0) - milliseconds(400));
  for (int i = 0; i < 10; ++i) gps.pulse(clock);
  EXPECT_EQ(clock.state(), mission::SyncState::locked);
  EXPECT_EQ(clock.utc_at(gps.edge(9)), UtcTime(seconds(gps_second + 9)));
}

TEST(PulseClock, OfTwoReceiversPulsesItKeepsToTheOneItFollows) {
  PulseClock clock = make_clock();
  Receiver gps;
  for (int i = 0; i < 200; ++i) {
    const MonotonicTime e = gps.pulse(clock);
    EXPECT_EQ(pulse_at(clock, e + milliseconds(300)), PulseVerdict::outlier);
  }
  EXPECT_EQ(clock.state(), mission::SyncState::locked);
  EXPECT_EQ(clock.counters().phase_adoptions, 0U);
  EXPECT_EQ(clock.utc_at(gps.edge(199)), UtcTime(seconds(gps_second + 199)));
}

TEST(PulseClock, AFalsePulseInsideTheOutlierLimitIsAnOutlierOnceThePulsesAreSteady) {
  PulseClock clock = make_clock();
  Receiver gps;
  for (int i = 0; i < 40; ++i) gps.pulse(clock);
  EXPECT_EQ(pulse_at(clock, gps.edge(40) - microseconds(200)), PulseVerdict::outlier);
  gps.pulse(clock);
  EXPECT_EQ(clock.counters().outliers, 1U);
  EXPECT_LT(std::abs(clock.offset().count()), 100);
}

TEST(PulseClock, APulseThatMovesWithinTheLimitIsFollowedAtLast) {
  PulseClock clock = make_clock();
  Receiver gps;
  for (int i = 0; i < 40; ++i) gps.pulse(clock);
  gps.phase += microseconds(700);
  for (int i = 0; i < 100; ++i) gps.pulse(clock);
  EXPECT_EQ(clock.counters().phase_adoptions, 0U);
  EXPECT_LT(std::abs(clock.offset().count()), 5'000);
}

TEST(PulseClock, SurvivesLostPulses) {
  PulseClock clock = make_clock();
  Receiver gps{.second_ns = 1e9 + 1000};
  for (int i = 0; i < 300; ++i) {
    if (i > 10 && i % 3 == 0) {
      ++gps.n;
    } else {
      gps.pulse(clock);
    }
  }
  EXPECT_EQ(clock.state(), mission::SyncState::locked);
  EXPECT_EQ(clock.counters().outliers, 0U);
  EXPECT_LT(std::abs((clock.utc_at(gps.edge(299)) - UtcTime(seconds(gps_second + 299))).count()), 200);
}

TEST(PulseClock, AfterASilenceThePulseIsTakenBackWhereTheOscillatorCanHaveBroughtIt) {
  PulseClock clock = make_clock();
  Receiver gps;
  for (int i = 0; i < 40; ++i) gps.pulse(clock);
  gps.n += 1000;
  gps.phase += milliseconds(4);  // 4 ppm
  for (int i = 0; i < 10; ++i) gps.pulse(clock);
  EXPECT_EQ(clock.state(), mission::SyncState::locked);
  EXPECT_EQ(clock.counters().phase_adoptions, 0U);
  EXPECT_LT(std::abs(clock.offset().count()), 2'000);
  EXPECT_LT(std::abs(clock.drift_ppm()), 0.5);
}

TEST(PulseClock, SaysHowWrongItMayBe) {
  PulseClock clock = make_clock();
  Receiver gps;
  EXPECT_FALSE(clock.error_at(start).has_value());
  std::mt19937 random(5);  // NOLINT(bugprone-random-generator-seed): a failure must repeat
  std::normal_distribution<double> jitter(0, 1e3);
  for (int i = 0; i < 60; ++i) gps.pulse(clock, nanoseconds(std::llround(jitter(random))));
  const MonotonicTime last = gps.edge(59);
  EXPECT_GT(*clock.error_at(last), nanoseconds(300));
  EXPECT_LT(*clock.error_at(last), microseconds(3));
  clock.on_time_passing(last + std::chrono::hours(1));
  EXPECT_GT(*clock.error_at(last + std::chrono::hours(1)), milliseconds(1));
  EXPECT_LT(*clock.error_at(last + std::chrono::hours(1)), milliseconds(2));

  clock.set_time(clock.utc_at(last + std::chrono::hours(1)), last + std::chrono::hours(1), seconds(1));
  EXPECT_GE(*clock.error_at(last + std::chrono::hours(1)), seconds(1));
}

TEST(PulseClock, GoesOnInHoldoverWhenThePulseStopsAndLocksAgainWhenItReturns) {
  PulseClock clock = make_clock();
  Receiver gps{.second_ns = 1e9 + 10'000};
  for (int i = 0; i < 40; ++i) gps.pulse(clock);
  const MonotonicTime last = gps.edge(39);

  clock.on_time_passing(last + seconds(3));
  EXPECT_EQ(clock.state(), mission::SyncState::holdover);
  EXPECT_TRUE(clock.time_valid());
  const MonotonicTime later = gps.edge(39 + 600);
  EXPECT_LT(std::abs((clock.utc_at(later) - UtcTime(seconds(gps_second + 639))).count()), 1'000'000);

  gps.n += 600;
  gps.pulse(clock);
  EXPECT_EQ(clock.state(), mission::SyncState::locking);
  for (int i = 0; i < 6; ++i) gps.pulse(clock);
  EXPECT_EQ(clock.state(), mission::SyncState::locked);
}

TEST(PulseClock, RefusesALargeJumpOfAValidTimeUntilAnOperatorSetsIt) {
  PulseClock clock = make_clock();
  Receiver gps;
  for (int i = 0; i < 8; ++i) gps.pulse(clock);

  const MonotonicTime e = gps.edge(gps.n);
  pulse_at(clock, e);
  const UtcTime wrong(seconds(gps_second + gps.n + 3600));
  EXPECT_EQ(clock.on_time_of_day(wrong, e + milliseconds(100)), TimeOfDayVerdict::jump_refused);
  EXPECT_EQ(clock.refused_jump(), seconds(3600));
  EXPECT_EQ(clock.utc_at(e), UtcTime(seconds(gps_second + gps.n)));

  // The given time is three milliseconds off: the pulse determines the fraction of the second.
  clock.set_time(wrong + milliseconds(103), e + milliseconds(100), milliseconds(10));
  EXPECT_EQ(clock.utc_at(e), wrong);
}

TEST(PulseClock, CorrectsByOneSecondOnlyWhenSentencesAgree) {
  PulseClock clock = make_clock();
  Receiver gps;
  for (int i = 0; i < 8; ++i) gps.pulse(clock);
  const auto shifted = [&] {
    const MonotonicTime e = gps.edge(gps.n);
    pulse_at(clock, e);
    return clock.on_time_of_day(UtcTime(seconds(gps_second + gps.n++ + 1)), e + milliseconds(100));
  };
  for (int i = 0; i < 9; ++i) EXPECT_EQ(shifted(), TimeOfDayVerdict::waiting);
  EXPECT_EQ(shifted(), TimeOfDayVerdict::corrected);
  EXPECT_EQ(shifted(), TimeOfDayVerdict::agrees);
}

TEST(PulseClock, TakesNoTimeWithoutItsPulseNorOneFromThePast) {
  PulseClock clock = make_clock();
  EXPECT_EQ(clock.on_time_of_day(UtcTime(seconds(gps_second)), start), TimeOfDayVerdict::no_pulse);
  const MonotonicTime e = start + milliseconds(300);
  pulse_at(clock, e);
  EXPECT_EQ(clock.on_time_of_day(UtcTime(seconds(gps_second)), e + milliseconds(1200)),
            TimeOfDayVerdict::no_pulse);
  EXPECT_EQ(clock.on_time_of_day(UtcTime(seconds(315'964'800)), e + milliseconds(100)),
            TimeOfDayVerdict::implausible);
  EXPECT_FALSE(clock.time_valid());
}

TEST(PulseClock, AMessageSoEarlyOrBesideAPulseHandledLateBelongsToNone) {
  PulseClock clock = make_clock();
  const MonotonicTime e = start + milliseconds(300);
  const UtcTime second{seconds(gps_second)};
  pulse_at(clock, e);
  EXPECT_EQ(clock.on_time_of_day(second, e + milliseconds(5)), TimeOfDayVerdict::no_pulse);
  clock.on_pulse(e + seconds(1), e + milliseconds(2010));  // the thread was delayed
  clock.on_pulse(e + seconds(2), e + milliseconds(2010));
  EXPECT_EQ(clock.on_time_of_day(second, e + milliseconds(2040)), TimeOfDayVerdict::no_pulse);
  pulse_at(clock, e + seconds(3));
  EXPECT_EQ(clock.on_time_of_day(second + seconds(3), e + milliseconds(3040)), TimeOfDayVerdict::waiting);
}

TEST(PulseClock, ReadsADateOfAnotherEraAsOfThisOne) {
  PulseClock clock = make_clock();
  Receiver gps;
  const std::chrono::hours era(1024 * 7 * 24);
  for (int i = 0; i < 3; ++i) {
    const MonotonicTime e = gps.edge(gps.n);
    pulse_at(clock, e);
    clock.on_time_of_day(UtcTime(seconds(gps_second + gps.n) - era), e + milliseconds(100));
    ++gps.n;
  }
  EXPECT_TRUE(clock.time_valid());
  EXPECT_EQ(clock.counters().week_rollovers, 3U);
  EXPECT_EQ(clock.utc_at(gps.edge(2)), UtcTime(seconds(gps_second + 2)));
}

TEST(PulseClock, CountsARepeatedPulse) {
  PulseClock clock = make_clock();
  pulse_at(clock, start + seconds(1));
  EXPECT_EQ(pulse_at(clock, start + seconds(1)), PulseVerdict::repeated);
  EXPECT_EQ(clock.counters().repeated_pulses, 1U);
}

}  // namespace
}  // namespace srfs
