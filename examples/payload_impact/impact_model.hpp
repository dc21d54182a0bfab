// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <random>

#include "hw_sim/peripheral_model.hpp"

namespace srfs::sim {

/// Impact detector: a plate with a sensor that counts hits of dust and debris above a
/// threshold. It sends nothing until it is asked. A restart keeps what it counted; loss of power clears it
/// and sets the threshold back.
class ImpactModel final : public PeripheralModel {
 public:
  static constexpr std::size_t bins =
      8;  ///< of the energy: bin n holds 2^n to 2^(n+1) uJ, the last one all above
  static constexpr float default_threshold_v = 0.05F;
  static constexpr seconds mean_interval{5};  ///< between hits, of which some stay below the threshold

  explicit ImpactModel(std::uint64_t seed) : random_(seed), to_next_(draw_interval()) {}

  /// Time goes on; powered or not, dust hits.
  void step(nanoseconds dt) override;
  /// A hit of this signal at the sensor.
  void hit(float amplitude_v);

  [[nodiscard]] Octets measure() override;
  [[nodiscard]] wire::PeripheralResult execute(std::uint8_t function, OctetView arguments) override;
  void set_power(bool on) override;

  [[nodiscard]] std::uint32_t impacts() const { return impacts_; }

 private:
  [[nodiscard]] nanoseconds draw_interval();
  void clear();

  std::mt19937_64 random_;
  nanoseconds to_next_;
  bool powered_ = true;
  std::uint32_t impacts_ = 0;
  std::uint32_t rejected_ = 0;
  std::optional<nanoseconds> since_last_;
  float last_amplitude_v_ = 0;
  float last_energy_uj_ = 0;
  float threshold_v_ = default_threshold_v;
  std::array<std::uint32_t, bins> histogram_{};
};

}  // namespace srfs::sim
