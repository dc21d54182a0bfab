// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "nodes/maintenance/fault_line.hpp"

#include <gtest/gtest.h>

namespace srfs {
namespace {

TEST(FaultLine, CarriesWhatTheLedgerSaysAndMarksDurationsThatItDidNotComeTo) {
  suite::FaultRecord record;
  record.sequence = 7;
  record.utc = UtcTime(seconds(1'795'000'000));
  record.observer = "payload_eps";
  record.subject = "payload_thermal";
  record.fault = suite::FaultClass::silent;
  record.misses = 3;
  record.outcome = suite::RestartOutcome::What::backing_off;
  record.judged = milliseconds(312);

  const mission::RingFaultHousekeeping line = to_mission(record);

  EXPECT_EQ(line.sequence, 7U);
  EXPECT_EQ(line.utc_s, 1'795'000'000U);
  EXPECT_FALSE(line.recovered);
  EXPECT_EQ(line.fault, mission::NodeFault::silent);
  EXPECT_EQ(line.outcome, mission::RestartOutcome::backing_off);
  EXPECT_EQ(line.judged_ms, 312U);
  EXPECT_EQ(line.killed_ms, 4294967295U);
}

TEST(FaultLine, CutsTextsThatAreTooLongAndStillEncodes) {
  suite::FaultRecord record;
  record.observer = record.subject = record.cause = record.detail = std::string(500, 'x');

  const auto decoded = mission::RingFaultHousekeeping::decode(to_mission(record).encoded());

  ASSERT_TRUE(decoded);
  EXPECT_EQ(decoded->node, std::string(32, 'x'));
  EXPECT_EQ(decoded->detail, std::string(60, 'x'));
}

TEST(FaultLine, OfARecoveryNamesNoOutcomeOfAnAccusation) {
  suite::FaultRecord record;
  record.kind = suite::FaultRecord::Kind::active;
  record.active = milliseconds(150);

  const mission::RingFaultHousekeeping line = to_mission(record);

  EXPECT_TRUE(line.recovered);
  EXPECT_EQ(line.outcome, mission::RestartOutcome::none);
  EXPECT_EQ(line.active_ms, 150U);
}

}  // namespace
}  // namespace srfs
