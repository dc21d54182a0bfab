// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "thermal_profile.hpp"

#include <algorithm>

#include <mission/structures.hpp>

namespace srfs {

Result<PayloadCommand, FailureCode> ThermalProfile::decode_command(std::uint16_t function,
                                                                   OctetView arguments) const {
  switch (function) {
    case mission::ThermalSetHeater::function_id:
      return to_peripheral<mission::ThermalSetHeater>(arguments);
    case mission::ThermalSetSetpoint::function_id:
      return to_peripheral<mission::ThermalSetSetpoint>(arguments);
    case mission::ThermalResetPeripheral::function_id:
      return to_reset<mission::ThermalResetPeripheral>(arguments);
    case mission::ThermalPowerCyclePeripheral::function_id:
      return to_power_cycle<mission::ThermalPowerCyclePeripheral>(arguments);
    default:
      return Err(mission::failure::unknown_function);
  }
}

std::optional<Processed> ThermalProfile::process(OctetView block, MissionCycle cycle,
                                                 const mission::SlotStatistics& slots) {
  const auto measurement = mission::ThermalMeasurement::decode(block);
  if (!measurement) return std::nullopt;

  const auto [coldest, warmest] =
      std::minmax_element(measurement->temperature_k.begin(), measurement->temperature_k.end());
  mission::PayloadThermalHousekeeping hk;
  hk.cycle = cycle;
  hk.measurement = *measurement;
  hk.temperature_min_k = *coldest;
  hk.temperature_max_k = *warmest;
  hk.gradient_k = *warmest - *coldest;
  hk.slots = slots;

  Processed processed;
  processed.housekeeping = hk.encoded();
  check_limits(*measurement, processed.events);
  return processed;
}

void ThermalProfile::check_limits(const mission::ThermalMeasurement& measurement,
                                  std::vector<EncodedEvent>& events) {
  for (std::size_t i = 0; i < sensors; ++i) {
    const float t = measurement.temperature_k[i];
    const auto sensor = static_cast<std::uint8_t>(i);
    if (!out_of_limits_[i] && (t < lowest_k || t > highest_k)) {
      out_of_limits_[i] = true;
      events.push_back(encode_event(mission::ThermalOutOfLimitsEvent{.sensor = sensor, .temperature_k = t}));
    } else if (out_of_limits_[i] && t > lowest_k + hysteresis_k && t < highest_k - hysteresis_k) {
      out_of_limits_[i] = false;
      events.push_back(encode_event(mission::ThermalBackInLimitsEvent{.sensor = sensor, .temperature_k = t}));
    }
  }
}

}  // namespace srfs
