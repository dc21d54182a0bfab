// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>

#include "nodes/payload/payload_profile.hpp"

namespace srfs {

/// Electrical power: battery and solar power, time to empty.
class EpsProfile : public PayloadProfile {
 public:
  /// Full battery of the satellite; the state of charge is a share of it.
  static constexpr float battery_capacity_ah = 5.2F;

  [[nodiscard]] std::uint16_t apid() const override { return mission::apid::payload_eps; }
  [[nodiscard]] std::uint16_t structure_id() const override { return mission::structure::payload_eps; }

  [[nodiscard]] EncodedStructure counters(MissionCycle cycle, const mission::PayloadCounters& counters,
                                          const mission::SensorInputs& inputs) const override {
    return encode_counters<mission::PayloadEpsCountersHousekeeping>(cycle, counters, inputs);
  }

  [[nodiscard]] Result<PayloadCommand, FailureCode> decode_command(std::uint16_t function,
                                                                   OctetView arguments) const override;
  [[nodiscard]] std::optional<Processed> process(OctetView block, MissionCycle cycle,
                                                 const mission::SlotStatistics& slots) override;

 private:
  void compare_with_last(const mission::EpsMeasurement& measurement, std::vector<EncodedEvent>& events);

  bool battery_low_ = false;
  std::optional<std::uint8_t> load_switches_;
};

/// Seconds until the battery is empty at the present current; not a number while it charges or hardly
/// discharges.
[[nodiscard]] float time_to_empty_s(float state_of_charge, float battery_current_a, float capacity_ah);

}  // namespace srfs
