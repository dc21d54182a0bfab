// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>

#include "nodes/payload/payload_profile.hpp"

namespace srfs {

/// Thermal control: extremes and gradient of the temperatures, sensors out of limits.
class ThermalProfile : public PayloadProfile {
 public:
  static constexpr float lowest_k = 243.15F;  ///< soft limits of the mission dictionary
  static constexpr float highest_k = 338.15F;
  static constexpr float hysteresis_k = 2.0F;

  [[nodiscard]] std::uint16_t apid() const override { return mission::apid::payload_thermal; }
  [[nodiscard]] std::uint16_t structure_id() const override { return mission::structure::payload_thermal; }

  [[nodiscard]] EncodedStructure counters(MissionCycle cycle, const mission::PayloadCounters& counters,
                                          const mission::SensorInputs& inputs) const override {
    return encode_counters<mission::PayloadThermalCountersHousekeeping>(cycle, counters, inputs);
  }

  [[nodiscard]] Result<PayloadCommand, FailureCode> decode_command(std::uint16_t function,
                                                                   OctetView arguments) const override;
  [[nodiscard]] std::optional<Processed> process(OctetView block, MissionCycle cycle,
                                                 const mission::SlotStatistics& slots) override;

 private:
  static constexpr std::size_t sensors =
      std::tuple_size_v<decltype(mission::ThermalMeasurement::temperature_k)>;
  void check_limits(const mission::ThermalMeasurement& measurement, std::vector<EncodedEvent>& events);

  std::array<bool, sensors> out_of_limits_{};
};

}  // namespace srfs
