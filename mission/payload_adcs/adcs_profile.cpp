// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "adcs_profile.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>

#include <mission/structures.hpp>

namespace srfs {
namespace {

constexpr std::uint8_t state_format = 1;
constexpr double deg_per_rad = 180.0 / std::numbers::pi;
constexpr float sun_in_sight = 0.5F;  // a sun vector is a direction (length 1) or zero in eclipse
constexpr float rate_high_deg_s = 5.0F;
constexpr float rate_normal_deg_s = 4.0F;  // hysteresis, so that noise raises one event

template <std::size_t N>
double dot(const std::array<float, N>& a, const std::array<float, N>& b) {
  double sum = 0;
  for (std::size_t i = 0; i < N; ++i) sum += static_cast<double>(a[i]) * static_cast<double>(b[i]);
  return sum;
}

template <std::size_t N>
double length(const std::array<float, N>& v) {
  return std::sqrt(dot(v, v));
}

}  // namespace

std::optional<float> rotation_angle_deg(const std::array<float, 4>& a, const std::array<float, 4>& b) {
  const double lengths = length(a) * length(b);
  if (!std::isfinite(lengths) || lengths < 1e-6) return std::nullopt;
  // q and -q are the same attitude: the shorter way counts.
  const double cosine_of_half = std::min(1.0, std::abs(dot(a, b)) / lengths);
  return static_cast<float>(2.0 * std::acos(cosine_of_half) * deg_per_rad);
}

Result<PayloadCommand, FailureCode> AdcsProfile::decode_command(std::uint16_t function,
                                                                OctetView arguments) const {
  switch (function) {
    case mission::AdcsSetMode::function_id:
      return to_peripheral<mission::AdcsSetMode>(arguments);
    case mission::AdcsSetTargetQuaternion::function_id:
      return to_peripheral<mission::AdcsSetTargetQuaternion>(arguments);
    case mission::AdcsSetWheelSpeed::function_id:
      return to_peripheral<mission::AdcsSetWheelSpeed>(arguments);
    case mission::AdcsResetPeripheral::function_id:
      return to_reset<mission::AdcsResetPeripheral>(arguments);
    case mission::AdcsPowerCyclePeripheral::function_id:
      return to_power_cycle<mission::AdcsPowerCyclePeripheral>(arguments);
    default:
      return Err(mission::failure::unknown_function);
  }
}

std::optional<Processed> AdcsProfile::process(OctetView block, MissionCycle cycle,
                                              const mission::SlotStatistics& slots) {
  const auto measurement = mission::AdcsMeasurement::decode(block);
  if (!measurement) return std::nullopt;

  mission::PayloadAdcsHousekeeping hk;
  hk.cycle = cycle;
  hk.measurement = *measurement;
  hk.pointing_error_deg = rotation_angle_deg(measurement->attitude, target_).value_or(std::nanf(""));
  hk.rate_deg_s = static_cast<float>(length(measurement->body_rate_rad_s) * deg_per_rad);
  hk.in_eclipse = length(measurement->sun_vector) < static_cast<double>(sun_in_sight);
  hk.slots = slots;

  Processed processed;
  processed.housekeeping = hk.encoded();
  compare_with_last(hk, processed.events);
  return processed;
}

void AdcsProfile::compare_with_last(const mission::PayloadAdcsHousekeeping& hk,
                                    std::vector<EncodedEvent>& events) {
  if (in_eclipse_ && *in_eclipse_ != hk.in_eclipse) {
    events.push_back(hk.in_eclipse ? encode_event(mission::AdcsEclipseEnteredEvent{})
                                   : encode_event(mission::AdcsEclipseLeftEvent{}));
  }
  in_eclipse_ = hk.in_eclipse;
  if (mode_ && *mode_ != hk.measurement.mode) {
    events.push_back(encode_event(mission::AdcsModeChangedEvent{.mode = hk.measurement.mode}));
  }
  mode_ = hk.measurement.mode;
  if (!rate_high_ && hk.rate_deg_s > rate_high_deg_s) {
    rate_high_ = true;
    events.push_back(encode_event(mission::AdcsRateHighEvent{.rate_deg_s = hk.rate_deg_s}));
  } else if (hk.rate_deg_s < rate_normal_deg_s) {
    rate_high_ = false;
  }
}

bool AdcsProfile::on_command_done(const PeripheralFunction& command) {
  if (command.function != mission::AdcsSetTargetQuaternion::peripheral_function) return false;
  const auto target = mission::AdcsSetTargetQuaternion::decode(command.arguments);
  if (!target) return false;
  target_ = {target->x, target->y, target->z, target->w};
  return true;
}

Octets AdcsProfile::state() const {
  OctetWriter out;
  out.u8(state_format);
  for (const float v : target_) out.f32(v);
  return out.take();
}

bool AdcsProfile::restore_state(OctetView state) {
  OctetReader in(state);
  const std::uint8_t format = in.u8();
  std::array<float, 4> target{};
  for (float& v : target) v = in.f32();
  const bool readable = in.ok() && in.remaining() == 0 && format == state_format;
  if (!readable || !rotation_angle_deg(target, target)) return false;
  target_ = target;
  return true;
}

}  // namespace srfs
