// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include <mission/structures.hpp>

#include "hw/fake/fake_kernel_clock.hpp"
#include "nodes/timing/mission_clock.hpp"
#include "nodes/timing/pulse_clock.hpp"
#include "nodes/timing/system_clock.hpp"

namespace srfs {
namespace {

constexpr MonotonicTime start{seconds(100)};
constexpr UtcTime utc{seconds(1'795'248'000)};

TEST(MissionClock, RunsFromWhereItWasSet) {
  const MissionClock clock(utc, start);
  EXPECT_EQ(clock.utc_at(start + seconds(5)), utc + seconds(5));
}

TEST(MissionClock, TakesASmallDifferenceInWithinASecondAndThenFollows) {
  MissionClock clock(utc, start);
  clock.follow({start, utc + microseconds(10), 20}, start);
  EXPECT_EQ(clock.utc_at(start), utc);
  EXPECT_EQ(clock.utc_at(start + seconds(1)), utc + seconds(1) + microseconds(30));
  EXPECT_EQ(clock.utc_at(start + seconds(100)), utc + seconds(100) + microseconds(2010));
}

TEST(MissionClock, SlewsASecondInTwoHundredAndEndsExactly) {
  MissionClock clock(utc, start);
  clock.follow({start, utc - seconds(1), 0}, start);
  EXPECT_EQ(clock.utc_at(start + seconds(100)), utc + milliseconds(99'500));
  EXPECT_EQ(clock.utc_at(start + seconds(200)), utc + seconds(199));
  EXPECT_EQ(clock.utc_at(start + seconds(4000)), utc + seconds(3999));
}

TEST(MissionClock, SaysOfThePastWhatItSaidThen) {
  MissionClock clock(utc, start);
  clock.follow({start, utc + seconds(1), 0}, start);
  const MonotonicTime asked = start + milliseconds(1500);
  const UtcTime said = clock.utc_at(asked);
  clock.follow({start, utc - seconds(1), 0}, start + seconds(2));
  EXPECT_EQ(clock.utc_at(asked), said);
}

TEST(MissionClock, StepsOnlyWhenTold) {
  MissionClock clock(utc, start);
  clock.follow({start, utc + seconds(1), 0}, start);
  clock.step_to(utc - seconds(3600), start + seconds(1));
  EXPECT_EQ(clock.utc_at(start + seconds(1)), utc - seconds(3600));
}

TEST(MissionClock, NeitherStepsNorGoesBackWhateverItIsToFollow) {
  std::mt19937_64 random(3);  // NOLINT(bugprone-random-generator-seed): a failure must repeat
  MissionClock clock(utc, start);
  MonotonicTime now = start;
  UtcTime shown = clock.utc_at(now);
  for (int i = 0; i < 200'000; ++i) {
    const nanoseconds step(random() % 3 == 0 ? random() % 1000 : random() % 2'000'000'000);
    now += step;
    if (random() % 2 == 0) {
      const nanoseconds off(static_cast<std::int64_t>(random() % 4'000'000'000) - 2'000'000'000);
      clock.follow({now - nanoseconds(random() % 10'000'000'000), clock.utc_at(now) + off,
                    static_cast<double>(random() % 10'000) - 5000},
                   now);
    }
    const UtcTime next = clock.utc_at(now);
    const auto elapsed = static_cast<double>(step.count());
    ASSERT_GE(static_cast<double>((next - shown).count()), elapsed * 0.994 - 2) << i;
    ASSERT_LE(static_cast<double>((next - shown).count()), elapsed * 1.006 + 2) << i;
    shown = next;
  }
}

/// A receiver's pulses, an oscillator that is `drift_ppm` fast, and the kernel's clocks under discipline.
struct DisciplinedKernel {
  explicit DisciplinedKernel(double drift) : drift_ppm(drift) {}

  double drift_ppm;
  hw::FakeKernelClock kernel{utc};
  SystemClockDiscipline clock{kernel};
  PulseClock pulses{{}, ClockStart{.utc = utc, .valid = true, .error = milliseconds(1), .drift_ppm = {}}, {}};
  std::int64_t n = 0;

  void second() {
    kernel.advance(seconds(1) + nanoseconds(std::llround(drift_ppm * 1e3)));
    ++n;
    const MonotonicTime now = kernel.monotonic();
    pulses.on_pulse(now, now);
    pulses.on_rate_changed(clock.follow(pulses.reference(), now), now);
  }
  [[nodiscard]] nanoseconds error() const { return kernel.utc_at(kernel.monotonic()) - (utc + seconds(n)); }
};

TEST(SystemClockDiscipline, SlewsTheKernelsClockToThePulseAndItsRateToTrueSeconds) {
  DisciplinedKernel board(37);
  for (int i = 0; i < 120; ++i) board.second();
  EXPECT_LT(std::abs(board.error().count()), 1000);
  EXPECT_NEAR(board.kernel.frequency_ppm(), -37, 0.1);
  EXPECT_NEAR(board.pulses.drift_ppm(), 0, 0.1);
  EXPECT_EQ(board.pulses.state(), mission::SyncState::locked);
  EXPECT_EQ(board.pulses.counters().outliers, 0U);
  EXPECT_EQ(board.kernel.steps, 0);
}

TEST(SystemClockDiscipline, TakesALargeDifferenceInWithoutAStepAndWithinTheKernelsLimit) {
  DisciplinedKernel board(-80);
  for (int i = 0; i < 60; ++i) board.second();
  (void)board.kernel.step(milliseconds(100));  // a step by another program
  for (int i = 0; i < 600; ++i) {
    board.second();
    ASSERT_LE(std::abs(board.kernel.frequency_ppm()), hw::KernelClock::frequency_limit_ppm);
  }
  EXPECT_LT(std::abs(board.error().count()), 2000);
  EXPECT_EQ(board.kernel.steps, 1);
}

TEST(SystemClockDiscipline, StepsWhenToldAndCountsWhatTheKernelRefuses) {
  hw::FakeKernelClock kernel(utc);
  SystemClockDiscipline clock(kernel);
  clock.step_to(utc + seconds(100), kernel.monotonic());
  EXPECT_EQ(clock.utc_at(kernel.monotonic()), utc + seconds(100));
  kernel.permitted = false;
  EXPECT_EQ(clock.follow({kernel.monotonic(), utc, 0}, kernel.monotonic()), 0);
  clock.step_to(utc, kernel.monotonic());
  EXPECT_EQ(clock.refused(), 2U);
}

}  // namespace
}  // namespace srfs
