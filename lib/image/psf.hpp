// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstdint>
#include <optional>

#include "image/frame.hpp"
#include "image/profile.hpp"

namespace srfs::image {

/// What one star's light makes of the pixels, the pixels' own width included: an elliptic profile between a
/// Gaussian and one with strong wings (Moffat). Its height is 1.
class Psf {
 public:
  /// Height (1 + gamma q)^(-1/gamma) at q = a dx^2 + 2 b dx dy + c dy^2; gamma 0: exp(-q).
  struct Shape {
    double a;
    double b;
    double c;
    double gamma;
  };

  explicit Psf(const Shape& shape);
  [[nodiscard]] static Psf round_gaussian(double fwhm_px);

  struct Value {
    float height;
    float slope;  ///< d height / d q
  };
  [[nodiscard]] Value value(float q) const {
    const float u = q * table_per_q;
    if (u >= static_cast<float>(table_size - 2)) return {0, 0};
    const auto i = static_cast<std::size_t>(u);
    const float t = u - static_cast<float>(i);
    return {height_[i] + t * (height_[i + 1] - height_[i]), slope_[i] + t * (slope_[i + 1] - slope_[i])};
  }
  [[nodiscard]] float q(float dx, float dy) const { return a_ * dx * dx + 2 * b_ * dx * dy + c_ * dy * dy; }
  [[nodiscard]] float height(float dx, float dy) const { return value(q(dx, dy)).height; }

  [[nodiscard]] const Shape& shape() const { return shape_; }
  [[nodiscard]] Profile profile() const { return {a_, b_, c_, static_cast<float>(shape_.gamma)}; }
  [[nodiscard]] double fwhm_px() const { return fwhm_px_; }
  /// Light of a star of height 1.
  [[nodiscard]] double flux() const { return flux_; }
  /// The Gaussian that detects it best has this sigma.
  [[nodiscard]] float sigma_px() const { return static_cast<float>(fwhm_px_ / 2.3548); }
  [[nodiscard]] int fit_radius() const;
  /// Where the height falls below @p height.
  [[nodiscard]] double radius_at(double height) const;

 private:
  static constexpr std::size_t table_size = 2048;
  static constexpr float table_per_q = 32;  // up to q = 64

  Shape shape_;
  float a_;
  float b_;
  float c_;
  double fwhm_px_;
  double flux_;
  std::vector<float> height_;
  std::vector<float> slope_;
};

/// How sharp the optics may be.
enum class Optics {
  usual,
  sharper_than_pixels,  ///< of hot pixels and particles' tracks hardly to be told
};

/// @param signal  level 0, noise 1
/// @param bad     pixels not to use
/// @param apart_from_light  nothing counts that is surrounded by light: the level is not 0 everywhere
/// @return the shape of the frame's own stars; nothing where there are too few bright ones
[[nodiscard]] std::optional<Psf> measure_psf(const Plane& signal, const Grid<std::uint8_t>& bad,
                                             bool apart_from_light, Optics optics = Optics::usual);

/// Where they are too few for that.
/// @return FWHM of the brightest points with light beside them, px; nothing where there is none
[[nodiscard]] std::optional<double> width_of_brightest(const Plane& signal, const Grid<std::uint8_t>& bad,
                                                       bool apart_from_light);

}  // namespace srfs::image
