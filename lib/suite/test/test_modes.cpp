// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "suite/modes.hpp"

#include <random>

#include <gtest/gtest.h>

#include "suite/deployment.hpp"
#include "suite/mode_follower.hpp"

namespace srfs::suite {
namespace {

ModeSettings read(const std::string& text) {
  return read_modes(ConfigSection::parse(text, "test.yaml"));
}

constexpr const char* two_modes = R"(
silence_ms: 20000
critical: [payload_eps]
causes:
  - { name: battery, structure: payload_eps, field: state_of_charge, enter_below: 0.35, over_above: 0.55, returns: true }
table:
  safe:
    shed: camera
    payload_eps: { hold: [eps.switch_load load=2 state=off] }
    image_acquisition: { work: false }
    ttc: { beacon_ms: 10000, open_retrieval: false, downlink_octets_s: 2000 }
  nominal: {}
)";

std::string message_of(const std::string& text) {
  try {
    (void)read(text);
  } catch (const ConfigError& error) {
    return error.what();
  }
  return {};
}

TEST(Modes, HaveARowForEachNodeAndNothingSpecialWithoutOne) {
  const ModeSettings s = read(two_modes);
  EXPECT_TRUE(s.enabled());
  EXPECT_EQ(s.reaction("safe", "payload_eps").hold.size(), 1U);
  EXPECT_FALSE(s.reaction("safe", "image_acquisition").work);
  EXPECT_EQ(s.reaction("safe", "ttc").downlink_octets_s, 2000U);
  EXPECT_EQ(s.reaction("nominal", "ttc"), ModeReaction{});
  EXPECT_EQ(s.reaction("pass", "ttc"), ModeReaction{});
  EXPECT_TRUE(s.concerns("ttc"));
  EXPECT_FALSE(s.concerns("timing"));
  EXPECT_FALSE(ModeSettings{}.enabled());
}

TEST(Modes, HaveCausesThatAreStaleByThemselvesUnlessTheFileSaysNever) {
  EXPECT_EQ(read(two_modes).causes.at(0).stale, std::chrono::seconds(120));
  const std::string never =
      "table: { safe: {} }\n"
      "causes: [ { name: a, structure: s, field: f, enter_below: 1, over_above: 2, stale_s: 0 } ]";
  EXPECT_EQ(read(never).causes.at(0).stale, std::chrono::seconds(0));
}

TEST(Modes, SayWhatIsWrongInTheFile) {
  const std::string table = "table: { safe: {} }\n";
  EXPECT_NE(message_of("table: { nominal: {} }").find("row for the mode safe"), std::string::npos);
  EXPECT_NE(message_of("table: { safe: { ttc: { wrok: false } } }").find("wrok"), std::string::npos);
  const std::string cause = table + "causes: [ { name: a, structure: s, field: f, ";
  EXPECT_NE(message_of(cause + "enter_below: 2, over_above: 1 } ]").find("hysteresis"), std::string::npos);
  EXPECT_NE(message_of(cause + "enter_above: 1, over_below: 2 } ]").find("hysteresis"), std::string::npos);
  EXPECT_NE(message_of(cause + "over_above: 1 } ]").find("enter_below"), std::string::npos);
  EXPECT_NE(message_of(cause + "enter_below: 1, over_above: 2, mode: pass } ]").find("mode of the table"),
            std::string::npos);
}

TEST(Modes, OfTheDeploymentsThatShipAreGood) {
  for (const char* name : {"sim", "board_rk3568", "sim_mission"}) {
    const Deployment d = Deployment::load(std::string(SRFS_SOURCE_DIR "/launch_config/") + name + ".yaml");
    EXPECT_TRUE(d.modes.enabled()) << name;
    EXPECT_EQ(d.modes.critical, d.ring.critical) << name;
    EXPECT_TRUE(d.modes.knows("nominal")) << name;
    for (const ModeCause& cause : d.modes.causes)
      EXPECT_EQ(cause.stale, std::chrono::seconds(120)) << name << ' ' << cause.name;
  }
}

const MonotonicTime begin{seconds(1000)};

HeardMode heard(std::uint8_t number, const std::string& name, MonotonicTime at, std::uint32_t change = 1) {
  return {number, name, change, "commanded", at};
}

TEST(ModeFollower, ObeysNothingUntilItHearsAModeAndSafeAfterTheSilence) {
  ModeFollower follower(read(two_modes), begin);
  EXPECT_FALSE(follower.on_time(begin + seconds(19)));
  EXPECT_FALSE(follower.in_force());
  EXPECT_TRUE(follower.on_time(begin + seconds(20)));
  EXPECT_EQ(follower.in_force()->name, "safe");
  EXPECT_TRUE(follower.in_force()->by_itself);
  EXPECT_FALSE(follower.on_time(begin + seconds(40)));  // it is already
}

TEST(ModeFollower, ObeysWhatItHears) {
  ModeFollower follower(read(two_modes), begin);
  EXPECT_TRUE(follower.on_mode(heard(1, "nominal", begin), begin));
  EXPECT_FALSE(follower.on_mode(heard(1, "nominal", begin + seconds(2)), begin + seconds(2)));
  EXPECT_TRUE(follower.on_mode(heard(0, "safe", begin + seconds(3), 2), begin + seconds(3)));
  EXPECT_FALSE(follower.in_force()->by_itself);
  EXPECT_EQ(follower.in_force()->change, 2U);
}

TEST(ModeFollower, GoesToSafeByADamagedModeAndBackByAGoodOne) {
  const MonotonicTime now = begin + seconds(50);
  const std::vector<HeardMode> damaged{heard(1, "safe", now),
                                       heard(0, "nominal", now),
                                       heard(7, "orbit", now),
                                       heard(1, "", now),
                                       heard(1, "nominal", now + seconds(5)),
                                       heard(1, "nominal", now - seconds(21))};
  for (const HeardMode& bad : damaged) {
    ModeFollower follower(read(two_modes), begin);
    (void)follower.on_mode(heard(1, "nominal", now), now);
    EXPECT_TRUE(follower.on_mode(bad, now)) << bad.name << ' ' << int{bad.number};
    EXPECT_TRUE(follower.in_force()->by_itself);
    EXPECT_EQ(follower.in_force()->name, "safe");
    EXPECT_EQ(follower.damaged(), 1U);
    EXPECT_TRUE(follower.on_mode(heard(1, "nominal", now), now));
    EXPECT_EQ(follower.in_force()->name, "nominal");
  }
}

TEST(ModeFollowerProperties, IsNeverInAnotherModeThanTheLastGoodOneOrSafe) {
  std::mt19937 random(28);
  for (int run = 0; run < 200; ++run) {
    ModeFollower follower(read(two_modes), begin);
    MonotonicTime now = begin;
    MonotonicTime last_good = begin;
    std::string last_name;
    for (int step = 0; step < 100; ++step) {
      now += milliseconds(random() % 8000);
      const bool nominal = random() % 2 == 0;
      if (random() % 3 == 0) {
        (void)follower.on_time(now);
      } else if (random() % 4 == 0) {
        (void)follower.on_mode(heard(nominal ? 0 : 1, nominal ? "nominal" : "safe", now), now);
        last_name = "safe";
      } else {
        (void)follower.on_mode(heard(nominal ? 1 : 0, nominal ? "nominal" : "safe", now), now);
        last_good = now;
        last_name = nominal ? "nominal" : "safe";
      }
      (void)follower.on_time(now);
      if (now - last_good >= seconds(20)) last_name = "safe";
      if (last_name.empty()) {
        ASSERT_FALSE(follower.in_force());
      } else {
        ASSERT_EQ(follower.in_force()->name, last_name);
      }
    }
  }
}

}  // namespace
}  // namespace srfs::suite
