// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "impact_profile.hpp"

#include <cmath>

namespace srfs {

float ImpactFlux::add(MissionCycle cycle, std::uint32_t impacts) {
  const bool begins_anew =
      !readings_.empty() && (impacts < readings_.back().impacts || cycle <= readings_.back().cycle);
  if (begins_anew) readings_.clear();
  if (readings_.size() == readings_max) readings_.pop_front();
  readings_.push_back({cycle, impacts});
  if (readings_.size() < 2) return std::nanf("");
  const auto ticks = static_cast<double>(cycle - readings_.front().cycle);
  return static_cast<float>((impacts - readings_.front().impacts) / ticks * ticks_per_hour_);
}

Result<PayloadCommand, FailureCode> ImpactProfile::decode_command(std::uint16_t function,
                                                                  OctetView arguments) const {
  switch (function) {
    case mission::ImpactSetThreshold::function_id:
      return to_peripheral<mission::ImpactSetThreshold>(arguments);
    case mission::ImpactClear::function_id:
      return to_peripheral<mission::ImpactClear>(arguments);
    case mission::ImpactResetPeripheral::function_id:
      return to_reset<mission::ImpactResetPeripheral>(arguments);
    case mission::ImpactPowerCyclePeripheral::function_id:
      return to_power_cycle<mission::ImpactPowerCyclePeripheral>(arguments);
    default:
      return Err(FailureCode::unknown_function);
  }
}

std::optional<Processed> ImpactProfile::process(OctetView block, MissionCycle cycle,
                                                const mission::SlotStatistics& slots) {
  const auto measurement = mission::ImpactMeasurement::decode(block);
  if (!measurement) return std::nullopt;

  mission::PayloadImpactHousekeeping hk;
  hk.cycle = cycle;
  hk.measurement = *measurement;
  hk.flux_per_hour = flux_.add(cycle, measurement->impacts);
  hk.slots = slots;

  Processed processed;
  processed.housekeeping = hk.encoded();
  compare_with_last(*measurement, processed.events);
  return processed;
}

void ImpactProfile::compare_with_last(const mission::ImpactMeasurement& measurement,
                                      std::vector<EncodedEvent>& events) {
  const bool counted_on = impacts_ && measurement.impacts > *impacts_;
  if (counted_on) {
    events.push_back(encode_event(mission::ImpactHitEvent{.count = measurement.impacts - *impacts_,
                                                          .energy_uj = measurement.energy_uj}));
    if (measurement.energy_uj >= large_hit_uj)
      events.push_back(encode_event(mission::ImpactLargeHitEvent{.energy_uj = measurement.energy_uj}));
  }
  impacts_ = measurement.impacts;
}

}  // namespace srfs
