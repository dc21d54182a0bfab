// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "programs/srfs/busy_machine.hpp"

namespace srfs::tool {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;

TEST(BusyMachine, TheAdviceNamesTheUsersAndWhatToDo) {
  const auto advice = advice_on({2, 17.8, 0.93, {{"cc1plus", 8, 1.7, 7}, {"ttc_node", 1, 0.1, 9}}});
  EXPECT_THAT(
      advice,
      ElementsAre(
          "the machine is busy: load average 17.8 on 2 CPUs; programs waited for a CPU in 93 % of "
          "the last 10 s",
          "the largest users of the CPUs (100 %: one CPU): cc1plus (8 processes) 170 %, ttc_node 10 %",
          HasSubstr("close some of these programs, or wait and try again")));
}

TEST(BusyMachine, ProgramsThatWaitAlthoughCpusAreFreeMakeItBusy) {
  EXPECT_THAT(advice_on({64, 3.0, 0.93, {}}).front(), HasSubstr("the machine is busy"))
      << "a quota, or pinned CPUs";
}

TEST(BusyMachine, AnIdleMachineIsNotToBlame) {
  const auto advice = advice_on({4, 0.3, std::nullopt, {}});
  EXPECT_THAT(advice, ElementsAre("the machine is not busy: load average 0.3 on 4 CPUs", HasSubstr("logs")));
}

}  // namespace
}  // namespace srfs::tool
