// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "magnetometer_profile.hpp"

#include <cmath>

namespace srfs {

Result<PayloadCommand, FailureCode> MagnetometerProfile::decode_command(std::uint16_t function,
                                                                        OctetView arguments) const {
  switch (function) {
    case mission::MagnetometerSetRange::function_id:
      return to_peripheral<mission::MagnetometerSetRange>(arguments);
    case mission::MagnetometerResetPeripheral::function_id:
      return to_reset<mission::MagnetometerResetPeripheral>(arguments);
    default:
      return Err(mission::failure::unknown_function);
  }
}

std::optional<Processed> MagnetometerProfile::process(OctetView block, MissionCycle cycle,
                                                      const mission::SlotStatistics& slots) {
  const auto measurement = mission::MagnetometerMeasurement::decode(block);
  if (!measurement) return std::nullopt;
  mission::PayloadMagnetometerHousekeeping hk;
  hk.cycle = cycle;
  hk.measurement = *measurement;
  const auto& field = measurement->field_t;
  hk.magnitude_t = std::hypot(field[0], field[1], field[2]);
  hk.slots = slots;
  return Processed{hk.encoded(), {}};
}

}  // namespace srfs
