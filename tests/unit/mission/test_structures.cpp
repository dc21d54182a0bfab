// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include <cmath>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <mission/structures.hpp>

namespace srfs::mission {
namespace {

TEST(GeneratedStructures, PackTheMeasurementBlockAsThePeripheralSendsIt) {
  EpsMeasurement block;
  block.battery_voltage_v = 7.5F;
  block.load_switches = 0b0101;
  block.load_current_a = {1, 2, 3, 4};

  const Octets octets = block.encoded();

  EXPECT_EQ(octets.size(), 6 * 4 + 1 + 4 * 4U);
  EXPECT_EQ(octets.size(), EpsMeasurement::max_size);
  EXPECT_EQ(to_hex(OctetView(octets).first(4)), "40f00000");
  EXPECT_EQ(octets[24], 0b0101);
  EXPECT_EQ(AdcsMeasurement::max_size, (4 + 3 + 3 + 3 + 3) * 4 + 1U);
  EXPECT_EQ(ThermalMeasurement::max_size, 6 * 4 + 1 + 2 * 4U);
}

TEST(GeneratedStructures, ReadBackWhatTheyWrote) {
  PayloadAdcsHousekeeping housekeeping;
  housekeeping.cycle = 0x0102030405060708;
  housekeeping.measurement.attitude = {0.1F, 0.2F, 0.3F, 0.9F};
  housekeeping.measurement.mode = AdcsMode::point;
  housekeeping.in_eclipse = true;
  housekeeping.slots.telecommands_executed = 77;

  const Octets octets = housekeeping.encoded();

  EXPECT_EQ(octets.size(), PayloadAdcsHousekeeping::max_size);
  EXPECT_EQ(PayloadAdcsHousekeeping::decode(OctetView(octets)), housekeeping);
}

TEST(GeneratedStructures, RefuseOctetsThatAreMissingOrLeftOver) {
  Octets octets = TimingHousekeeping{}.encoded();
  octets.push_back(0);
  EXPECT_FALSE(TimingHousekeeping::decode(OctetView(octets)));
  for (std::size_t size = 0; size + 1 < octets.size(); ++size) {
    EXPECT_FALSE(TimingHousekeeping::decode(OctetView(octets).first(size))) << size;
  }
}

TEST(GeneratedStructures, KeepTheBeaconWithinTwoHundredOctets) {
  static_assert(Beacon::max_size <= 200);
  Beacon beacon;
  beacon.mode_reason = std::string(100, 'x');
  beacon.battery_voltage_v = 7.412F;
  beacon.battery_charge = 71.5F;
  beacon.temperature_min_k = NAN;
  beacon.node_state[8] = LifecycleState::active;

  const Octets octets = beacon.encoded();
  const auto read = Beacon::decode(OctetView(octets));

  ASSERT_TRUE(read);
  EXPECT_EQ(octets.size(), Beacon::max_size);
  EXPECT_EQ(read->mode_reason, std::string(54, 'x'));
  EXPECT_NEAR(read->battery_voltage_v, 7.412F, 0.0006F);
  EXPECT_FLOAT_EQ(read->battery_charge, 71.5F);
  EXPECT_TRUE(std::isnan(read->temperature_min_k));
  EXPECT_EQ(read->node_state[8], LifecycleState::active);
}

TEST(GeneratedStructures, SaturateCalibratedValuesWithoutSayingUnknown) {
  Beacon beacon;
  beacon.battery_voltage_v = 1e9F;
  beacon.battery_temperature_k = -40;
  const auto read = Beacon::decode(OctetView(beacon.encoded()));
  ASSERT_TRUE(read);
  EXPECT_NEAR(read->battery_voltage_v, 65.534F, 0.001F);
  EXPECT_FLOAT_EQ(read->battery_temperature_k, 0);
}

TEST(GeneratedArguments, RoundTrip) {
  const AdcsSetWheelSpeed command{.wheel = 2, .speed_rad_s = -12.5F};
  const auto read = AdcsSetWheelSpeed::decode(command.encoded());
  ASSERT_TRUE(read);
  EXPECT_EQ(*read, command);
  EXPECT_EQ(to_hex(EpsSwitchLoad{.load = 3, .state = SwitchState::on}.encoded()), "0301");
}

TEST(GeneratedArguments, NameTheArgumentThatIsOutOfRange) {
  EXPECT_EQ(EpsSwitchLoad::decode(Octets{4, 1}).error(), ArgumentError{1});
  EXPECT_EQ(EpsSwitchLoad::decode(Octets{3, 2}).error(), ArgumentError{2});
  EXPECT_EQ(
      ThermalSetSetpoint::decode((ThermalSetSetpoint{.heater = 0, .setpoint_k = 320.5F}).encoded()).error(),
      ArgumentError{2});
  EXPECT_EQ(
      ThermalSetSetpoint::decode((ThermalSetSetpoint{.heater = 0, .setpoint_k = NAN}).encoded()).error(),
      ArgumentError{2});
}

TEST(GeneratedArguments, CallAWrongLengthNoArgument) {
  EXPECT_EQ(EpsSwitchLoad::decode(Octets{3}).error(), ArgumentError{0});
  EXPECT_EQ(EpsSwitchLoad::decode(Octets{3, 1, 0}).error(), ArgumentError{0});
  EXPECT_EQ(AdcsResetPeripheral::decode(Octets{0}).error(), ArgumentError{0});
  EXPECT_TRUE(AdcsResetPeripheral::decode(Octets{}));
}

TEST(GeneratedArguments, CarryACountBeforeRepeatedGroups) {
  const Octets two = HousekeepingSetInterval::encoded(
      {{.structure = 16, .interval_ms = 1000}, {.structure = 17, .interval_ms = 500}});
  EXPECT_EQ(to_hex(two),
            "0002"
            "0010000003e8"
            "0011000001f4");
  const auto read = HousekeepingSetInterval::decode(two);
  ASSERT_TRUE(read);
  EXPECT_EQ(read->size(), 2U);
  EXPECT_EQ(read->at(1).interval_ms, 500U);

  EXPECT_EQ(HousekeepingSetInterval::decode(Octets{0, 0}).error(), ArgumentError{0});
  EXPECT_EQ(HousekeepingSetInterval::decode(*from_hex("0001"
                                                      "0010"
                                                      "00000001"))
                .error(),
            ArgumentError{2});
  EXPECT_EQ(HousekeepingSetInterval::decode(*from_hex("ffff"
                                                      "0010"
                                                      "00000001"))
                .error(),
            ArgumentError{0});
}

TEST(GeneratedArguments, ReadTimesOfTheLink) {
  const StorageRetrieve command{.store = store::housekeeping,
                                .from = to_tai(*from_iso8601("2026-11-21T08:00:00Z")),
                                .to = to_tai(*from_iso8601("2026-11-21T08:00:00.5Z"))};
  const Octets octets = StorageRetrieve::encoded({command});
  EXPECT_EQ(to_hex(octets),
            "0001"
            "0001"
            "1f8193ae25000000"
            "1f8193ae25800000");
  ASSERT_TRUE(StorageRetrieve::decode(octets));
  EXPECT_EQ(StorageRetrieve::decode(octets)->at(0), command);

  Octets bad = octets;
  bad[4] = 0x2f;
  EXPECT_EQ(StorageRetrieve::decode(bad).error(), ArgumentError{2});
  EXPECT_EQ(StorageRetrieve::decode(OctetView(octets).first(15)).error(), ArgumentError{0});
}

TEST(GeneratedEvents, KnowTheirSeverityAndFields) {
  EXPECT_EQ(event_severity(event::can_switcher_holder_fenced), EventSeverity::high);
  EXPECT_EQ(event_severity(event::node_started), EventSeverity::info);
  EXPECT_EQ(event_severity(65000), EventSeverity::high);
  const CanSwitcherOverrunEvent overrun{.payload = "payload_eps", .grant = 5, .held_us = 90000};
  EXPECT_EQ(CanSwitcherOverrunEvent::decode(OctetView(overrun.encoded())), overrun);
  EXPECT_EQ(failure_text(failure::interrupted), "interrupted, outcome unknown");
  EXPECT_EQ(to_text(static_cast<AdcsMode>(9)), "?");
}

}  // namespace
}  // namespace srfs::mission
