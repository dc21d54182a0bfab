// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "programs/rescue/rescue_order.hpp"

#include <random>

#include <gtest/gtest.h>

#include "wire/pus.hpp"

namespace srfs::rescue {
namespace {

template <class Command>
Octets packet_of(const Command& command) {
  OctetWriter content;
  content.u16(Command::function_id);
  content.bytes(command.encoded());
  return wire::make_tc_packet(
      {.apid = Command::apid, .service = 8, .subtype = 1, .application = content.take()});
}

TEST(RescueOrders, APingToTtcIsAnswered) {
  const auto judged = judge(wire::make_tc_packet({.apid = 1, .service = 17, .subtype = 1, .source_id = 7}));
  ASSERT_FALSE(judged.refusal);
  EXPECT_TRUE(std::holds_alternative<Ping>(judged.order));
  EXPECT_EQ(judged.origin.source_id, 7);
}

TEST(RescueOrders, EveryTelecommandOfRescueIsRead) {
  const auto restore = judge(packet_of(mission::RescueRestore{.file = "new", .target = "state/x"}));
  ASSERT_TRUE(std::holds_alternative<mission::RescueRestore>(restore.order));
  EXPECT_EQ(std::get<mission::RescueRestore>(restore.order).target, "state/x");
  const auto reset = judge(packet_of(mission::RescueReset{.part = mission::RescuePart::stores}));
  ASSERT_TRUE(std::holds_alternative<mission::RescueReset>(reset.order));
  const auto keys = judge(packet_of(mission::TtcSelectKeys{.vc = 0, .set = mission::KeySet::b}));
  EXPECT_TRUE(std::holds_alternative<mission::TtcSelectKeys>(keys.order));
  const auto list = judge(wire::make_tc_packet({.apid = 1,
                                                .service = 23,
                                                .subtype = mission::FileList::subtype,
                                                .application = mission::FileList{.most = 9}.encoded()}));
  EXPECT_TRUE(std::holds_alternative<FileOrder>(list.order));
}

TEST(RescueOrders, WhatOnlyTheSuiteDoesIsRefusedWithItsReason) {
  using namespace mission;
  EXPECT_EQ(judge(packet_of(RingHold{.node = "timing"})).refusal->code, failure::unknown_apid);
  EXPECT_EQ(judge(packet_of(RingHold{.node = "timing"})).refusal->stage, Stage::routing);
  EXPECT_EQ(judge(packet_of(TtcTransmitterOff{.duration_s = 9})).refusal->code, failure::unknown_function);
  EXPECT_EQ(judge(wire::make_tc_packet({.apid = 1, .service = 11, .subtype = 1})).refusal->code,
            failure::unknown_service);
  EXPECT_EQ(judge(wire::make_tc_packet({.apid = 1, .service = 8, .subtype = 1, .application = {0, 51, 9}}))
                .refusal->code,
            failure::bad_argument);
  EXPECT_EQ(judge(wire::make_tc_packet({.apid = 1, .service = 8, .subtype = 1, .application = {0, 51}}))
                .refusal->code,
            failure::bad_arguments_length);
}

TEST(RescueOrders, AnyOctetsAreJudgedWithoutHarm) {
  std::mt19937 random(17);
  const Octets good = packet_of(mission::RescueFetch{.path = "log/ttc.log"});
  std::size_t refused = 0;
  for (int run = 0; run < 20'000; ++run) {
    Octets octets = good;
    for (auto changes = 1 + random() % 4; changes > 0; --changes)
      octets[random() % octets.size()] = static_cast<std::uint8_t>(random());
    octets.resize(random() % 4 == 0 ? random() % (octets.size() + 1) : octets.size());
    refused += judge(octets).refusal ? 1 : 0;
  }
  EXPECT_GT(refused, 19'000U) << "the checksum catches them";
}

}  // namespace
}  // namespace srfs::rescue
