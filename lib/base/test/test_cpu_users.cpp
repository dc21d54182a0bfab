// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "base/cpu_users.hpp"

#include <gtest/gtest.h>

namespace srfs {
namespace {

TEST(CpuUsers, ReadsNameAndTimeOfAProcessWhateverItsName) {
  const auto process =
      parse_process_stat("42 (a (b) c) S 1 42 42 0 -1 4194560 100 0 0 0 250 50 0 0 20 0 1 0 12345 1000 10");
  ASSERT_TRUE(process);
  EXPECT_EQ(process->name, "a (b) c");
  EXPECT_EQ(process->ticks, 300U);
  EXPECT_FALSE(parse_process_stat("42 (cut"));
  EXPECT_FALSE(parse_process_stat("42 (cut) S 1 2"));
  EXPECT_FALSE(parse_process_stat(""));
}

TEST(CpuUsers, AddsUpProcessesOfOneNameAndLeavesOutWhoDoesLittle) {
  const ProcessTable before{
      {1, {"idle", 500}}, {2, {"cc1plus", 10}}, {3, {"cc1plus", 20}}, {4, {"old", 900}}};
  const ProcessTable after{
      {1, {"idle", 501}}, {2, {"cc1plus", 60}}, {3, {"cc1plus", 95}}, {4, {"new", 30}}, {5, {"ld", 60}}};
  const auto users = largest_cpu_users(before, after, seconds(1));
  EXPECT_EQ(to_text(users), "cc1plus (2 processes) 125 %, ld 60 %, new 30 %");
  EXPECT_EQ(users.at(0).largest, 3);
  EXPECT_EQ(users.at(1).largest, 5);
  EXPECT_EQ(to_text(largest_cpu_users(before, after, seconds(1), 1)), "cc1plus (2 processes) 125 %");
  EXPECT_EQ(to_text(largest_cpu_users(before, before, seconds(1))), "");
}

TEST(CpuUsers, ReadsThePressureWhereTheKernelTells) {
  EXPECT_NEAR(parse_pressure("some avg10=85.20 avg60=40.00 avg300=9.00 total=1\n").value_or(0), 0.852, 1e-9);
  EXPECT_FALSE(parse_pressure(""));
  EXPECT_FALSE(parse_pressure("full avg10=1.00"));
  EXPECT_FALSE(parse_pressure("some avg10=-3 avg60=1"));
  EXPECT_FALSE(parse_pressure("some avg10=nan"));
}

}  // namespace
}  // namespace srfs
