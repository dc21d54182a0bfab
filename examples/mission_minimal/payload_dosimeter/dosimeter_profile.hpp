// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "nodes/payload/payload_profile.hpp"

namespace srfs {

/// Radiation: dose, and particles a second between two measurements.
class DosimeterProfile : public PayloadProfile {
 public:
  [[nodiscard]] std::uint16_t apid() const override { return mission::apid::payload_dosimeter; }
  [[nodiscard]] std::uint16_t structure_id() const override { return mission::structure::payload_dosimeter; }

  [[nodiscard]] EncodedStructure counters(MissionCycle cycle, const mission::PayloadCounters& counters,
                                          const mission::SensorInputs& inputs) const override {
    return encode_counters<mission::PayloadDosimeterCountersHousekeeping>(cycle, counters, inputs);
  }

  [[nodiscard]] Result<PayloadCommand, FailureCode> decode_command(std::uint16_t function,
                                                                   OctetView arguments) const override;
  [[nodiscard]] std::optional<Processed> process(OctetView block, MissionCycle cycle,
                                                 const mission::SlotStatistics& slots) override;

 private:
  std::optional<std::uint32_t> particles_;  ///< at the measurement before
  MissionCycle cycle_ = 0;                  ///< of that one
};

}  // namespace srfs
