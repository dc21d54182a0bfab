// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "adcs_model.hpp"

#include <array>

namespace srfs::sim {
namespace {

using Result = wire::PeripheralResult;

enum class Function : std::uint8_t {
  set_mode = 1,               ///< u8 mode: 0 idle, 1 detumble, 2 point, 3 sun
  set_target_quaternion = 2,  ///< 4 f32, scalar last
  set_wheel_speed = 3,        ///< u8 wheel 0-2, f32 rad/s
};

// Standard deviations of the sensors, of the class flown on CubeSats.
constexpr double rate_noise_rad_s = 2e-4;
constexpr double attitude_noise_rad = 5e-4;
constexpr double field_noise_t = 1.5e-7;
constexpr double sun_noise = 3e-3;
constexpr double wheel_noise_rad_s = 0.2;

Result done_if(bool fine) {
  return fine ? Result::done : Result::bad_argument;
}

bool exactly_read(const OctetReader& in) {
  return in.ok() && in.remaining() == 0;
}

void put_vector(OctetWriter& out, const Eigen::Vector3d& value, Noise& noise, double sigma) {
  for (Eigen::Index i = 0; i < 3; ++i) out.f32(static_cast<float>(value[i] + noise(sigma)));
}

}  // namespace

Octets AdcsModel::measure() {
  const AttitudeState& true_state = world_.attitude().state();
  const Eigen::Quaterniond error(1, noise_(attitude_noise_rad / 2), noise_(attitude_noise_rad / 2),
                                 noise_(attitude_noise_rad / 2));
  const Eigen::Quaterniond estimate = (true_state.attitude * error).normalized();
  const Eigen::Quaterniond to_body = true_state.attitude.conjugate();

  OctetWriter out;
  for (const double c : {estimate.x(), estimate.y(), estimate.z(), estimate.w()})
    out.f32(static_cast<float>(c));
  put_vector(out, true_state.rate_rad_s, noise_, rate_noise_rad_s);
  put_vector(out, to_body * world_.orbit().magnetic_field_t, noise_, field_noise_t);
  // Without the sun its sensor says "not found", exactly zero.
  put_vector(out, world_.sun_body(), noise_, world_.orbit().eclipsed ? 0 : sun_noise);
  put_vector(out, world_.attitude().wheel_speed_rad_s(), noise_, wheel_noise_rad_s);
  out.u8(static_cast<std::uint8_t>(world_.attitude().mode()));
  return out.take();
}

Result AdcsModel::execute(std::uint8_t function, OctetView arguments) {
  AttitudeModel& attitude = world_.attitude();
  OctetReader in(arguments);
  switch (static_cast<Function>(function)) {
    case Function::set_mode: {
      const std::uint8_t mode = in.u8();
      if (!exactly_read(in) || mode > 3) return Result::bad_argument;
      attitude.set_mode(static_cast<AttitudeMode>(mode));
      return Result::done;
    }
    case Function::set_target_quaternion: {
      std::array<double, 4> q{};
      for (double& c : q) c = static_cast<double>(in.f32());
      return done_if(exactly_read(in) && attitude.set_target(Eigen::Quaterniond(q[3], q[0], q[1], q[2])));
    }
    case Function::set_wheel_speed: {
      const std::uint8_t wheel = in.u8();
      const auto speed_rad_s = static_cast<double>(in.f32());
      if (!exactly_read(in)) return Result::bad_argument;
      // The control laws own the wheels in the other modes.
      if (attitude.mode() != AttitudeMode::idle) return Result::cannot_now;
      return done_if(attitude.set_wheel_speed(wheel, speed_rad_s));
    }
  }
  return Result::unknown_function;
}

void AdcsModel::set_power(bool on) {
  world_.set_actuators_powered(on);
  world_.attitude().restart_controller();
}

std::unique_ptr<PeripheralModel> make_payload_adcs_model(const ModelContext& context) {
  return std::make_unique<AdcsModel>(context);
}

}  // namespace srfs::sim
