// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "suite/commanding/command_proof.hpp"

#include <functional>
#include <vector>

#include <gtest/gtest.h>

#include "base/octets.hpp"
#include "base/rejection_log.hpp"
#include "base/sha256.hpp"
#include "base/text.hpp"

namespace srfs {
namespace {

using srfs_msgs::msg::Telecommand;
using srfs_msgs::msg::TelecommandReport;

const suite::CommandKey key{1, 2, 3};
const suite::CommandKey other_key{1, 2, 4};

Telecommand signed_telecommand() {
  Telecommand m;
  m.id = 7;
  m.target = "payload_eps";
  m.apid = 17;
  m.function_id = 5;
  m.repeat_class = 3;
  m.expiry_ns = 1'000'000;
  m.arguments = {1, 2, 3};
  m.proof = prove(key, m);
  return m;
}

TEST(Hmac, IsThatOfTheStandard) {
  // RFC 4231, test case 2.
  EXPECT_EQ(to_digits(hmac_sha256(as_octets("Jefe"), as_octets("what do ya want for nothing?"))),
            "5bdcc146bf60754e6a042426089575c75a003f089d2739839dec58b964ec3843");
}

TEST(CommandProof, OfTtcIsAccepted) {
  EXPECT_EQ(rejection_of(&key, signed_telecommand()), std::nullopt);
}

TEST(CommandProof, IsWorthlessForAnyOtherTelecommandAndForAnotherNodesKey) {
  const std::vector<std::function<void(Telecommand&)>> changes{
      [](Telecommand& m) { ++m.id; },
      [](Telecommand& m) { m.target = "payload_adcs"; },
      [](Telecommand& m) { ++m.apid; },
      [](Telecommand& m) { ++m.function_id; },
      [](Telecommand& m) { m.repeat_class = 1; },
      [](Telecommand& m) { ++m.expiry_ns; },
      [](Telecommand& m) { m.expiry_ns = 0; },
      [](Telecommand& m) { m.arguments.push_back(0); },
      [](Telecommand& m) { m.arguments.pop_back(); },
      [](Telecommand& m) { m.arguments[1] ^= 1; },
      [](Telecommand& m) { m.proof[15] ^= 1; }};
  for (const auto& change : changes) {
    Telecommand m = signed_telecommand();
    change(m);
    EXPECT_EQ(rejection_of(&key, m), Rejection::wrong_proof);
  }
  EXPECT_EQ(rejection_of(&other_key, signed_telecommand()), Rejection::wrong_proof);
}

TEST(CommandProof, MayNotBeMissingAndLastsNoLongerThanAnExpiry) {
  Telecommand m = signed_telecommand();
  m.proof = {};
  EXPECT_EQ(rejection_of(&key, m), Rejection::no_proof);
  EXPECT_EQ(rejection_of(nullptr, signed_telecommand()), Rejection::no_key);
  m.expiry_ns = 0;
  m.proof = prove(key, m);
  EXPECT_EQ(rejection_of(&key, m), Rejection::no_expiry);
}

TEST(CommandProof, OfAReportIsWorthlessForAnotherReportAndAnotherNode) {
  TelecommandReport m;
  m.id = 7;
  m.node = "payload_eps";
  m.stage = TelecommandReport::COMPLETED;
  m.success = true;
  m.data = {1};
  m.proof = prove(key, m);
  EXPECT_TRUE(is_proven(key, m));
  EXPECT_FALSE(is_proven(other_key, m));
  const std::vector<std::function<void(TelecommandReport&)>> changes{
      [](TelecommandReport& r) { ++r.id; },
      [](TelecommandReport& r) { r.node = "payload_adcs"; },
      [](TelecommandReport& r) { ++r.node_incarnation; },
      [](TelecommandReport& r) { r.stage = TelecommandReport::STARTED; },
      [](TelecommandReport& r) { r.success = false; },
      [](TelecommandReport& r) { r.failure_code = 1; },
      [](TelecommandReport& r) { r.progress_step = 1; },
      [](TelecommandReport& r) { r.monotonic_ns = 1; },
      [](TelecommandReport& r) { r.data = {2}; },
      [](TelecommandReport& r) { r.proof = {}; }};
  for (const auto& change : changes) {
    TelecommandReport changed = m;
    change(changed);
    EXPECT_FALSE(is_proven(key, changed));
  }
}

TEST(CommandProof, OfATelecommandIsNoneOfAReport) {
  Telecommand telecommand;
  TelecommandReport report;
  EXPECT_NE(prove(key, telecommand), prove(key, report));
}

TEST(RejectionLog, ReportsTheFirstAtOnceAndAFloodOnceInAWhile) {
  RejectionLog log;
  const MonotonicTime begin(seconds(100));
  EXPECT_TRUE(log.add(begin));
  EXPECT_EQ(log.due(), std::nullopt);

  EXPECT_FALSE(log.add(begin + seconds(1)));
  EXPECT_FALSE(log.add(begin + seconds(2)));
  EXPECT_EQ(log.due(), begin + RejectionLog::period);
  EXPECT_FALSE(log.on_time(begin + seconds(9)));
  EXPECT_TRUE(log.on_time(begin + RejectionLog::period));
  EXPECT_FALSE(log.on_time(begin + RejectionLog::period)) << "that is reported";
  EXPECT_EQ(log.count(), 3U);

  EXPECT_FALSE(log.add(begin + seconds(11)));
  EXPECT_TRUE(log.add(begin + seconds(21)));
}

}  // namespace
}  // namespace srfs
