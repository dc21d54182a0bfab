// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <optional>

#include "nodes/payload/payload_profile.hpp"

namespace srfs {

/// Rotation angle between two attitudes, degrees, 0-180. Quaternions scalar last; their length and sign do
/// not matter. nullopt when one has no direction (zero or not finite).
[[nodiscard]] std::optional<float> rotation_angle_deg(const std::array<float, 4>& a,
                                                      const std::array<float, 4>& b);

/// Attitude determination and control: pointing error against the commanded target, body rate, eclipse.
class AdcsProfile : public PayloadProfile {
 public:
  [[nodiscard]] std::uint16_t apid() const override { return mission::apid::payload_adcs; }
  [[nodiscard]] std::uint16_t structure_id() const override { return mission::structure::payload_adcs; }

  [[nodiscard]] EncodedStructure counters(MissionCycle cycle, const mission::PayloadCounters& counters,
                                          const mission::SensorInputs& inputs) const override {
    return encode_counters<mission::PayloadAdcsCountersHousekeeping>(cycle, counters, inputs);
  }

  [[nodiscard]] Result<PayloadCommand, FailureCode> decode_command(std::uint16_t function,
                                                                   OctetView arguments) const override;
  [[nodiscard]] std::optional<Processed> process(OctetView block, MissionCycle cycle,
                                                 const mission::SlotStatistics& slots) override;
  bool on_command_done(const PeripheralFunction& command) override;
  /// The target: the peripheral does not report it.
  [[nodiscard]] Octets state() const override;
  [[nodiscard]] bool restore_state(OctetView state) override;

 private:
  void compare_with_last(const mission::PayloadAdcsHousekeeping& hk, std::vector<EncodedEvent>& events);

  std::array<float, 4> target_{0, 0, 0, 1};
  std::optional<bool> in_eclipse_;
  std::optional<mission::AdcsMode> mode_;
  bool rate_high_ = false;
};

}  // namespace srfs
