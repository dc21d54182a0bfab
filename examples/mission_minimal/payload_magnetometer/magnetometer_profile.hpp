// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "nodes/payload/payload_profile.hpp"

namespace srfs {

/// The magnetic field: its vector, as measured, and its magnitude.
class MagnetometerProfile : public PayloadProfile {
 public:
  [[nodiscard]] std::uint16_t apid() const override { return mission::apid::payload_magnetometer; }
  [[nodiscard]] std::uint16_t structure_id() const override {
    return mission::structure::payload_magnetometer;
  }

  [[nodiscard]] EncodedStructure counters(MissionCycle cycle, const mission::PayloadCounters& counters,
                                          const mission::SensorInputs& inputs) const override {
    return encode_counters<mission::PayloadMagnetometerCountersHousekeeping>(cycle, counters, inputs);
  }

  [[nodiscard]] Result<PayloadCommand, FailureCode> decode_command(std::uint16_t function,
                                                                   OctetView arguments) const override;
  [[nodiscard]] std::optional<Processed> process(OctetView block, MissionCycle cycle,
                                                 const mission::SlotStatistics& slots) override;
};

}  // namespace srfs
