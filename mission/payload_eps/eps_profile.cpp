// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "eps_profile.hpp"

#include <algorithm>
#include <cmath>

#include <mission/structures.hpp>

namespace srfs {
namespace {

constexpr float low_charge = 0.30F;
constexpr float recovered_charge = 0.35F;      // hysteresis, so that noise raises one event
constexpr float smallest_discharge_a = 0.01F;  // below it is the noise of the sensor

}  // namespace

float time_to_empty_s(float state_of_charge, float battery_current_a, float capacity_ah) {
  if (!(battery_current_a < -smallest_discharge_a)) return std::nanf("");
  return std::max(0.0F, state_of_charge) * capacity_ah * 3600.0F / -battery_current_a;
}

Result<PayloadCommand, FailureCode> EpsProfile::decode_command(std::uint16_t function,
                                                               OctetView arguments) const {
  switch (function) {
    case mission::EpsSwitchLoad::function_id:
      return to_peripheral<mission::EpsSwitchLoad>(arguments);
    case mission::EpsSetChargeLimit::function_id:
      return to_peripheral<mission::EpsSetChargeLimit>(arguments);
    case mission::EpsResetPeripheral::function_id:
      return to_reset<mission::EpsResetPeripheral>(arguments);
    case mission::EpsPowerCyclePeripheral::function_id:
      return to_power_cycle<mission::EpsPowerCyclePeripheral>(arguments);
    default:
      return Err(mission::failure::unknown_function);
  }
}

std::optional<Processed> EpsProfile::process(OctetView block, MissionCycle cycle,
                                             const mission::SlotStatistics& slots) {
  const auto measurement = mission::EpsMeasurement::decode(block);
  if (!measurement) return std::nullopt;

  mission::PayloadEpsHousekeeping hk;
  hk.cycle = cycle;
  hk.measurement = *measurement;
  hk.battery_power_w = measurement->battery_voltage_v * measurement->battery_current_a;
  hk.solar_power_w = measurement->bus_voltage_v * measurement->solar_current_a;
  hk.time_to_empty_s =
      time_to_empty_s(measurement->state_of_charge, measurement->battery_current_a, battery_capacity_ah);
  hk.slots = slots;

  Processed processed;
  processed.housekeeping = hk.encoded();
  compare_with_last(*measurement, processed.events);
  return processed;
}

void EpsProfile::compare_with_last(const mission::EpsMeasurement& measurement,
                                   std::vector<EncodedEvent>& events) {
  const float charge = measurement.state_of_charge;
  if (!battery_low_ && charge < low_charge) {
    battery_low_ = true;
    events.push_back(encode_event(mission::EpsBatteryLowEvent{.state_of_charge = charge}));
  } else if (battery_low_ && charge > recovered_charge) {
    battery_low_ = false;
    events.push_back(encode_event(mission::EpsBatteryRecoveredEvent{.state_of_charge = charge}));
  }
  if (load_switches_ && *load_switches_ != measurement.load_switches) {
    events.push_back(encode_event(
        mission::EpsLoadsChangedEvent{.before = *load_switches_, .after = measurement.load_switches}));
  }
  load_switches_ = measurement.load_switches;
}

}  // namespace srfs
