// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "nodes/maintenance/limit_watch.hpp"

#include <gtest/gtest.h>

namespace srfs {
namespace {

using mission::LimitState;

class LimitWatchTest : public testing::Test {
 protected:
  /// A sample at @p at_s of the process started at @p since_s.
  std::optional<std::string> sample(LimitState state, int at_s, int since_s,
                                    const std::string& node = "eps") {
    mission::DecodedField good{
        .name = "load", .value = 1.0, .text = "1", .unit = "", .limit = LimitState::green};
    mission::DecodedField field{.name = "voltage", .value = 9.0, .text = "9.0", .unit = "V", .limit = state};
    return watch.on_sample(node, structure, {good, field}, MonotonicTime(seconds(since_s)),
                           MonotonicTime(seconds(at_s)));
  }
  std::optional<std::string> raise(const mission::Event& event, int at_s, int since_s) {
    return watch.on_event("eps", event, MonotonicTime(seconds(since_s)), MonotonicTime(seconds(at_s)));
  }
  static mission::Structure named(const std::string& name) {
    mission::Structure s;
    s.name = name;
    return s;
  }
  static mission::Event event(const std::string& name, std::uint16_t id, mission::EventSeverity severity) {
    mission::Event e;
    e.name = name;
    e.id = id;
    e.severity = severity;
    return e;
  }

  LimitWatch watch;
  const mission::Structure structure = named("eps_status");
};

TEST_F(LimitWatchTest, BlamesTheProcessInWhoseLifeAParameterTurnsRed) {
  EXPECT_FALSE(sample(LimitState::green, 10, 0));
  EXPECT_FALSE(sample(LimitState::yellow, 110, 100));
  EXPECT_EQ(sample(LimitState::red, 111, 100), "eps_status.voltage 9.0");
  EXPECT_FALSE(sample(LimitState::green, 112, 100));
}

TEST_F(LimitWatchTest, BlamesAProcessWhoseFirstSampleIsRedAfterAGoodOneOfTheProcessBefore) {
  EXPECT_FALSE(sample(LimitState::green, 90, 0));
  EXPECT_TRUE(sample(LimitState::red, 101, 100));
}

TEST_F(LimitWatchTest, ExcusesForItsLifeWhatStoodBeforeItWasStarted) {
  (void)sample(LimitState::green, 10, 0);
  (void)sample(LimitState::red, 80, 0);
  (void)sample(LimitState::green, 90, 0);
  EXPECT_FALSE(sample(LimitState::red, 101, 100));
  EXPECT_FALSE(sample(LimitState::green, 102, 100));
  EXPECT_FALSE(sample(LimitState::red, 103, 100)) << "it came and went before, too";
  const int later = 104 + static_cast<int>(LimitWatch::memory / seconds(1));
  EXPECT_FALSE(sample(LimitState::green, later - 1, 100));
  EXPECT_TRUE(sample(LimitState::red, later + 1, later)) << "long ago";
}

TEST_F(LimitWatchTest, DoesNotBlameForWhatMayHaveStoodBeforeItWasWatched) {
  EXPECT_FALSE(sample(LimitState::red, 101, 100));
  EXPECT_FALSE(sample(LimitState::red, 102, 100));
  EXPECT_FALSE(sample(LimitState::green, 103, 100));
  EXPECT_TRUE(sample(LimitState::red, 104, 100));
}

TEST_F(LimitWatchTest, KnowsNodesApart) {
  (void)sample(LimitState::red, 80, 0, "other");
  (void)sample(LimitState::green, 80, 0);
  EXPECT_TRUE(sample(LimitState::red, 101, 100));
}

TEST_F(LimitWatchTest, BlamesForEventsOfSeverityHighThatAreNewAndNotOfTheRing) {
  const auto high = event("eps.broken", 7, mission::EventSeverity::high);
  EXPECT_FALSE(raise(event("eps.odd", 6, mission::EventSeverity::medium), 110, 100));
  EXPECT_FALSE(raise(event("ring.version_failed", 404, mission::EventSeverity::high), 110, 100));
  EXPECT_EQ(raise(high, 110, 100), "eps.broken");
  EXPECT_EQ(raise(high, 111, 100), "eps.broken");
  EXPECT_FALSE(raise(high, 210, 200)) << "the process before raised it too";
}

TEST_F(LimitWatchTest, FindsTheStructuresWithHardLimits) {
  mission::Structure s = structure;
  s.fields.resize(2);
  EXPECT_FALSE(has_hard_limits(s));
  s.fields[1].hard = mission::Bounds{1.0, std::nullopt};
  EXPECT_TRUE(has_hard_limits(s));
}

}  // namespace
}  // namespace srfs
