#include <gtest/gtest.h>

#include <cmath>
#include <random>

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
    clock.on_pulse(e);
    clock.on_time_of_day(UtcTime(seconds(gps_second + n)), e + milliseconds(150));
    ++n;
    return e;
  }
};

TEST(PulseClock, HasNoValidTimeAndNoGridBeforeTheFirstPulse) {
  const PulseClock clock({}, stored, start);
  EXPECT_EQ(clock.state(), SyncState::unlocked);
  EXPECT_FALSE(clock.time_valid());
  EXPECT_FALSE(clock.grid().has_value());
  EXPECT_EQ(clock.utc_at(start + seconds(3)), stored + seconds(3));
}

TEST(PulseClock, LocksOnASteadyPulseAndTakesTheSecondTheReceiverNames) {
  PulseClock clock({}, stored, start);
  Receiver gps;
  for (int i = 0; i < 8; ++i) gps.pulse(clock);
  EXPECT_EQ(clock.state(), SyncState::locked);
  EXPECT_TRUE(clock.time_valid());
  EXPECT_EQ(clock.utc_at(gps.edge(7)), UtcTime(seconds(gps_second + 7)));
}

TEST(PulseClock, EstimatesTheDriftOfTheLocalClock) {
  PulseClock clock({}, stored, start);
  Receiver gps{.second_ns = 1e9 + 42'000};
  for (int i = 0; i < 60; ++i) gps.pulse(clock);
  EXPECT_EQ(clock.state(), SyncState::locked);
  EXPECT_NEAR(clock.drift_ppm(), 42.0, 0.1);
  EXPECT_LT(std::abs(clock.offset().count()), 100);
}

TEST(PulseClock, DampsTheJitterOfThePulse) {
  PulseClock clock({}, stored, start);
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
  EXPECT_EQ(clock.state(), SyncState::locked);
  EXPECT_LT(std::sqrt(squares / 300), 20e3);
}

TEST(PulseClock, IgnoresASinglePulseOutOfPlace) {
  PulseClock clock({}, stored, start);
  Receiver gps;
  for (int i = 0; i < 8; ++i) gps.pulse(clock);
  EXPECT_EQ(clock.on_pulse(gps.edge(7) + milliseconds(430)), PulseVerdict::outlier);
  gps.pulse(clock);
  EXPECT_EQ(clock.state(), SyncState::locked);
  EXPECT_EQ(clock.counters().outliers, 1U);
  EXPECT_EQ(clock.utc_at(gps.edge(8)), UtcTime(seconds(gps_second + 8)));
}

TEST(PulseClock, BelievesOutliersThatAgreeWithEachOther) {
  PulseClock clock({}, stored, start);
  Receiver gps;
  for (int i = 0; i < 8; ++i) gps.pulse(clock);
  gps.phase += milliseconds(200);
  for (int i = 0; i < 4; ++i) gps.pulse(clock);
  EXPECT_EQ(clock.counters().phase_adoptions, 0U);
  for (int i = 0; i < 8; ++i) gps.pulse(clock);
  EXPECT_EQ(clock.counters().phase_adoptions, 1U);
  EXPECT_EQ(clock.state(), SyncState::locked);
  EXPECT_EQ(clock.utc_at(gps.edge(19)), UtcTime(seconds(gps_second + 19)));
}

TEST(PulseClock, GoesOnInHoldoverWhenThePulseStopsAndLocksAgainWhenItReturns) {
  PulseClock clock({}, stored, start);
  Receiver gps{.second_ns = 1e9 + 10'000};
  for (int i = 0; i < 40; ++i) gps.pulse(clock);
  const MonotonicTime last = gps.edge(39);

  clock.on_time_passing(last + seconds(3));
  EXPECT_EQ(clock.state(), SyncState::holdover);
  EXPECT_TRUE(clock.time_valid());
  const MonotonicTime later = gps.edge(39 + 600);
  EXPECT_LT(std::abs((clock.utc_at(later) - UtcTime(seconds(gps_second + 639))).count()), 1'000'000);

  gps.n += 600;
  gps.pulse(clock);
  EXPECT_EQ(clock.state(), SyncState::locking);
  for (int i = 0; i < 6; ++i) gps.pulse(clock);
  EXPECT_EQ(clock.state(), SyncState::locked);
}

TEST(PulseClock, RefusesALargeJumpOfAValidTimeUntilAnOperatorSetsIt) {
  PulseClock clock({}, stored, start);
  Receiver gps;
  for (int i = 0; i < 8; ++i) gps.pulse(clock);

  const MonotonicTime e = gps.edge(gps.n);
  clock.on_pulse(e);
  const UtcTime wrong(seconds(gps_second + gps.n + 3600));
  EXPECT_EQ(clock.on_time_of_day(wrong, e + milliseconds(100)), TimeOfDayVerdict::jump_refused);
  EXPECT_EQ(clock.refused_jump(), seconds(3600));
  EXPECT_EQ(clock.utc_at(e), UtcTime(seconds(gps_second + gps.n)));

  clock.set_time(wrong + milliseconds(103),
                 e + milliseconds(100));  // three milliseconds off: the pulse knows better
  EXPECT_EQ(clock.utc_at(e), wrong);
}

TEST(PulseClock, CorrectsByOneSecondOnlyWhenSentencesAgree) {
  PulseClock clock({}, stored, start);
  Receiver gps;
  for (int i = 0; i < 8; ++i) gps.pulse(clock);
  const auto shifted = [&] {
    const MonotonicTime e = gps.edge(gps.n);
    clock.on_pulse(e);
    return clock.on_time_of_day(UtcTime(seconds(gps_second + gps.n++ + 1)), e + milliseconds(100));
  };
  EXPECT_EQ(shifted(), TimeOfDayVerdict::waiting);
  EXPECT_EQ(shifted(), TimeOfDayVerdict::set);
  EXPECT_EQ(shifted(), TimeOfDayVerdict::agrees);
}

TEST(PulseClock, TakesNoTimeWithoutItsPulseNorOneFromThePast) {
  PulseClock clock({}, stored, start);
  EXPECT_EQ(clock.on_time_of_day(UtcTime(seconds(gps_second)), start), TimeOfDayVerdict::no_pulse);
  const MonotonicTime e = start + milliseconds(300);
  clock.on_pulse(e);
  EXPECT_EQ(clock.on_time_of_day(UtcTime(seconds(gps_second)), e + milliseconds(1200)),
            TimeOfDayVerdict::no_pulse);
  EXPECT_EQ(clock.on_time_of_day(UtcTime(seconds(1'300'000'000)), e + milliseconds(100)),
            TimeOfDayVerdict::implausible);
  EXPECT_FALSE(clock.time_valid());
}

TEST(PulseClock, CountsARepeatedPulse) {
  PulseClock clock({}, stored, start);
  clock.on_pulse(start + seconds(1));
  EXPECT_EQ(clock.on_pulse(start + seconds(1)), PulseVerdict::repeated);
  EXPECT_EQ(clock.counters().repeated_pulses, 1U);
}

}  // namespace
}  // namespace srfs
