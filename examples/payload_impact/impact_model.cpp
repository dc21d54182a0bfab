// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "impact_model.hpp"

#include <algorithm>
#include <cmath>

namespace srfs::sim {
namespace {

enum class Function : std::uint8_t {
  set_threshold = 1,  ///< f32 V 0.01-5
  clear = 2,          ///< counts, histogram and the last impact; no arguments
};

constexpr double smallest_signal_v = 0.02;
constexpr float largest_signal_v = 5.0F;
constexpr double flux_exponent = 1.2;  // of the number of hits above a signal
constexpr float energy_per_square_volt_uj = 200.0F;
constexpr float lowest_threshold_v = 0.01F;

}  // namespace

nanoseconds ImpactModel::draw_interval() {
  std::exponential_distribution<double> distribution(1.0);
  return nanoseconds(
      static_cast<std::int64_t>(distribution(random_) * double(nanoseconds(mean_interval).count())));
}

void ImpactModel::step(nanoseconds dt) {
  if (since_last_) *since_last_ += dt;
  while (dt >= to_next_) {
    dt -= to_next_;
    to_next_ = draw_interval();
    std::uniform_real_distribution<double> share(1e-6, 1.0);
    const double signal_v = smallest_signal_v * std::pow(share(random_), -1 / flux_exponent);
    hit(static_cast<float>(signal_v));
  }
  to_next_ -= dt;
}

void ImpactModel::hit(float amplitude_v) {
  if (!powered_) return;
  amplitude_v = std::min(amplitude_v, largest_signal_v);
  if (amplitude_v < threshold_v_) {
    ++rejected_;
    return;
  }
  ++impacts_;
  since_last_ = nanoseconds(0);
  last_amplitude_v_ = amplitude_v;
  last_energy_uj_ = energy_per_square_volt_uj * amplitude_v * amplitude_v;
  const int bin = last_energy_uj_ < 1 ? 0 : std::ilogb(last_energy_uj_);
  ++histogram_.at(static_cast<std::size_t>(std::min<int>(bin, bins - 1)));
}

Octets ImpactModel::measure() {
  OctetWriter out;
  out.u32(impacts_);
  out.u32(rejected_);
  out.u32(since_last_
              ? static_cast<std::uint32_t>(std::min<std::int64_t>(*since_last_ / milliseconds(1), 0xFFFFFFFE))
              : 0xFFFFFFFF);
  out.f32(last_amplitude_v_);
  out.f32(last_energy_uj_);
  out.f32(threshold_v_);
  for (const std::uint32_t count : histogram_) out.u32(count);
  return out.take();
}

wire::PeripheralResult ImpactModel::execute(std::uint8_t function, OctetView arguments) {
  OctetReader in(arguments);
  switch (static_cast<Function>(function)) {
    case Function::set_threshold: {
      const float threshold_v = in.f32();
      const bool fine = in.ok() && in.remaining() == 0 && threshold_v >= lowest_threshold_v &&
                        threshold_v <= largest_signal_v;
      if (!fine) return wire::PeripheralResult::bad_argument;
      threshold_v_ = threshold_v;
      return wire::PeripheralResult::done;
    }
    case Function::clear:
      if (!arguments.empty()) return wire::PeripheralResult::bad_argument;
      clear();
      return wire::PeripheralResult::done;
  }
  return wire::PeripheralResult::unknown_function;
}

void ImpactModel::clear() {
  impacts_ = rejected_ = 0;
  since_last_.reset();
  last_amplitude_v_ = last_energy_uj_ = 0;
  histogram_.fill(0);
}

void ImpactModel::set_power(bool on) {
  powered_ = on;
  if (on) return;
  clear();
  threshold_v_ = default_threshold_v;
}

std::unique_ptr<PeripheralModel> make_payload_impact_model(const ModelContext& context) {
  return std::make_unique<ImpactModel>(context.seed);
}

}  // namespace srfs::sim
