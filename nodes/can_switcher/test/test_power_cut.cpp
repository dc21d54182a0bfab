// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "nodes/can_switcher/power_cut.hpp"

#include <deque>
#include <random>
#include <set>

#include <gtest/gtest.h>

#include "nodes/can_switcher/test/placed_peripherals.hpp"

namespace srfs {
namespace {

const std::vector<suite::Peripheral> peripherals{adcs, eps, thermal};

using Set = std::optional<Result<void, hw::GpioError>>;

const Set is_off = Result<void, hw::GpioError>();
const Set attended_again = std::nullopt;
Set failed(hw::GpioError why) {
  return Result<void, hw::GpioError>(Err(why));
}
bool everybody(std::string_view /*payload*/) {
  return true;
}
bool nobody(std::string_view /*payload*/) {
  return false;
}

template <class Action>
const Action* sole(const PowerActions& actions) {
  return actions.size() == 1 ? std::get_if<Action>(&actions.front()) : nullptr;
}

class PowerCutTest : public testing::Test {
 protected:
  PowerCut cut_;
};

TEST_F(PowerCutTest, SwitchesThePowerOffAndHoldsTheLineUntilThePayloadHasAProcess) {
  const PowerActions cut = cut_.cut(eps);
  ASSERT_NE(sole<CutPower>(cut), nullptr);
  EXPECT_EQ(sole<CutPower>(cut)->peripheral.payload, "payload_eps");
  EXPECT_TRUE(cut_.cut(eps).empty()) << "one job at a time";
  EXPECT_TRUE(cut_.give_back(everybody).empty()) << "nothing is held yet";

  const PowerActions off = cut_.on_cut(eps, is_off);
  ASSERT_NE(sole<ReportPowerCut>(off), nullptr);
  EXPECT_EQ(cut_.counters().cut, 1U);
  EXPECT_TRUE(cut_.give_back(nobody).empty()) << "its payload is still away";
  const PowerActions back = cut_.give_back(everybody);
  ASSERT_NE(sole<GiveBackLines>(back), nullptr) << "the payload must be able to take its line";
  EXPECT_TRUE(cut_.give_back(everybody).empty());
  cut_.on_given_back(eps);
  EXPECT_TRUE(cut_.give_back(everybody).empty());
}

TEST_F(PowerCutTest, LeavesThePeripheralToAPayloadThatCameBackMeanwhile) {
  (void)cut_.cut(eps);
  EXPECT_TRUE(cut_.on_cut(eps, attended_again).empty());
  EXPECT_TRUE(cut_.give_back(everybody).empty()) << "no line was taken";
  EXPECT_EQ(cut_.counters().cut, 0U);
}

TEST_F(PowerCutTest, SaysWhyItFailedWithEveryHundredthTryAndTriesAgainWhenAsked) {
  int reports = 0;
  for (int i = 0; i < 201; ++i) {
    ASSERT_NE(sole<CutPower>(cut_.cut(eps)), nullptr);
    const PowerActions actions = cut_.on_cut(eps, failed(hw::GpioError::not_ours));
    if (actions.empty()) continue;
    ++reports;
    EXPECT_EQ(sole<ReportCutFailed>(actions)->why, hw::GpioError::not_ours);
  }
  EXPECT_EQ(reports, 3);
  EXPECT_EQ(cut_.counters().failed, 201U);
  EXPECT_NE(sole<GiveBackLines>(cut_.give_back(everybody)), nullptr) << "the chip may be open";
}

TEST_F(PowerCutTest, TriesAgainAfterTheWorkerHadNoRoom) {
  (void)cut_.cut(adcs);
  cut_.on_refused(adcs);
  EXPECT_NE(sole<CutPower>(cut_.cut(adcs)), nullptr);
}

TEST_F(PowerCutTest, AHeldLineWaitsForThePayloadThatItBelongsToByThen) {
  (void)cut_.cut(eps);
  (void)cut_.on_cut(eps, is_off);
  cut_.place({adcs, {"payload_new", 0x22, eps.power_line}});
  EXPECT_TRUE(cut_.give_back([](std::string_view payload) { return payload == eps.payload; }).empty());
  const PowerActions back = cut_.give_back([](std::string_view payload) { return payload == "payload_new"; });
  ASSERT_NE(sole<GiveBackLines>(back), nullptr);
}

TEST(PowerCutProperties, OneJobForALineAtATimeAndNoPayloadIsKeptFromItsLine) {
  std::mt19937 random(23);
  for (int run = 0; run < 300; ++run) {
    PowerCut cut;
    std::set<std::string_view> running;
    std::set<std::string> held;  // lines, as the worker has them
    std::deque<PowerAction> jobs;
    const auto attended = [&](std::string_view payload) { return running.contains(payload); };
    const auto apply = [&](const PowerActions& actions) {
      for (const PowerAction& action : actions) {
        const bool is_job =
            std::holds_alternative<CutPower>(action) || std::holds_alternative<GiveBackLines>(action);
        if (is_job) jobs.push_back(action);
      }
      std::set<std::string> busy;
      for (const PowerAction& job : jobs) {
        const auto* const off = std::get_if<CutPower>(&job);
        const auto* const back = std::get_if<GiveBackLines>(&job);
        ASSERT_TRUE(busy.insert((off != nullptr ? off->peripheral : back->peripheral).payload).second);
      }
    };
    const auto work = [&] {
      const PowerAction job = jobs.front();
      jobs.pop_front();
      if (const auto* const off = std::get_if<CutPower>(&job)) {
        const suite::Peripheral& peripheral = off->peripheral;
        if (random() % 5 == 0) return cut.on_refused(peripheral);
        if (attended(peripheral.payload)) return apply(cut.on_cut(peripheral, attended_again));
        const bool opens = held.contains(peripheral.payload) || random() % 4 != 0;
        if (opens) held.insert(peripheral.payload);
        return apply(cut.on_cut(peripheral, opens ? is_off : failed(hw::GpioError::gone)));
      }
      const suite::Peripheral& peripheral = std::get<GiveBackLines>(job).peripheral;
      if (random() % 5 == 0) return cut.on_refused(peripheral);
      held.erase(peripheral.payload);
      cut.on_given_back(peripheral);
    };
    for (int step = 0; step < 400; ++step) {
      const suite::Peripheral& peripheral = peripherals.at(random() % peripherals.size());
      switch (random() % 4) {
        case 0:
          if (!running.erase(peripheral.payload)) running.insert(peripheral.payload);
          break;
        case 1:
          if (!attended(peripheral.payload)) apply(cut.cut(peripheral));
          break;
        case 2:
          apply(cut.give_back(attended));
          break;
        default:
          if (!jobs.empty()) work();
      }
      if (testing::Test::HasFatalFailure()) return;
    }
    for (const suite::Peripheral& peripheral : peripherals) running.insert(peripheral.payload);
    for (int i = 0; i < 200; ++i) {
      apply(cut.give_back(attended));
      if (!jobs.empty()) work();
    }
    EXPECT_TRUE(held.empty()) << "a payload that is back switches its peripheral on";
  }
}

}  // namespace
}  // namespace srfs
