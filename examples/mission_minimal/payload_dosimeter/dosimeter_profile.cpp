// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "dosimeter_profile.hpp"

#include <cmath>

namespace srfs {
namespace {

constexpr float storm_rate = 20;

}  // namespace

Result<PayloadCommand, FailureCode> DosimeterProfile::decode_command(std::uint16_t function,
                                                                     OctetView arguments) const {
  switch (function) {
    case mission::DosimeterClear::function_id:
      return to_peripheral<mission::DosimeterClear>(arguments);
    case mission::DosimeterResetPeripheral::function_id:
      return to_reset<mission::DosimeterResetPeripheral>(arguments);
    default:
      return Err(mission::failure::unknown_function);
  }
}

std::optional<Processed> DosimeterProfile::process(OctetView block, MissionCycle cycle,
                                                   const mission::SlotStatistics& slots) {
  const auto measurement = mission::DosimeterMeasurement::decode(block);
  if (!measurement) return std::nullopt;
  mission::PayloadDosimeterHousekeeping hk;
  hk.cycle = cycle;
  hk.measurement = *measurement;
  const bool counted_on = particles_ && measurement->particles >= *particles_ && cycle > cycle_;
  hk.rate = counted_on ? static_cast<float>(measurement->particles - *particles_) /
                             static_cast<float>(cycle - cycle_)
                       : std::nanf("");
  hk.slots = slots;
  particles_ = measurement->particles;
  cycle_ = cycle;

  Processed processed{hk.encoded(), {}};
  if (hk.rate > storm_rate)
    processed.events.push_back(encode_event(mission::DosimeterStormEvent{.rate = hk.rate}));
  return processed;
}

}  // namespace srfs
