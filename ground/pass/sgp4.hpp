// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstdint>
#include <string_view>

#include "base/result.hpp"
#include "base/time.hpp"
#include "ground/pass/tle.hpp"

namespace srfs::ground::pass {

using Vector = std::array<double, 3>;

enum class Sgp4Error : std::uint8_t {
  deep_space,    ///< a period of 225 minutes or more: SDP4, which is not here
  bad_elements,  ///< they describe no orbit
  no_orbit,      ///< so far from the epoch the model has no orbit any more
  decayed,       ///< below the ground
};
[[nodiscard]] std::string_view to_text(Sgp4Error error);

/// The orbit of a spacecraft near the Earth by SGP4 with the constants of WGS-72, as element sets are made
/// (Hoots and Roehrich, Spacetrack Report 3, 1980; Vallado and others, AIAA 2006-6753). Accuracy: a kilometre
/// or so at the epoch, and 1 to 3 km more each day. Pure.
class Sgp4 {
 public:
  [[nodiscard]] static Result<Sgp4, Sgp4Error> of(const TwoLineElements& elements);

  /// In the frame TEME: true equator, mean equinox.
  struct State {
    Vector position_km{};
    Vector velocity_km_s{};
  };
  [[nodiscard]] Result<State, Sgp4Error> at(UtcTime time) const;
  /// @param minutes  since the epoch; may be negative
  [[nodiscard]] Result<State, Sgp4Error> after(double minutes) const;

 private:
  explicit Sgp4(const TwoLineElements& elements) : elements_(elements) {}
  void recover_mean_motion();
  void set_secular_rates();
  void set_drag();
  void set_higher_drag();
  /// Mean elements at a time.
  struct Mean {
    double semi_major_axis = 0;  // Earth radii, as all lengths here
    double motion = 0;           // rad/min
    double eccentricity = 0;
    double perigee = 0;
    double node = 0;
    double anomaly = 0;
  };
  [[nodiscard]] Result<Mean, Sgp4Error> mean_after(double minutes) const;
  [[nodiscard]] Result<State, Sgp4Error> osculating(const Mean& mean) const;

  TwoLineElements elements_;
  double motion_ = 0;           // Brouwer's mean motion, rad/min
  double semi_major_axis_ = 0;  // Earth radii
  double cos_i_ = 0;
  double sin_i_ = 0;
  double anomaly_rate_ = 0;  // rad/min, these three
  double perigee_rate_ = 0;
  double node_rate_ = 0;
  bool low_ = false;  // perigee below 220 km: the short form of the drag
  // Drag: names of Spacetrack Report 3.
  double s_ = 0, xi_ = 0, eta_ = 0;
  double c1_ = 0, c4_ = 0, c5_ = 0, d2_ = 0, d3_ = 0, d4_ = 0;
  double node_drag_ = 0, perigee_drag_ = 0, anomaly_drag_ = 0;
  double t2_ = 0, t3_ = 0, t4_ = 0, t5_ = 0;
  double long_period_y_ = 0, long_period_l_ = 0;
};

}  // namespace srfs::ground::pass
