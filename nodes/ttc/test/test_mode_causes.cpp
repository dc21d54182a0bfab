// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "nodes/ttc/services/mode_causes.hpp"

#include <algorithm>
#include <cmath>
#include <random>

#include <fmt/format.h>
#include <gtest/gtest.h>

#include "nodes/ttc/link/downlink_budget.hpp"
#include "nodes/ttc/report/mode_obedience.hpp"

namespace srfs {
namespace {

const MonotonicTime begin{seconds(1000)};

const mission::Dictionary& dictionary() {
  static const auto loaded = mission::Dictionary::load(mission::Dictionary::default_folder());
  return loaded;
}

suite::ModeSettings settings() {
  suite::ModeSettings s;
  for (const char* mode : {"safe", "nominal", "low_power"}) s.table[mode];
  s.critical = {"timing", "can_switcher"};
  s.causes = {{.name = "battery",
               .structure = "payload_eps",
               .field = "state_of_charge",
               .below = true,
               .enter = 0.35,
               .leave = 0.55,
               .samples = 3,
               .mode = "safe",
               .returns = true},
              {.name = "saving",
               .structure = "payload_eps",
               .field = "state_of_charge",
               .below = true,
               .enter = 0.5,
               .leave = 0.6,
               .samples = 1,
               .mode = "low_power",
               .returns = true},
              {.name = "tumbling",
               .structure = "payload_adcs",
               .field = "rate_deg_s",
               .below = false,
               .enter = 10,
               .leave = 2,
               .samples = 2,
               .stale = seconds(60),
               .mode = "safe"}};
  return s;
}

class ModeCausesTest : public testing::Test {
 protected:
  void charge(float value, int times = 1) {
    mission::PayloadEpsHousekeeping hk;
    hk.measurement.state_of_charge = value;
    for (int i = 0; i < times; ++i) causes_.on_telemetry(hk.structure_id, hk.encoded(), now_);
    step();
  }
  void rate(float deg_s, int times = 1) {
    mission::PayloadAdcsHousekeeping hk;
    hk.rate_deg_s = deg_s;
    for (int i = 0; i < times; ++i) causes_.on_telemetry(hk.structure_id, hk.encoded(), now_);
    step();
  }
  void step() {
    const auto change = causes_.take_change(mode_, now_);
    if (causes_.present() != mode_.present()) {
      mode_.set_present(causes_.present());
      stored_ = mode_.stored_text();
    }
    if (change) {
      stored_ = mode_.change(change->mode, change->why);
      ++changes_;
    }
  }
  bool command(MissionMode mode) {
    if (causes_.why_not(mode)) return false;
    stored_ = mode_.change(mode, {.reason = "commanded"});
    step();
    return true;
  }
  void restart() {
    mode_ = ModeManager(StoredModeState::present, stored_, MissionMode::safe);
    causes_ = ModeCauses(dictionary(), settings(), now_);
  }

