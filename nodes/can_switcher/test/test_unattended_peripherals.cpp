// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include "nodes/can_switcher/test/placed_peripherals.hpp"
#include "nodes/can_switcher/unattended_peripherals.hpp"

namespace srfs {
namespace {

constexpr std::uint32_t from_eps = 0x18DA0112;

struct Unattended : ::testing::Test {
  UnattendedPeripherals peripherals;
  MonotonicTime now{seconds(30)};
  bool attended = false;
  int questions = 0;

  void SetUp() override { peripherals.place({adcs, eps}); }
  void hear(int frames, std::uint32_t id = from_eps, nanoseconds distance = microseconds(300)) {
    for (int i = 0; i < frames; ++i) peripherals.on_frame(id, true, now += distance);
  }
  std::vector<std::string> babbling() {
    std::vector<std::string> payloads;
    for (const suite::Peripheral& p : peripherals.babbling([this](std::string_view) {
           ++questions;
           return attended;
         }))
      payloads.push_back(p.payload);
    return payloads;
  }
};
using UnattendedPeripheralsTest = Unattended;

TEST_F(UnattendedPeripheralsTest, NamesThePayloadThatHasNoProcessAndWhosePeripheralNeverStops) {
  hear(65);
  EXPECT_TRUE(babbling().empty()) << "these may be older than the end of the process";
  hear(64);
  EXPECT_TRUE(babbling().empty());
  hear(1);
  EXPECT_EQ(babbling(), std::vector<std::string>{"payload_eps"});
  EXPECT_TRUE(babbling().empty()) << "once";
}

TEST_F(UnattendedPeripheralsTest, KnowsAPeripheralWithItsOwnProtocolByItsAnswers) {
  peripherals.place({{"payload_radiation", 0x21, 3, "can", {0x3A1}}});
  for (int turn = 0; turn < 2; ++turn) {
    for (int i = 0; i < 65; ++i) peripherals.on_frame(0x3A1, false, now += microseconds(300));
    const auto found = babbling();
    EXPECT_EQ(found.size(), turn == 0 ? 0U : 1U);
  }
}

TEST_F(UnattendedPeripheralsTest, NamesItAgainWhenItWasNotSwitchedOff) {
  for (int i = 0; i < 2; ++i, hear(65)) (void)babbling();
  EXPECT_EQ(babbling().size(), 1U);
  hear(65);
  EXPECT_EQ(babbling().size(), 1U);
}

TEST_F(UnattendedPeripheralsTest, LeavesItToThePayloadThatHasAProcess) {
  attended = true;
  for (int i = 0; i < 10; ++i) {
    hear(200);
    EXPECT_TRUE(babbling().empty());
  }
  attended = false;
  hear(65);
  EXPECT_TRUE(babbling().empty()) << "it ended just now";
}

TEST_F(UnattendedPeripheralsTest, AsksNobodyAboutTheRestOfAnAnswerOrAFewFramesNowAndThen) {
  hear(64);
  (void)babbling();
  hear(1000, from_eps, milliseconds(60));
  (void)babbling();
  EXPECT_EQ(questions, 0);
}

TEST_F(UnattendedPeripheralsTest, CountsOnForAPeripheralThatStaysAndForgetsOneThatLeft) {
  hear(65);
  (void)babbling();
  hear(40);
  peripherals.place({eps, {"payload_new", 0x22, 3}});
  hear(40);
  EXPECT_EQ(babbling(), std::vector<std::string>{"payload_eps"});
  hear(40);
  peripherals.place({adcs});
  hear(200);
  EXPECT_TRUE(babbling().empty());
  peripherals.place({adcs, eps});
  hear(64);
  EXPECT_TRUE(babbling().empty());
}

TEST_F(UnattendedPeripheralsTest, DoesNotTakeOtherFramesForAPeripherals) {
  for (int i = 0; i < 3; ++i) {
    hear(100, 0x18DA1201);
    hear(100, 0x18DA0119);
    hear(100, 0x18DA1112);
    for (int k = 0; k < 100; ++k) peripherals.on_frame(from_eps & 0x7FFU, false, now);
    EXPECT_TRUE(babbling().empty());
  }
  EXPECT_EQ(questions, 0);
}

}  // namespace
}  // namespace srfs
