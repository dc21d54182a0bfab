// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <vector>

#include <Eigen/Core>

namespace srfs::image {

struct CatalogueStar {
  Eigen::Vector3d direction;  ///< J2000, length 1
  double magnitude;           ///< V_T
};

inline constexpr double faintest_of_catalogue = 10.5;

/// The stars brighter than @p faintest (catalogue/README.md), brightest first.
[[nodiscard]] std::vector<CatalogueStar> bright_stars(double faintest = 8.5);

/// Those of them at most @p radius_rad, which is below a quarter turn, away from a direction. Takes no
/// memory for the others.
[[nodiscard]] std::vector<CatalogueStar> stars_around(const Eigen::Vector3d& direction, double radius_rad,
                                                      double faintest = faintest_of_catalogue);

[[nodiscard]] Eigen::Vector3d direction_of(double ra_deg, double dec_deg);

/// Directions by place on the sphere.
class SkyIndex {
 public:
  SkyIndex(const std::vector<Eigen::Vector3d>& directions, double cell_rad);

  /// Calls use(index, square of the chord) for those at most @p radius_rad away, which is below a quarter
  /// turn.
  template <class Use>
  void near(const Eigen::Vector3d& direction, double radius_rad, Use&& use) const {
    if (!direction.allFinite() || !(radius_rad >= 0)) return;  // near nothing
    const double chord = 2 * std::sin(radius_rad / 2);
    for_cells(direction, radius_rad, [&](std::size_t from, std::size_t end) {
      for (std::size_t k = from; k < end; ++k) {
        const double square = (entries_[k].direction.cast<double>() - direction).squaredNorm();
        if (square <= chord * chord) use(entries_[k].index, square);
      }
    });
  }

 private:
  struct Entry {
    Eigen::Vector3f direction;
    std::uint32_t index;
  };
  struct Band {
    std::size_t first_cell;
    int cells;  ///< along right ascension
  };

  /// Calls use(first entry, last + 1) for runs of cells that may have what is near.
  template <class Use>
  void for_cells(const Eigen::Vector3d& direction, double radius, Use&& use) const {
    constexpr double pi = 3.14159265358979323846;
    const double dec = std::asin(std::clamp(direction.z(), -1.0, 1.0));
    const double ra = std::atan2(direction.y(), direction.x());
    const int last = static_cast<int>(bands_.size()) - 1;
    const auto band_of = [&](double d) {
      return std::clamp(static_cast<int>((d + pi / 2) / band_rad_), 0, last);
    };
    // Where the circle is widest in right ascension.
    const bool around_pole = std::abs(dec) + radius >= pi / 2 - 1e-6;
    const double half = around_pole ? pi : std::asin(std::min(1.0, std::sin(radius) / std::cos(dec)));
    for (int b = band_of(dec - radius); b <= band_of(dec + radius); ++b) {
      const Band& band = bands_[static_cast<std::size_t>(b)];
      const double per_cell = 2 * pi / band.cells;
      const int from = static_cast<int>(std::floor((ra - half + pi) / per_cell));
      const int n =
          std::min(band.cells, static_cast<int>(std::floor((ra + half + pi) / per_cell)) - from + 1);
      for (int k = 0; k < n; ++k) {
        const std::size_t cell =
            band.first_cell + static_cast<std::size_t>((from + k + 2 * band.cells) % band.cells);
        use(first_[cell], first_[cell + 1]);
      }
    }
  }
  [[nodiscard]] std::size_t cell_of(const Eigen::Vector3d& direction) const;

  double band_rad_;
  std::vector<Band> bands_;
  std::vector<std::uint32_t> first_;
  std::vector<Entry> entries_;
};

}  // namespace srfs::image
