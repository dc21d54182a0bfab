// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "nodes/payload/mode_orders.hpp"

#include <gtest/gtest.h>

namespace srfs {
namespace {

suite::ModeSettings settings_with(std::vector<std::string> hold) {
  suite::ModeSettings settings;
  settings.table["safe"]["payload_eps"].hold = std::move(hold);
  settings.table["nominal"];
  return settings;
}

Result<PayloadCommand, FailureCode> as_they_are(std::uint16_t function, OctetView arguments) {
  if (function == 16) return PayloadCommand(ResetPeripheral{});
  return PayloadCommand(
      PeripheralFunction{static_cast<std::uint8_t>(function), Octets(arguments.begin(), arguments.end())});
}

ModeOrders resolved(std::vector<std::string> hold) {
  static const auto dictionary = mission::Dictionary::load(mission::Dictionary::default_folder());
  return resolve_orders(dictionary, settings_with(std::move(hold)), "payload_eps", as_they_are);
}

TEST(ModeOrders, AreTelecommandsOfTheDictionaryInTheirOrder) {
  ModeOrders orders = resolved({"eps.switch_load load=2 state=off", "eps.switch_load load=3 state=on"});
  EXPECT_TRUE(orders.problems.empty());
  ASSERT_EQ(orders.modes["safe"].hold.size(), 2U);
  EXPECT_EQ(orders.modes["safe"].hold[0].function, 1);
  EXPECT_EQ(orders.modes["safe"].hold[0].arguments, (Octets{2, 0}));
  EXPECT_EQ(orders.modes["safe"].hold[1].arguments, (Octets{3, 1}));
  EXPECT_TRUE(orders.modes["nominal"].hold.empty());
}

TEST(ModeOrders, LeaveOutWhatIsNoneAndSayWhy) {
  const std::vector<std::pair<std::string, std::string>> cases{
      {"eps.switch_loat load=2 state=off", "eps.switch_loat"},
      {"eps.switch_load load=9 state=off", "range"},
      {"eps.switch_load load=2", "state"},
      {"adcs.set_mode mode=detumble", "payload_adcs"},
      {"eps.power_cycle_peripheral off_ms=200", "hazardous"},
      {"eps.reset_peripheral", "peripheral"},
      {"  ", "no telecommand"}};
  for (const auto& [order, why] : cases) {
    ModeOrders orders = resolved({order, "eps.switch_load load=2 state=off"});
    ASSERT_EQ(orders.problems.size(), 1U) << order;
    EXPECT_NE(orders.problems[0].why.find(why), std::string::npos) << orders.problems[0].why;
    EXPECT_EQ(orders.modes["safe"].hold.size(), 1U) << order;
  }
}

TEST(OnceDoneTest, TheModeOfTheFirstStartChangesNothingUnlessTheNodeDidSomethingByItself) {
  OnceDone done(std::nullopt);
  EXPECT_TRUE(done.is_of(0));
  EXPECT_TRUE(done.set(std::nullopt));  // by itself
  EXPECT_FALSE(done.is_of(0));
  const OnceDone restarted(done.stored_text());
  EXPECT_FALSE(restarted.is_of(0));
  EXPECT_TRUE(done.set(0));
  EXPECT_TRUE(OnceDone(done.stored_text()).is_of(0));
}

TEST(OnceDoneTest, IsKeptAcrossRestartsAndDamageMeansThatNothingIsDone) {
  OnceDone done;
  EXPECT_TRUE(done.set(7));
  EXPECT_FALSE(done.set(7));
  EXPECT_TRUE(OnceDone(done.stored_text()).is_of(7));
  EXPECT_FALSE(OnceDone(done.stored_text()).is_of(8));
  EXPECT_FALSE(OnceDone("").is_of(0));
  EXPECT_FALSE(OnceDone("x").is_of(0));
}

}  // namespace
}  // namespace srfs
