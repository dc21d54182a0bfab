// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "nodes/ttc/files/file_exchange.hpp"

#include <gmock/gmock.h>

#include "wire/cfdp_pdu.hpp"
#include "wire/space_packet.hpp"

namespace srfs {
namespace {

using testing::IsEmpty;
using testing::SizeIs;

constexpr std::size_t room = 8192;
constexpr MonotonicTime start(seconds(100));

Octets packet_with(const Octets& pdu, std::uint16_t apid = wire::cfdp_apid) {
  return wire::encode_space_packet({.type = wire::PacketType::telecommand, .apid = apid}, pdu);
}

class FileExchangeTest : public testing::Test {
 protected:
  /// Runs the turn that is due. Its worker returns @p result.
  std::vector<Octets> run(cfdp::TransferTurnResult result, MonotonicTime now = start) {
    turn_ = exchange_.next_turn(room, now);
    EXPECT_TRUE(turn_);
    return exchange_.on_turn(result);
  }

  FileExchange exchange_{4096};
  std::optional<cfdp::TransferTurn> turn_;
};

TEST_F(FileExchangeTest, LooksIntoTheOutboxAtOnceAndThenPeriodically) {
  run({});
  EXPECT_TRUE(turn_->scan);
  EXPECT_EQ(exchange_.next_due(room), start + FileExchange::scan_period);
  EXPECT_FALSE(exchange_.next_turn(room, start + FileExchange::scan_period - milliseconds(1)));
  EXPECT_TRUE(exchange_.next_turn(room, start + FileExchange::scan_period)->scan);
}

TEST_F(FileExchangeTest, PdusAreHandedOnInOrderAndOnlyOneTurnRuns) {
  run({});
  exchange_.on_packet(packet_with({1, 2}));
  exchange_.on_packet(packet_with({3}));
  const auto turn = exchange_.next_turn(room, start);
  ASSERT_TRUE(turn);
  EXPECT_EQ(turn->received, (std::vector<Octets>{{1, 2}, {3}}));
  exchange_.on_packet(packet_with({4}));
  EXPECT_FALSE(exchange_.next_turn(room, start + seconds(100)));
  EXPECT_FALSE(exchange_.next_due(room));
  cfdp::TransferTurnResult done;
  static_cast<void>(exchange_.on_turn(done));
  EXPECT_EQ(exchange_.next_turn(room, start)->received, (std::vector<Octets>{{4}}));
}

TEST_F(FileExchangeTest, AFloodIsCountedAndDroppedBeyondTheQueue) {
  run({});
  for (std::size_t i = 0; i < FileExchange::received_max + 3; ++i) exchange_.on_packet(packet_with({1}));
  EXPECT_EQ(exchange_.counters().dropped, 3U);
  std::size_t handed_on = 0;
  while (true) {
    run({});
    if (turn_->received.empty()) break;
    EXPECT_LE(turn_->received.size(), FileExchange::received_per_turn);
    handed_on += turn_->received.size();
    if (handed_on == FileExchange::received_max) break;
  }
  EXPECT_EQ(handed_on, FileExchange::received_max);
}

TEST_F(FileExchangeTest, PacketsThatCarryNoPduAreCounted) {
  Octets cut = packet_with({1, 2, 3});
  cut.pop_back();
  exchange_.on_packet(cut);
  exchange_.on_packet(wire::encode_space_packet(
      {.type = wire::PacketType::telecommand, .has_secondary_header = true, .apid = wire::cfdp_apid},
      Octets{1}));
  EXPECT_EQ(exchange_.counters().malformed, 2U);
  EXPECT_THAT(exchange_.next_turn(room, start)->received, IsEmpty());
}

TEST_F(FileExchangeTest, WhatGoesOutIsNumberedPacketsOfTheApid) {
  const auto packets = run({.pdus = {{1, 2, 3}, {4}}});
  ASSERT_THAT(packets, SizeIs(2));
  const auto second = wire::decode_space_packet(packets[1]);
  ASSERT_TRUE(second);
  EXPECT_EQ(second->header,
            (wire::PacketHeader{.type = wire::PacketType::telemetry, .apid = 2045, .sequence_count = 1}));
  EXPECT_EQ(Octets(second->data.begin(), second->data.end()), (Octets{4}));
  EXPECT_EQ(exchange_.counters().sent, 2U);
}

TEST_F(FileExchangeTest, AFolderWithPdusWaitsUntilTheLineHasTakenHalfOfTheQueue) {
  run({.next_due = start});
  EXPECT_FALSE(exchange_.next_turn(4095, start));
  const auto turn = exchange_.next_turn(4096, start);
  ASSERT_TRUE(turn);
  EXPECT_EQ(turn->room_octets, 4096U);
}

TEST_F(FileExchangeTest, WhatComesUpIsHandedOnWithoutRoomForAnswers) {
  run({});
  exchange_.on_packet(packet_with({1}));
  EXPECT_EQ(exchange_.next_turn(10, start)->room_octets, 0U);
}

TEST_F(FileExchangeTest, ContactWakesFilesThatRestAndNothingElse) {
  run({});
  exchange_.on_contact();
  EXPECT_FALSE(exchange_.next_turn(room, start));
  run({.resting = 1}, start + FileExchange::scan_period);
  exchange_.on_contact();
  const auto turn = exchange_.next_turn(room, start + FileExchange::scan_period);
  ASSERT_TRUE(turn);
  EXPECT_TRUE(turn->contact);
}

TEST_F(FileExchangeTest, AWorkerWithoutRoomIsAskedAgainLater) {
  ASSERT_TRUE(exchange_.next_turn(room, start));
  exchange_.on_turn_refused(start);
  exchange_.on_packet(packet_with({1}));
  EXPECT_FALSE(exchange_.next_turn(room, start + FileExchange::retry_period - milliseconds(1)));
  EXPECT_TRUE(exchange_.next_turn(room, start + FileExchange::retry_period));
}

/// A mode that lets little down at once does not keep files, and the answers to those that come up, waiting.
TEST_F(FileExchangeTest, APduIsEnoughWhereAModeBoundsTheRoom) {
  const std::size_t pdu = FileExchange::pdu_octets_max + 6;
  run({.next_due = start});
  EXPECT_FALSE(exchange_.next_turn(FilesRoom(room, pdu - 1), start));
  EXPECT_GT(exchange_.next_due(FilesRoom(room, pdu - 1)), start);
  EXPECT_FALSE(exchange_.next_turn(FilesRoom(4095, pdu), start)) << "the queue is too full";
  const auto turn = exchange_.next_turn(FilesRoom(room, pdu), start);
  ASSERT_TRUE(turn);
  EXPECT_EQ(turn->room_octets, pdu);
}

}  // namespace
}  // namespace srfs
