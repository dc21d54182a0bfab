// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <deque>
#include <optional>

#include "impact_structures.hpp"
#include "nodes/payload/payload_profile.hpp"

namespace srfs {

/// Hits an hour over the last minutes, from counts and the cycles in which they were read. Pure.
class ImpactFlux {
 public:
  static constexpr std::size_t readings_max = 300;

  /// @param ticks_per_hour  of the mission cycle
  explicit ImpactFlux(double ticks_per_hour) : ticks_per_hour_(ticks_per_hour) {}

  /// @param impacts  since the peripheral was cleared; a smaller one than before begins anew
  /// @return not a number with less than two readings
  float add(MissionCycle cycle, std::uint32_t impacts);

 private:
  struct Reading {
    MissionCycle cycle;
    std::uint32_t impacts;
  };
  double ticks_per_hour_;
  std::deque<Reading> readings_;  ///< the oldest makes room
};

/// The impact detector: hits of dust and debris, counted by their energy.
class ImpactProfile : public PayloadProfile {
 public:
  static constexpr float large_hit_uj = 100.0F;
  static constexpr double ticks_per_hour = 36000;  ///< a tick each 100 ms

  [[nodiscard]] const hw::Peripheral& peripheral() const override { return hw::impact; }
  [[nodiscard]] std::uint16_t apid() const override { return mission::apid::payload_impact; }
  [[nodiscard]] std::uint16_t structure_id() const override { return mission::structure::payload_impact; }

  [[nodiscard]] EncodedStructure counters(MissionCycle cycle, const mission::PayloadCounters& counters,
                                          const mission::SensorInputs& inputs) const override {
    return encode_counters<mission::PayloadImpactCountersHousekeeping>(cycle, counters, inputs);
  }

  [[nodiscard]] Result<PayloadCommand, FailureCode> decode_command(std::uint16_t function,
                                                                   OctetView arguments) const override;
  [[nodiscard]] std::optional<Processed> process(OctetView block, MissionCycle cycle,
                                                 const mission::SlotStatistics& slots) override;

 private:
  void compare_with_last(const mission::ImpactMeasurement& measurement, std::vector<EncodedEvent>& events);

  ImpactFlux flux_{ticks_per_hour};
  std::optional<std::uint32_t> impacts_;
};

}  // namespace srfs
