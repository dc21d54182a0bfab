// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "image/star_catalogue.hpp"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <numbers>
#include <span>

// The file as it is, in the library's constant data.
__asm__(
    ".pushsection .rodata\n"
    ".global srfs_bright_stars_begin\n"
    ".hidden srfs_bright_stars_begin\n"
    "srfs_bright_stars_begin:\n"
    ".incbin \"" SRFS_BRIGHT_STARS
    "\"\n"
    ".global srfs_bright_stars_end\n"
    ".hidden srfs_bright_stars_end\n"
    "srfs_bright_stars_end:\n"
    ".byte 0\n"
    ".popsection\n");

extern "C" {
extern const std::uint8_t srfs_bright_stars_begin[] __attribute__((visibility("hidden")));
extern const std::uint8_t srfs_bright_stars_end[] __attribute__((visibility("hidden")));
}

namespace srfs::image {
namespace {

constexpr std::size_t star_octets = 7;
constexpr double turns_per_unit = 1.0 / (1 << 24);

std::int32_t take_24(const std::uint8_t* in) {
  return in[0] | (in[1] << 8) | (in[2] << 16);
}

std::span<const std::uint8_t> content() {
  return {srfs_bright_stars_begin,
          static_cast<std::size_t>(reinterpret_cast<std::uintptr_t>(srfs_bright_stars_end) -
                                   reinterpret_cast<std::uintptr_t>(srfs_bright_stars_begin))};
}

const std::uint8_t* entry(std::size_t star) {
  return srfs_bright_stars_begin + star * star_octets;
}

double magnitude_of(const std::uint8_t* in) {
  return in[6] / 20.0;
}

std::int32_t declination_units(const std::uint8_t* in) {
  const std::int32_t dec = take_24(in + 3);
  return dec >= 1 << 23 ? dec - (1 << 24) : dec;
}

CatalogueStar star_of(const std::uint8_t* in) {
  return {direction_of(360 * turns_per_unit * take_24(in), 360 * turns_per_unit * declination_units(in)),
          magnitude_of(in)};
}

/// How many there are, the brightest first.
std::size_t brighter_than(double faintest) {
  std::size_t low = 0;
  std::size_t high = content().size() / star_octets;
  while (low < high) {
    const std::size_t middle = low + (high - low) / 2;
    if (magnitude_of(entry(middle)) < faintest)
      low = middle + 1;
    else
      high = middle;
  }
  return low;
}

}  // namespace

Eigen::Vector3d direction_of(double ra_deg, double dec_deg) {
  const double ra = ra_deg * std::numbers::pi / 180;
  const double dec = dec_deg * std::numbers::pi / 180;
  return {std::cos(dec) * std::cos(ra), std::cos(dec) * std::sin(ra), std::sin(dec)};
}

std::vector<CatalogueStar> bright_stars(double faintest) {
  const std::size_t count = brighter_than(faintest);
  std::vector<CatalogueStar> stars;
  stars.reserve(count);
  for (std::size_t star = 0; star < count; ++star) stars.push_back(star_of(entry(star)));
  return stars;
}

std::vector<CatalogueStar> stars_around(const Eigen::Vector3d& direction, double radius_rad,
                                        double faintest) {
  std::vector<CatalogueStar> stars;
  if (!direction.allFinite() || !(radius_rad >= 0)) return stars;
  const double dec = std::asin(std::clamp(direction.z(), -1.0, 1.0));
  const double from = (dec - radius_rad) / (2 * std::numbers::pi * turns_per_unit) - 1;
  const double to = (dec + radius_rad) / (2 * std::numbers::pi * turns_per_unit) + 1;
  const double cosine = std::cos(radius_rad);
  const std::size_t count = brighter_than(faintest);
  for (std::size_t star = 0; star < count; ++star) {
    const std::uint8_t* const in = entry(star);
    const std::int32_t units = declination_units(in);  // most stars are too far north or south
    if (units < from || units > to) continue;
    const CatalogueStar found = star_of(in);
    if (found.direction.dot(direction) >= cosine) stars.push_back(found);
  }
  return stars;
}

SkyIndex::SkyIndex(const std::vector<Eigen::Vector3d>& directions, double cell_rad) {
  const int bands = std::max(1, static_cast<int>(std::numbers::pi / cell_rad));
  band_rad_ = std::numbers::pi / bands;
  std::size_t cells = 0;
  for (int b = 0; b < bands; ++b) {
    const double dec = (b + 0.5) * band_rad_ - std::numbers::pi / 2;
    const int n = std::max(1, static_cast<int>(2 * std::numbers::pi * std::cos(dec) / cell_rad));
    bands_.push_back({cells, n});
    cells += static_cast<std::size_t>(n);
  }
  first_.assign(cells + 1, 0);
  std::vector<std::uint32_t> of;
  of.reserve(directions.size());
  for (const Eigen::Vector3d& d : directions) {
    of.push_back(static_cast<std::uint32_t>(cell_of(d)));
    ++first_[of.back() + 1];
  }
  for (std::size_t i = 1; i < first_.size(); ++i) first_[i] += first_[i - 1];
  entries_.resize(directions.size());
  std::vector<std::uint32_t> next(first_.begin(), first_.end() - 1);
  for (std::size_t i = 0; i < directions.size(); ++i)
    entries_[next[of[i]]++] = {directions[i].cast<float>(), static_cast<std::uint32_t>(i)};
}

std::size_t SkyIndex::cell_of(const Eigen::Vector3d& direction) const {
  const double dec = std::asin(std::clamp(direction.z(), -1.0, 1.0));
  const double ra = std::atan2(direction.y(), direction.x());
  const auto band = static_cast<std::size_t>(std::clamp(
      static_cast<int>((dec + std::numbers::pi / 2) / band_rad_), 0, static_cast<int>(bands_.size()) - 1));
  const int cell = static_cast<int>((ra + std::numbers::pi) / (2 * std::numbers::pi) * bands_[band].cells);
  return bands_[band].first_cell + static_cast<std::size_t>(std::clamp(cell, 0, bands_[band].cells - 1));
}

}  // namespace srfs::image
