// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "nodes/ttc/report/beacon_builder.hpp"
#include "tests/mission_dictionary.hpp"

#include <cmath>

#include <gtest/gtest.h>

#include <mission/structures.hpp>

namespace srfs {
namespace {

class Beacon : public testing::Test {
 protected:
  [[nodiscard]] mission::Beacon built(MonotonicTime now = {}) const {
    const Octets octets = builder_.build(inputs_, now);
    OctetReader reader(octets);
    auto beacon = mission::Beacon::decode(reader);
    EXPECT_TRUE(beacon);
    return beacon.value_or(mission::Beacon{});
  }
  const mission::Dictionary& dictionary_ = testing_support::dictionary();
  BeaconBuilder builder_{dictionary_};
  BeaconInputs inputs_;
};

TEST_F(Beacon, FitsInto200OctetsWithEveryFieldAtItsLongest) {
  inputs_.mode_reason = std::string(80, 'x');
  EXPECT_LE(builder_.build(inputs_, {}).size() + 25, 200U) << "with structure id and packet headers";
}

TEST_F(Beacon, CarriesTheWholeReasonOfTheMode) {
  inputs_.mode_reason = std::string(ModeManager::longest_reason, 'x');
  EXPECT_EQ(built().mode_reason, inputs_.mode_reason);
}

TEST_F(Beacon, SaysUnknownForWhatNobodyTold) {
  const mission::Beacon beacon = built();
  EXPECT_TRUE(std::isnan(beacon.battery_voltage_v));
  EXPECT_TRUE(std::isnan(beacon.temperature_max_k));
  EXPECT_EQ(beacon.reset_cause, mission::ResetCause::unknown);
  EXPECT_EQ(beacon.last_telecommand_outcome, mission::TelecommandOutcome::none);
  for (const auto state : beacon.node_state) EXPECT_EQ(state, mission::LifecycleState::absent);
}

TEST_F(Beacon, CarriesWhatTheNodesReportedUntilItIsTooOld) {
  mission::PayloadEpsHousekeeping eps;
  eps.measurement.battery_voltage_v = 7.5F;
  eps.measurement.state_of_charge = 0.5F;
  builder_.on_telemetry("payload_eps", mission::PayloadEpsHousekeeping::structure_id, eps.encoded(),
                        MonotonicTime{});

  EXPECT_NEAR(built().battery_voltage_v, 7.5, 0.001);
  EXPECT_NEAR(built().battery_charge, 50, 0.5);
  EXPECT_TRUE(std::isnan(built(MonotonicTime(seconds(61))).battery_voltage_v));
}

TEST_F(Beacon, TellsTheBootAsTimingDoesAndBeforeThatAsItWasFoundOnDisk) {
  inputs_.boot = {.count = 4, .cause = mission::ResetCause::unknown};
  mission::TimingHousekeeping timing;
  builder_.on_telemetry("timing", mission::TimingHousekeeping::structure_id, timing.encoded(), {});
  EXPECT_EQ(built().boot_count, 4U) << "timing does not know it yet";

  timing.boot_count = 5;
  timing.reset_cause = mission::ResetCause::watchdog;
  builder_.on_telemetry("timing", mission::TimingHousekeeping::structure_id, timing.encoded(), {});
  EXPECT_EQ(built().boot_count, 5U);
  EXPECT_EQ(built().reset_cause, mission::ResetCause::watchdog);
}

TEST_F(Beacon, TellsTheNodesInApidOrder) {
  builder_.on_facts("payload_eps", {.running = true, .restarts = 2, .version = "1.2.3"});
  builder_.on_lifecycle("payload_eps", 3);
  builder_.on_facts("timing", {.running = true, .restarts = 0, .version = ""});

  const mission::Beacon beacon = built();

  EXPECT_EQ(beacon.node_state[4], mission::LifecycleState::active);
  EXPECT_EQ(beacon.node_restarts[4], 2);
  EXPECT_EQ(beacon.node_version[4], 1 << 12 | 2 << 6 | 3);
  EXPECT_EQ(beacon.node_state[1], mission::LifecycleState::transition);
  EXPECT_EQ(builder_.nodes_to_ask(), std::vector<std::string>{"timing"});
}

TEST_F(Beacon, ANodeThatDiedIsAbsentAndItsStateForgotten) {
  builder_.on_facts("timing", {.running = true, .restarts = 0, .version = "0.1.0"});
  builder_.on_lifecycle("timing", 3);
  builder_.on_facts("timing", {.running = false, .restarts = 0, .version = ""});
  EXPECT_EQ(built().node_state[1], mission::LifecycleState::absent);
  builder_.on_facts("timing", {.running = true, .restarts = 1, .version = "0.1.0"});
  EXPECT_EQ(built().node_state[1], mission::LifecycleState::transition);
}

TEST(PackedVersion, IsZeroForWhatIsNoVersion) {
  EXPECT_EQ(packed_version("0.1.0"), 1 << 6);
  EXPECT_EQ(packed_version(""), 0);
  EXPECT_EQ(packed_version("1.2"), 0);
  EXPECT_EQ(packed_version("16.0.0"), 0);
}

}  // namespace
}  // namespace srfs