  MonotonicTime now_ = begin;
  ModeManager mode_{StoredModeState::first_start, "", MissionMode::nominal};
  ModeCauses causes_{dictionary(), settings(), begin};
  std::string stored_;
  int changes_ = 0;
};

TEST_F(ModeCausesTest, GoToSafeBeforeTheBatteryIsEmptyAndBackByTheSecondThreshold) {
  EXPECT_TRUE(causes_.problems().empty());
  charge(0.4F);
  EXPECT_EQ(mode_.mode(), MissionMode::low_power);
  charge(0.34F, 2);
  EXPECT_EQ(mode_.mode(), MissionMode::low_power);  // not yet often enough
  charge(0.34F);
  EXPECT_EQ(mode_.mode(), MissionMode::safe);
  EXPECT_EQ(mode_.why().cause, ModeCause::measurement);
  EXPECT_EQ(mode_.reason(), "battery: state_of_charge 0.34 below 0.35");
  EXPECT_EQ(causes_.way_back(mode_), "nominal when state_of_charge is above 0.55");
  charge(0.5F, 10);
  EXPECT_EQ(mode_.mode(), MissionMode::safe);
  charge(0.56F, 3);
  EXPECT_EQ(mode_.mode(), MissionMode::low_power);  // the lesser cause is not over
  charge(0.61F);
  EXPECT_EQ(mode_.mode(), MissionMode::nominal);
  EXPECT_EQ(causes_.present_bits(), 0);
}

TEST_F(ModeCausesTest, NoiseAndSingleSamplesChangeNothing) {
  for (int i = 0; i < 100; ++i) {
    charge(0.51F, 2);
    rate(50);
    rate(1);
    charge(std::nanf(""), 5);
  }
  EXPECT_EQ(changes_, 0);
}

TEST_F(ModeCausesTest, ATelecommandIsRefusedWhileACauseOfASaferModeIsPresent) {
  charge(0.3F, 3);
  ASSERT_EQ(mode_.mode(), MissionMode::safe);
  EXPECT_FALSE(command(MissionMode::nominal));
  EXPECT_EQ(causes_.why_not(MissionMode::nominal)->first, mission::failure::mode_held);
  EXPECT_EQ(causes_.why_not(MissionMode::nominal)->second, Octets{1});
  EXPECT_TRUE(command(MissionMode::safe));
  charge(0.7F, 10);
  EXPECT_EQ(mode_.mode(), MissionMode::safe);  // commanded now
  EXPECT_TRUE(command(MissionMode::nominal));
  EXPECT_EQ(mode_.mode(), MissionMode::nominal);
}

TEST_F(ModeCausesTest, AnIgnoredCauseChangesNothingAndHoldsNothing) {
  charge(0.3F, 3);
  causes_.set_ignored({"battery", "saving"});
  step();
  EXPECT_EQ(mode_.mode(), MissionMode::nominal);  // it is as if it were over
  charge(0.1F, 100);
  EXPECT_EQ(mode_.mode(), MissionMode::nominal);
  EXPECT_EQ(causes_.present_text(), "battery (ignored), saving (ignored)");
}

TEST_F(ModeCausesTest, AMeasurementThatNoLongerComesIsACauseToo) {
  rate(1);
  now_ += seconds(59);
  step();
  EXPECT_EQ(mode_.mode(), MissionMode::nominal);
  EXPECT_EQ(causes_.next_due(now_), now_ + seconds(1));
  now_ += seconds(1);
  step();
  EXPECT_EQ(mode_.mode(), MissionMode::safe);
  EXPECT_EQ(mode_.reason(), "tumbling: no sample for 60 s");
  rate(1, 5);
  EXPECT_EQ(mode_.mode(), MissionMode::safe);  // this one does not go back by itself
  EXPECT_TRUE(command(MissionMode::nominal));
}

TEST_F(ModeCausesTest, OneSampleAfterASilenceDoesNotLeaveSafeMode) {
  suite::ModeSettings s = settings();
  s.causes[2].returns = true;
  causes_ = ModeCauses(dictionary(), s, now_);
  now_ += seconds(60);
  step();
  ASSERT_EQ(mode_.mode(), MissionMode::safe);
  rate(5);  // neither beyond the first threshold nor beyond the second
  EXPECT_EQ(mode_.mode(), MissionMode::safe);
  EXPECT_EQ(causes_.present_text(), "tumbling");
  rate(1);
  EXPECT_EQ(mode_.mode(), MissionMode::safe);
  rate(1);
  EXPECT_EQ(mode_.mode(), MissionMode::nominal);
}

TEST_F(ModeCausesTest, SafeModeIsNotLeftByItselfWhileACriticalNodeIsLost) {
  charge(0.3F, 3);
  ASSERT_EQ(mode_.mode(), MissionMode::safe);
  causes_.on_node("can_switcher", false, now_);
  now_ += seconds(30);
  rate(1);
  EXPECT_EQ(causes_.present_text(), "battery, saving, can_switcher lost");
  EXPECT_EQ(causes_.way_back(mode_), "nominal when state_of_charge is above 0.55 and can_switcher is active");
  charge(0.7F, 10);
  EXPECT_EQ(mode_.mode(), MissionMode::safe);
  causes_.on_node("can_switcher", true, now_);
  step();
  EXPECT_EQ(mode_.mode(), MissionMode::nominal);
}

TEST_F(ModeCausesTest, ANodeThatWasLostInSafeModeIsReportedWhenSafeModeIsLeft) {
  ASSERT_TRUE(command(MissionMode::safe));
  causes_.on_node("can_switcher", false, now_);
  now_ += seconds(30);
  rate(1);
  EXPECT_EQ(changes_, 0);
  EXPECT_TRUE(command(MissionMode::nominal));
  EXPECT_EQ(mode_.mode(), MissionMode::safe);
  EXPECT_EQ(mode_.reason(), "can_switcher is not active for 30 s");
  EXPECT_TRUE(command(MissionMode::nominal));  // the operator knows now
  EXPECT_EQ(mode_.mode(), MissionMode::nominal);
}

TEST_F(ModeCausesTest, ARestartKeepsACauseThatIsNotWhyTheModeIsWhatItIs) {
  ASSERT_TRUE(command(MissionMode::safe));
  charge(0.3F, 3);
  EXPECT_EQ(mode_.reason(), "commanded");
  restart();
  charge(0.4F, 10);  // between the thresholds
  EXPECT_EQ(causes_.present_text(), "battery, saving");
  EXPECT_FALSE(command(MissionMode::nominal));
  charge(0.7F, 10);
  EXPECT_TRUE(command(MissionMode::nominal));
}

TEST_F(ModeCausesTest, AModeThatTheDeploymentDoesNotHaveIsLeftForSafe) {
  mode_ = ModeManager(StoredModeState::first_start, "", MissionMode::pass);
  step();
  EXPECT_EQ(mode_.mode(), MissionMode::safe);
  EXPECT_EQ(mode_.reason(), fmt::format("the deployment has no row for mode {}",
                                        int{static_cast<std::uint8_t>(MissionMode::pass)}));
  charge(0.3F, 3);
  charge(0.7F, 10);
  EXPECT_EQ(changes_, 1);  // and nothing goes back to it
  EXPECT_TRUE(command(MissionMode::nominal));
  EXPECT_EQ(mode_.mode(), MissionMode::nominal);
}

TEST_F(ModeCausesTest, ACriticalNodeThatIsLostIsACauseOnceUntilItIsBack) {
  causes_.on_node("timing", true, now_);
  causes_.on_node("timing", false, now_);
  now_ += seconds(29);
  rate(1);
  EXPECT_EQ(mode_.mode(), MissionMode::nominal);
  now_ += seconds(1);
  step();
  EXPECT_EQ(mode_.mode(), MissionMode::safe);
  EXPECT_EQ(mode_.reason(), "timing is not active for 30 s");
  EXPECT_TRUE(command(MissionMode::nominal));  // the operator knows
  now_ += seconds(20);
  step();
  EXPECT_EQ(mode_.mode(), MissionMode::nominal);
  causes_.on_node("timing", true, now_);
  causes_.on_node("timing", false, now_);
  now_ += seconds(30);
  step();
  EXPECT_EQ(mode_.mode(), MissionMode::safe);
  causes_.on_node("payload_thermal", false, now_);  // not critical
}

TEST_F(ModeCausesTest, SayWhatTheDictionaryDoesNotHave) {
  suite::ModeSettings wrong = settings();
  wrong.table["orbit"]["payload_x"];
  wrong.causes[0].field = "load_switches";
  wrong.causes[1].structure = "payload_esp";
  const ModeCauses causes(dictionary(), wrong, begin);
  EXPECT_EQ(causes.problems().size(), 4U);
}

TEST_F(ModeCausesTest, AModeThatTheDeploymentDoesNotHaveIsRefused) {
  EXPECT_EQ(causes_.why_not(MissionMode::pass)->first, mission::failure::unknown_identifier);
  const ModeCauses without(dictionary(), {}, begin);
  EXPECT_FALSE(without.why_not(MissionMode::nominal));
}

/// Whatever comes, and wherever ttc is restarted: below the first threshold for long it is safe, and it goes
/// back only above the second one.
TEST_F(ModeCausesTest, PropertiesHoldAcrossRestartsOfTtc) {
  std::mt19937 random(28);
  for (int run = 0; run < 100; ++run) {
    mode_ = ModeManager(StoredModeState::first_start, "", MissionMode::nominal);
    stored_ = mode_.stored_text();
    causes_ = ModeCauses(dictionary(), settings(), now_);
    double level = 0.7;
    int low_in_a_row = 0;
    for (int i = 0; i < 300; ++i) {
      level = std::clamp(level + (static_cast<double>(random() % 100) - 52) / 1000, 0.0, 1.0);
      const MissionMode before = mode_.mode();
      const bool by_battery = mode_.why().source == "battery";
      now_ += milliseconds(300);
      rate(1);
      charge(static_cast<float>(level));
      low_in_a_row = level < 0.35 ? low_in_a_row + 1 : 0;
      if (low_in_a_row >= 3) {
        ASSERT_EQ(mode_.mode(), MissionMode::safe) << run << ' ' << i;
      }
      if (before == MissionMode::safe && mode_.mode() != MissionMode::safe && by_battery) {
        ASSERT_GT(level, 0.55);
      }
      if (random() % 10 == 0) {
        const MissionMode mode = mode_.mode();
        restart();
        low_in_a_row = 0;  // the count begins anew
        ASSERT_EQ(mode_.mode(), mode);
      }
      if (random() % 20 == 0)
        (void)command(random() % 2 == 0 ? MissionMode::nominal : MissionMode::low_power);
    }
  }
}

TEST(ModeKeepingV2, KeepsWhySinceAndWhatWasCommanded) {
  ModeManager manager(StoredModeState::first_start, "", MissionMode::nominal);
  const std::string stored =
      manager.change(MissionMode::safe, {ModeCause::measurement, "battery", "battery: 0.3 below 0.35"},
                     UtcTime(seconds(1'800'000'000)));
  const ModeManager again(StoredModeState::present, stored, MissionMode::nominal);
  EXPECT_EQ(again.mode(), MissionMode::safe);
  EXPECT_EQ(again.commanded(), MissionMode::nominal);
  EXPECT_EQ(again.why().cause, ModeCause::measurement);
  EXPECT_EQ(again.why().source, "battery");
  EXPECT_EQ(again.reason(), "battery: 0.3 below 0.35");
  EXPECT_EQ(again.change_count(), 1U);
  EXPECT_EQ(again.since(), UtcTime(seconds(1'800'000'000)));
}

TEST(ModeKeepingV2, AnyDamageMeansSafeWithANumberThatWasNeverGivenOut) {
  ModeManager manager(StoredModeState::first_start, "", MissionMode::nominal);
  const std::string stored = manager.change(MissionMode::pass, {.reason = "commanded"});
  EXPECT_EQ(ModeManager(StoredModeState::present, stored, MissionMode::safe).mode(), MissionMode::pass);
  for (std::size_t i = 0; i < stored.size(); ++i) {
    std::string damaged = stored;
    damaged[i] = static_cast<char>(damaged[i] ^ 1);
    const ModeManager found(StoredModeState::present, damaged, MissionMode::nominal, 1000);
    ASSERT_EQ(found.mode(), MissionMode::safe) << i;
    ASSERT_EQ(found.change_count(), 1000U);
    ASSERT_EQ(found.why().cause, ModeCause::storage);
    const ModeManager cut(StoredModeState::present, stored.substr(0, i), MissionMode::nominal, 1000);
    ASSERT_EQ(cut.mode(), MissionMode::safe) << i;
  }
}

TEST(DownlinkBudgetTest, LetsHalfTheRateDownForEachAndSavesUpToOneBatch) {
  using enum DownlinkBudget::Share;
  DownlinkBudget budget;
  EXPECT_EQ(budget.room(files, 5000, begin), 5000U);  // no bound
  budget.set_rate(2000, begin);
  EXPECT_EQ(budget.room(files, 5000, begin), 0U);
  EXPECT_EQ(budget.room(files, 5000, begin + seconds(2)), 2000U);
  EXPECT_EQ(budget.room(playback, 5000, begin + seconds(2)), 2000U);
  budget.spend(files, 3000, begin + seconds(2));
  EXPECT_EQ(budget.room(files, 5000, begin + seconds(2)), 0U);
  EXPECT_EQ(budget.room(playback, 5000, begin + seconds(2)), 2000U) << "its own";
  EXPECT_EQ(budget.room(files, 5000, begin + seconds(4)), 1000U);
  EXPECT_EQ(budget.room(files, 10'000'000, begin + seconds(100'000)), DownlinkBudget::capacity);
  budget.set_rate(0, begin);
  EXPECT_EQ(budget.room(files, 5000, begin + seconds(100)), 0U);
  budget.set_rate(std::nullopt, begin);
  EXPECT_EQ(budget.room(files, 5000, begin), 5000U);
}

TEST(DownlinkBudgetTest, GivesTheWholeRateToOneWhileTheOtherTakesNothing) {
  using enum DownlinkBudget::Share;
  DownlinkBudget budget;
  budget.set_rate(2000, begin);
  MonotonicTime now = begin + seconds(1000);
  std::size_t taken = 0;
  for (int i = 0; i < 100; ++i) {
    const std::size_t room = budget.room(playback, 100'000, now);
    budget.spend(playback, room, now);
    taken += room;
    now = now + seconds(1);
  }
  EXPECT_NEAR(static_cast<double>(taken), static_cast<double>(DownlinkBudget::capacity) + 99.0 * 2000, 200);
}

/// However much each takes at once.
TEST(DownlinkBudgetTest, NeitherStarvesBesideTheOther) {
  using enum DownlinkBudget::Share;
  for (const auto& [batch, turn] :
       {std::pair{8192U, 1006U}, std::pair{8192U, 16'128U}, std::pair{1000U, 30'000U}}) {
    DownlinkBudget budget;
    budget.set_rate(4000, begin);
    std::size_t played = 0;
    std::size_t sent = 0;
    for (int tenth = 0; tenth < 6000; ++tenth) {
      const MonotonicTime now = begin + tenth * milliseconds(100);
      if (budget.room(playback, 100'000, now) >= batch) budget.spend(playback, batch, now), played += batch;
      if (budget.room(files, 100'000, now) >= turn) budget.spend(files, turn, now), sent += turn;
    }
    EXPECT_GE(played, 1'100'000U);
    EXPECT_GE(sent, 1'100'000U);
    EXPECT_LE(played + sent, 2'400'000U);
  }
}

TEST(ModeObedienceTest, TellsWhoObeysByEventAndByHousekeeping) {
  ModeObedience obedience(dictionary(), {"ttc", "payload_eps", "maintenance"});
  const auto count = [&](mission::ModeObedience wanted, std::uint32_t change) {
    const auto all = obedience.of(change, "ttc");
    return std::count(all.begin(), all.end(), wanted);
  };
  EXPECT_EQ(count(mission::ModeObedience::obeys, 4), 1);
  EXPECT_EQ(count(mission::ModeObedience::pending, 4), 2);
  mission::NodeModeObeyedEvent event;
  event.change = 4;
  obedience.on_event("payload_eps", event.event_id, event.encoded());
  mission::MaintenanceWorkHousekeeping work;
  work.work.mode_change = 4;
  obedience.on_telemetry("maintenance", work.structure_id, work.encoded());
  EXPECT_EQ(count(mission::ModeObedience::pending, 4), 0);
  EXPECT_EQ(count(mission::ModeObedience::pending, 5), 2);
  obedience.on_event("payload_eps", mission::NodeModeByItselfEvent::event_id, {});
  EXPECT_EQ(count(mission::ModeObedience::pending, 4), 1);
}

}  // namespace
}  // namespace srfs
