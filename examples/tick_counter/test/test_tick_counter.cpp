// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "tick_counter.hpp"

#include <gtest/gtest.h>

namespace srfs {
namespace {

TEST(TickCounter, ReportsEverySoManyTicks) {
  TickCounter counter;
  EXPECT_FALSE(counter.on_tick(3));
  EXPECT_FALSE(counter.on_tick(3));

  const auto event = counter.on_tick(3);

  ASSERT_TRUE(event);
  EXPECT_EQ(event->ticks, 3U);
  EXPECT_EQ(counter.housekeeping(7).cycle, 7U);
  EXPECT_EQ(counter.housekeeping(7).ticks, 3U);
}

TEST(TickCounter, CountsFromZeroAgainWhenItIsCleared) {
  TickCounter counter;
  std::ignore = counter.on_tick(100);
  const std::uint16_t clear = mission::TickCounterClear::function_id;
  EXPECT_EQ(TickCounter::Commands::check(clear, {}), mission::failure::none);

  EXPECT_EQ(TickCounter::Commands::execute(counter, clear, {}), mission::failure::none);

  EXPECT_EQ(counter.housekeeping(1).ticks, 0U);
  EXPECT_EQ(counter.housekeeping(1).clears, 1U);
}

TEST(TickCounter, RefusesTelecommandsThatTheDictionaryDoesNotHave) {
  EXPECT_EQ(TickCounter::Commands::check(77, {}), mission::failure::unknown_function);
  EXPECT_EQ(TickCounter::Commands::check(mission::TickCounterClear::function_id, Octets{1}),
            mission::failure::bad_arguments_length);
}

TEST(TickCounter, KeepsWhatSetStartBrings) {
  TickCounter logic;
  using Command = mission::TickCounterSetStart;
  const Octets arguments = Command{.value = 5}.encoded();
  ASSERT_EQ(TickCounter::Commands::check(Command::function_id, arguments), mission::failure::none);

  EXPECT_EQ(TickCounter::Commands::execute(logic, Command::function_id, arguments), mission::failure::none);

  EXPECT_EQ(logic.set_start(), 5U);
  EXPECT_EQ(TickCounter::Commands::check(Command::function_id, Command{.value = 0}.encoded()),
            mission::failure::bad_argument);
}

}  // namespace
}  // namespace srfs
