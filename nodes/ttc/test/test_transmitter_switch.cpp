// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "nodes/ttc/link/transmitter_switch.hpp"

#include <gtest/gtest.h>

namespace srfs {
namespace {

constexpr MonotonicTime start{seconds(1000)};
constexpr seconds duration{600};
const std::string boot = "boot-1";

TransmitterSwitch fresh() {
  return {boot, "", start};
}
TransmitterSwitch silent() {
  TransmitterSwitch transmitter = fresh();
  transmitter.switch_off(duration, start);
  return transmitter;
}
constexpr MonotonicTime silence = start + TransmitterSwitch::grace;

TEST(TransmitterSwitches, TransmitUntilToldOtherwise) {
  TransmitterSwitch transmitter = fresh();
  EXPECT_TRUE(transmitter.may_transmit(start));
  EXPECT_EQ(transmitter.rest(start), nanoseconds(0));
  EXPECT_FALSE(transmitter.next_due(start));
  EXPECT_EQ(transmitter.stored_text(), "");
  EXPECT_FALSE(transmitter.take_end(start + seconds(86'400)));
}

TEST(TransmitterSwitches, AreSilentForTheTimeAfterTheGraceAndThenNoMore) {
  TransmitterSwitch transmitter = silent();
  EXPECT_TRUE(transmitter.may_transmit(silence - nanoseconds(1)));
  EXPECT_EQ(transmitter.next_due(start), silence);
  EXPECT_FALSE(transmitter.may_transmit(silence));
  EXPECT_EQ(transmitter.next_due(silence), silence + duration);
  EXPECT_EQ(transmitter.rest(silence), nanoseconds(duration));
  EXPECT_FALSE(transmitter.take_end(silence + duration - nanoseconds(1)));
  EXPECT_TRUE(transmitter.may_transmit(silence + duration));
  EXPECT_TRUE(transmitter.take_end(silence + duration));
  EXPECT_FALSE(transmitter.take_end(silence + duration));
  EXPECT_EQ(transmitter.stored_text(), "");
}

TEST(TransmitterSwitches, TransmitAtOnceWhenSwitchedOn) {
  TransmitterSwitch transmitter = silent();
  transmitter.switch_on();
  EXPECT_TRUE(transmitter.may_transmit(silence));
  EXPECT_EQ(transmitter.stored_text(), "");
}

TEST(TransmitterSwitches, ANewTimeInASilenceHasNoGrace) {
  TransmitterSwitch transmitter = silent();
  transmitter.switch_off(seconds(10), silence + seconds(60));
  EXPECT_FALSE(transmitter.may_transmit(silence + seconds(60)));
  EXPECT_TRUE(transmitter.may_transmit(silence + seconds(70)));
}

TEST(TransmitterSwitches, GoOnAfterARestartOfTheNode) {
  const TransmitterSwitch transmitter(boot, silent().stored_text(), silence + seconds(100));
  EXPECT_FALSE(transmitter.may_transmit(silence + seconds(100)));
  EXPECT_EQ(transmitter.rest(silence + seconds(100)), nanoseconds(seconds(500)));
  EXPECT_TRUE(
      TransmitterSwitch(boot, silent().stored_text(), silence + duration).may_transmit(silence + duration));
}

TEST(TransmitterSwitches, ARestartOfTheComputerLetsTheTimeRunAnewButOnlyOnce) {
  constexpr MonotonicTime second_boot{seconds(3)};
  const TransmitterSwitch second("boot-2", silent().stored_text(), second_boot);
  EXPECT_FALSE(second.may_transmit(second_boot));
  EXPECT_EQ(second.rest(second_boot), nanoseconds(duration));
  const TransmitterSwitch again("boot-2", second.stored_text(), second_boot + seconds(1));
  EXPECT_FALSE(again.may_transmit(second_boot + seconds(1)));
  EXPECT_TRUE(TransmitterSwitch("boot-3", again.stored_text(), second_boot).may_transmit(second_boot));
}

TEST(TransmitterSwitches, ADamagedRecordSilencesNobody) {
  const std::string stored = silent().stored_text();
  for (std::size_t i = 0; i < stored.size(); ++i) {
    std::string damaged = stored;
    damaged[i] = static_cast<char>(damaged[i] ^ 1);
    EXPECT_TRUE(TransmitterSwitch(boot, damaged, silence).may_transmit(silence)) << i;
    EXPECT_TRUE(TransmitterSwitch(boot, stored.substr(0, i), silence).may_transmit(silence)) << i;
  }
}

}  // namespace
}  // namespace srfs
