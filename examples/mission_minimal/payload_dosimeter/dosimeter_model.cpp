// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include <cmath>
#include <random>

#include <mission/structures.hpp>

#include "hw_sim/peripheral_model.hpp"

namespace srfs::sim {
namespace {

constexpr double particles_per_s = 30;
constexpr double storm_per_s = 5000;
constexpr double gray_per_particle = 1e-9;

/// Counts particles; its own fault "storm" makes many of them. Without power the counts are lost.
class DosimeterModel final : public PeripheralModel {
 public:
  explicit DosimeterModel(const ModelContext& context) : random_(context.seed) {}

  void step(nanoseconds dt) override {
    if (!powered_) return;
    const double seconds_passed = std::chrono::duration<double>(dt).count();
    std::poisson_distribution<std::uint32_t> hits((storm_ ? storm_per_s : particles_per_s) * seconds_passed);
    particles_ += hits(random_);
  }

  [[nodiscard]] Octets measure() override {
    return mission::DosimeterMeasurement{.particles = particles_, .dose_gy = particles_ * gray_per_particle}
        .encoded();
  }

  [[nodiscard]] wire::PeripheralResult execute(std::uint8_t function, OctetView arguments) override {
    if (function != mission::DosimeterClear::peripheral_function)
      return wire::PeripheralResult::unknown_function;
    if (!arguments.empty()) return wire::PeripheralResult::bad_argument;
    particles_ = 0;
    return wire::PeripheralResult::done;
  }

  void set_power(bool on) override {
    powered_ = on;
    if (!on) particles_ = 0;
  }

  [[nodiscard]] bool set_fault(std::string_view name) override {
    if (name != "none" && name != "storm") return false;
    storm_ = name == "storm";
    return true;
  }

 private:
  std::mt19937_64 random_;
  std::uint32_t particles_ = 0;
  bool powered_ = true;
  bool storm_ = false;
};

}  // namespace

std::unique_ptr<PeripheralModel> make_payload_dosimeter_model(const ModelContext& context) {
  return std::make_unique<DosimeterModel>(context);
}

}  // namespace srfs::sim
