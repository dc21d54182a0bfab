// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "suite/commanding/command_set.hpp"

#include <gtest/gtest.h>

namespace srfs {
namespace {

using Set = CommandSet<mission::EpsSwitchLoad, mission::EpsResetPeripheral>;

struct Executor {
  int switched = 0;
  int reset = 0;
  FailureCode execute(const mission::EpsSwitchLoad& command) {
    switched += command.load;
    return mission::failure::none;
  }
  FailureCode execute(const mission::EpsResetPeripheral& /*command*/) {
    ++reset;
    return mission::failure::peripheral_off;
  }
};

TEST(CommandSet, ChecksATelecommandByItsStructAndExecutesNothing) {
  const Octets good = mission::EpsSwitchLoad{.load = 2, .state = mission::SwitchState::on}.encoded();
  EXPECT_EQ(Set::check(mission::EpsSwitchLoad::function_id, good), mission::failure::none);
  EXPECT_EQ(Set::check(mission::EpsSwitchLoad::function_id, Octets{7, 1}), mission::failure::bad_argument);
  EXPECT_EQ(Set::check(mission::EpsSwitchLoad::function_id, {}), mission::failure::bad_arguments_length);
  EXPECT_EQ(Set::check(999, {}), mission::failure::unknown_function);
}

TEST(CommandSet, ExecutesTheOneWithTheFunctionAndReturnsItsOutcome) {
  Executor executor;
  const Octets good = mission::EpsSwitchLoad{.load = 2, .state = mission::SwitchState::on}.encoded();

  EXPECT_EQ(Set::execute(executor, mission::EpsSwitchLoad::function_id, good), mission::failure::none);
  EXPECT_EQ(Set::execute(executor, mission::EpsResetPeripheral::function_id, {}),
            mission::failure::peripheral_off);

  EXPECT_EQ(executor.switched, 2);
  EXPECT_EQ(executor.reset, 1);
}

TEST(CommandSet, DoesNotExecuteWhatItsCheckRefuses) {
  Executor executor;
  EXPECT_EQ(Set::execute(executor, mission::EpsSwitchLoad::function_id, Octets{7, 1}),
            mission::failure::bad_argument);
  EXPECT_EQ(Set::execute(executor, 999, {}), mission::failure::unknown_function);
  EXPECT_EQ(executor.switched + executor.reset, 0);
}

}  // namespace
}  // namespace srfs
