// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "image/star_finder.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numbers>
#include <numeric>
#include <optional>

#include "image/filter.hpp"
#include "image/place_index.hpp"
#include "image/rows.hpp"
#include "image/saturated_core.hpp"
#include "image/two_stars.hpp"

namespace srfs::image {
namespace {

constexpr float candidate_least = 3.5F;  ///< in noise of the filtered frame
constexpr std::size_t candidates_max = 60000;
/// What a bright star's model may leave of it: as the frame's own bright stars show, within these; the most
/// where there are too few.
constexpr double model_error_most = 0.06;
constexpr double model_error_least = 0.025;
constexpr float model_error_height = 60;  ///< of stars that show it
constexpr double flanks_least = 1e-4;  ///< of its height: where the flanks of a star are still of its shape
/// Of its flanks' energy: more in pictures that are no linear measure of light, where the model says nothing
/// of a core.
constexpr double unexplained_most = 0.35;
constexpr int halo_radius_max = 200;    ///< px, around a saturated star
constexpr float halo_least = 0.15F;     ///< in noise: its end
constexpr double ray_reach_px = 150;    ///< of the light that struts or the lens throw
constexpr double ray_least = 0.05;      ///< of a star's height: rays are fainter
constexpr double saturated_least = 10;  ///< significance of the flanks of a star with a saturated core
/// Unexplained energy that the model's own error may leave.
constexpr double sharper_share = 0.02;
/// What chi squared has to gain by a second star beside what the chance of one so close takes from it (three
/// parameters), within limits; and a share of the first one's energy for what its model lacks.
constexpr double split_gain = 6;
constexpr double split_least = 10;
constexpr double split_most = 25;
constexpr double split_share = 0.5;  ///< of the model's error, squared
/// Perhaps two: wider than the frame's stars by so much, after so many errors of its width; and what the
/// heights have to be in their errors.
struct Doubt {
  double scale;
  double errors;
  double height_errors;
};
constexpr Doubt seldom{1.1, 2.5, 4};
constexpr Doubt readily{1, 0.5, 1.5};
/// Hidden stars are at most so far from the one that hid them, in FWHM.
constexpr double beside_most = 1.4;
/// A wrong level of the sky that matters, times the width of a star, both in noise and px.
constexpr float level_least = 0.05F;

/// A frame with so few single pixels beside each star needs no margin.
constexpr double pixel_odds = 8;
constexpr float dark_least = 4.1F;  ///< of a dark peak, in noise
constexpr double dark_limit_most = 20;
constexpr double dark_by_chance = 3;
constexpr double ring_most = 20;     ///< significance: what is brighter stays
constexpr double rings_least = 0.3;  ///< of them beside each bright star
constexpr double dark_star = 30;     ///< height: beside it coding rings
/// What bright stars have beside themselves in common the lens makes. Stars of such a height show it, this
/// many of the nearest ones, no fainter than this share of the star; within so many FWHM and px.
constexpr double common_height = 25;
constexpr std::size_t common_least = 5;
constexpr std::size_t common_most = 12;
constexpr double common_share = 0.2;
constexpr double common_reach = 3.5;
constexpr double common_reach_px = 4;
constexpr double companion_nearest = 0.3;  ///< in FWHM
constexpr double companion_most = 0.5;     ///< of the star's height
/// Common light is above nothing by so many errors; what is no more than so many spreads above it is of it.
constexpr double common_certain = 1.5;
constexpr double common_errors = 3;
constexpr int common_sides = 8;  ///< of one star
/// Share of the bright stars' light that their shape leaves at least.
constexpr double common_shape_error = 0.04;
/// Stars of their own shape: as bright, as little explained, with as little light around.
constexpr float odd_height = 20;
constexpr float odd_share = 0.6F;
constexpr double odd_ring = 0.35;
constexpr double odd_narrow = 0.12;  ///< of the squared widths
constexpr double odd_scale = 1.35;
constexpr std::size_t odd_peaks_most = 20000;

struct Peak {
  int x;
  int y;
  float value;
};

struct Fitted {
  double x = 0;
  double y = 0;
  double height = 0;
  double energy = 0;  ///< sum of the squared profile over the pixels used
  double scale = 1;   ///< width beside the frame's
  double scale_error = 0;
  double noise = 1;      ///< of the filtered frame here
  double left_over = 0;  ///< of brighter stars, here
  double significance = 0;
  double margin = std::numeric_limits<double>::infinity();  ///< over what few pixels would explain
  double unexplained = 0;  ///< share of the flanks' energy, of a star with a saturated core
  int radius = 0;
  bool odd = false;      ///< not of the frame's shape
  bool changed = true;   ///< it or its surroundings, since it was last fitted
  bool crowded = false;  ///< has neighbours
  bool touched = false;  ///< by one of similar brightness
  bool settled = false;  ///< the last fit changed nothing
};

class Finder {
 public:
  Finder(const CleanFrame& clean, const StarOptions& options)
      : clean_(clean),
        psf_(clean.psf),
        profile_(clean.psf.profile()),
        options_(options),
        doubt_(options.close_ones ? readily : seldom),
        residual_(clean.signal) {
    const int r = 3 * psf_.fit_radius();
    double light = 0;
    double energy = 0;
    for (int y = -r; y <= r; ++y) {
      for (int x = -r; x <= r; ++x) {
        const double h = double(psf_.height(static_cast<float>(x), static_cast<float>(y)));
        energy_ += h * h;
        if (std::hypot(x, y) > psf_.fit_radius() + 0.5) continue;
        light += h;
        energy += h * h;
      }
    }
    per_level_ = light / energy;
  }

  StarField run() {
    for (int pass = 0; pass < 2; ++pass) {
      if (pass == 0)
        try_saturated_cores();
      else
        level_residual();
      blank_saturated_cores();
      gaussian_filter(residual_, psf_.sigma_px(), filtered_);
      // The second time without the known stars, whose light counts as noise the first time.
      noise_ = measure_flattened(filtered_, nullptr).noise;
      const auto& nodes = noise_.nodes().cells();
      lowest_noise_ = std::max(0.5F, *std::min_element(nodes.begin(), nodes.end()));
      for (Fitted& star : stars_) star.noise = noise_at(star.x, star.y);
      if (pass > 0 && options_.close_ones) find_dark_peaks();
      const std::size_t known = stars_.size();
      const PlaceIndex places(stars_);
      for (const Peak& peak : find_peaks()) {
        if (is_on_ray(peak)) continue;
        if (pass == 0 || !options_.close_ones || !try_beside(peak, places)) try_peak(peak, pass);
      }
      if (stars_.size() == known && (pass > 0 || stars_.empty())) break;
      if (pass == 0) {
        measure_shot_noise();
        measure_model_error();
      }
      find_crowds(known);
      refine();
    }
    select();
    if (options_.close_ones) keep_odd_stars();
    return result();
  }

 private:
  [[nodiscard]] double noise_at(double x, double y) const { return std::max(0.5, double(noise_.at(x, y))); }

  /// Sky that was hidden by stars: in crowded fields their light lifted the level that was taken away.
  void level_residual() {
    Grid<std::uint8_t> masked(residual_.width(), residual_.height());
    for (const Fitted& star : stars_) mask(star, masked);
    const Surface level = measure_flattened(residual_, &masked).level;
    const auto [lowest, highest] =
        std::minmax_element(level.nodes().cells().begin(), level.nodes().cells().end());
    if (std::max(-*lowest, *highest) * psf_.sigma_px() < level_least) return;
    std::vector<float> row(static_cast<std::size_t>(residual_.width()));
    for (int y = 0; y < residual_.height(); ++y) {
      level.row(y, row);
      subtract(residual_.row(y), row.data(), residual_.width());
    }
    // The stars were fitted on it: their heights are wrong by so much, and where it matters so is the rest.
    for (Fitted& star : stars_) {
      const float here = level.at(star.x, star.y);
      Fitted less = star;
      less.height = per_level_ * double(here);
      add_light(less, 1);
      star.height -= less.height;
      star.changed = star.changed || is_saturated(star) || !(star.height > 0) ||
                     std::abs(here) * psf_.sigma_px() > level_least;
    }
  }

  [[nodiscard]] std::vector<Peak> find_peaks() const {
    std::vector<Peak> peaks;
    const int w = filtered_.width();
    const int h = filtered_.height();
    std::vector<float> limit(static_cast<std::size_t>(w));
    std::vector<int> above_limit;
    for (int y = 0; y < h; ++y) {
      if (y % noise_rows == 0) {
        noise_.row(std::min(h - 1, y + noise_rows / 2), limit);
        for (float& v : limit) v = std::max(1.0F, candidate_least * v);
      }
      find_above(filtered_.row(y), limit.data(), w, above_limit);
      for (const int x : above_limit) {
        if (is_peak(x, y)) peaks.push_back({x, y, filtered_.at(x, y)});
      }
    }
    const auto brighter = [](const Peak& a, const Peak& b) {
      return a.value != b.value ? a.value > b.value : (a.y != b.y ? a.y < b.y : a.x < b.x);
    };
    if (peaks.size() > candidates_max) {
      std::nth_element(peaks.begin(), peaks.begin() + candidates_max, peaks.end(), brighter);
      peaks.resize(candidates_max);
    }
    std::sort(peaks.begin(), peaks.end(), brighter);
    return peaks;
  }

  /// Of equal neighbours the last counts.
  [[nodiscard]] bool is_peak(int x, int y) const {
    const float v = filtered_.at(x, y);
    for (int j = -1; j <= 1; ++j) {
      for (int i = -1; i <= 1; ++i) {
        if ((i == 0 && j == 0) || !filtered_.contains(x + i, y + j)) continue;
        const float other = filtered_.at(x + i, y + j);
        const bool later = j > 0 || (j == 0 && i > 0);
        if (later ? v <= other : v < other) return false;
      }
    }
    return true;
  }

  /// Light at the same distance on two opposite sides, about as much as in the middle: a streak or a surface.
  [[nodiscard]] bool drawn_out(const Peak& peak) const {
    const double d = std::max(2.0, 1.5 * psf_.fwhm_px());
    for (int k = 0; k < 8; ++k) {
      const double angle = k * std::numbers::pi / 8;
      const int dx = static_cast<int>(std::lround(d * std::cos(angle)));
      const int dy = static_cast<int>(std::lround(d * std::sin(angle)));
      if (!filtered_.contains(peak.x + dx, peak.y + dy) || !filtered_.contains(peak.x - dx, peak.y - dy))
        continue;
      const float one = filtered_.at(peak.x + dx, peak.y + dy);
      const float other = filtered_.at(peak.x - dx, peak.y - dy);
      if (std::min(one, other) > 0.5F * peak.value && std::max(one, other) < 1.3F * peak.value) return true;
    }
    return false;
  }

  [[nodiscard]] bool is_saturated(const Fitted& star) const { return star.radius > psf_.fit_radius(); }

  /// A star whose core is saturated, by what is around it. @param dx  where to start, from the core's middle
  [[nodiscard]] std::optional<Fitted> fit_flanks(const SaturatedCore& core, double dx, double dy) {
    Fitted star;
    star.x = core.x + dx;
    star.y = core.y + dy;
    star.radius = psf_.fit_radius() + core.radius;
    take_patch(residual_, clean_.flaws, core.x, core.y, star.radius, patch_);
    if (!fit_height(star)) return std::nullopt;
    Fitted better = star;
    if (fit_patch(better, 8, 0) && std::hypot(better.x - core.x, better.y - core.y) < 1 + 0.3 * core.radius)
      star = better;
    star.unexplained = unexplained(star);
    return star;
  }

  /// Stars far over saturation: nothing but their flanks is known.
  void try_saturated_cores() {
    for (const SaturatedCore& core : find_saturated_cores(clean_.flaws)) {
      // Farther out the shape says nothing: a planet, a lamp.
      if (core.radius - 1 > psf_.radius_at(flanks_least)) continue;
      std::optional<Fitted> star = fit_flanks(core, 0, 0);
      // Flanks so steep may lead astray from where they start.
      for (int k = 0; k < 8 && star && star->unexplained > unexplained_most; ++k) {
        const double angle = k * std::numbers::pi / 4;
        const double away = 0.3 * psf_.fwhm_px();
        const auto other = fit_flanks(core, away * std::cos(angle), away * std::sin(angle));
        if (other && other->unexplained < star->unexplained) star = other;
      }
      if (!star || star->unexplained > unexplained_most) {
        odd_cores_.push_back(core);
        continue;
      }
      judge(*star, 0, 0);
      if (star->significance < saturated_least) continue;
      add_light(*star, -1);
      take_halo_away(*star);
      stars_.push_back(*star);
    }
    glaring_ = stars_;
    glaring_places_ = PlaceIndex(glaring_);
  }

  /// Share of the energy of the patch's light that a star's model leaves, without that of the noise.
  [[nodiscard]] double unexplained(const Fitted& star) {
    profile_heights(profile_, patch_, static_cast<float>(star.x), static_cast<float>(star.y), heights_);
    double energy = 0, left = 0;
    for (std::size_t i = 0; i < patch_.size(); ++i) {
      const double use = double(patch_.use[i]);
      const double rest = double(patch_.light[i]) - star.height * double(heights_[i]);
      energy += use * (double(patch_.light[i]) * double(patch_.light[i]) - 1);
      left += use * (rest * rest - 1);
    }
    return energy > 0 ? left / energy : 1;
  }

  /// What a star so bright leaves all around itself: optics scatter more light than the shape of faint stars
  /// shows.
  void take_halo_away(const Fitted& star) {
    std::vector<float> halo;  // by distance
    std::vector<float> ring;
    int quiet = 0;
    for (int r = 0; r < halo_radius_max && quiet < 3; ++r) {
      ring.clear();
      for_ring(star, r, [&](int x, int y) {
        if (clean_.flaws.at(x, y) == 0) ring.push_back(residual_.at(x, y));
      });
      halo.push_back(ring.size() < 8 ? 0 : median_of(ring));
      quiet = r > star.radius && std::abs(halo.back()) < halo_least ? quiet + 1 : 0;
    }
    halo.push_back(0);
    halo.push_back(0);
    const Area a = area(star.x, star.y, static_cast<int>(halo.size()));
    for (int y = a.y0; y <= a.y1; ++y) {
      for (int x = a.x0; x <= a.x1; ++x) {
        const double r = std::hypot(x - star.x, y - star.y);
        const auto i = static_cast<std::size_t>(r);
        if (i + 1 >= halo.size()) continue;
        const auto share = static_cast<float>(r - static_cast<double>(i));
        residual_.at(x, y) -= (1 - share) * halo[i] + share * halo[i + 1];
      }
    }
  }

  /// Calls use(x, y) for the pixels of the frame whose distance from a star rounds to r.
  template <class Use>
  void for_ring(const Fitted& star, int r, Use&& use) const {
    const Area a = area(star.x, star.y, r + 1);
    for (int y = a.y0; y <= a.y1; ++y) {
      const double dy = y - star.y;
      const double outer = (r + 0.5) * (r + 0.5) - dy * dy;
      if (outer <= 0) continue;
      const double inner = (r - 0.5) * (r - 0.5) - dy * dy;
      const double far = std::sqrt(outer);
      const double near = r > 0 && inner > 0 ? std::sqrt(inner) : 0;
      const auto span = [&](double from, double end) {
        const int last = std::min(a.x1, static_cast<int>(std::ceil(end)) - 1);
        for (int x = std::max(a.x0, static_cast<int>(std::ceil(from))); x <= last; ++x) use(x, y);
      };
      span(star.x - far, near > 0 ? star.x - near : star.x);
      span(near > 0 ? star.x + near : star.x, star.x + far);
    }
  }

  /// Nothing is known of a saturated pixel that a star explains; more light than that stays.
  void blank_saturated_cores() {
    for (const Fitted& star : stars_) {
      if (!is_saturated(star)) continue;
      const Area a = area(star.x, star.y, star.radius);
      for (int y = a.y0; y <= a.y1; ++y) {
        for (int x = a.x0; x <= a.x1; ++x) {
          if ((clean_.flaws.at(x, y) & flaw_saturated) == 0) continue;
          const float light = psf_.height(static_cast<float>(x - star.x), static_cast<float>(y - star.y));
          residual_.at(x, y) =
              std::max(0.0F, clean_.signal.at(x, y) - static_cast<float>(star.height) * light);
        }
      }
    }
  }

  /// Least squares of the height alone, on the patch.
  [[nodiscard]] bool fit_height(Fitted& star) {
    profile_heights(profile_, patch_, static_cast<float>(star.x), static_cast<float>(star.y), heights_);
    double product = 0, energy = 0;
    for (std::size_t i = 0; i < patch_.size(); ++i) {
      product += double(patch_.use[i]) * double(heights_[i]) * double(patch_.light[i]);
      energy += double(patch_.use[i]) * double(heights_[i]) * double(heights_[i]);
    }
    if (!(product > 0)) return false;
    star.height = product / energy;
    star.energy = energy;
    return true;
  }

  /// Light away from a saturated star and, where the star lets it be seen, towards it: a knot of a ray that
  /// struts or the lens make.
  [[nodiscard]] bool is_on_ray(const Peak& peak) const {
    const double d = std::max(2.0, 1.5 * psf_.fwhm_px());
    bool found = false;
    glaring_places_.near(peak.x, peak.y, ray_reach_px, [&](std::size_t i, double distance) {
      const Fitted& star = glaring_[i];
      if (found || distance < 1 || double(peak.value) / std::sqrt(energy_) > ray_least * star.height) return;
      const int dx = static_cast<int>(std::lround(d * (star.x - peak.x) / distance));
      const int dy = static_cast<int>(std::lround(d * (star.y - peak.y) / distance));
      found = filtered_.contains(peak.x + dx, peak.y + dy) && filtered_.contains(peak.x - dx, peak.y - dy) &&
              (distance < star.radius + d ||  // what is closer the star hides
               filtered_.at(peak.x + dx, peak.y + dy) > 0.5F * peak.value) &&
              filtered_.at(peak.x - dx, peak.y - dy) > 0.3F * peak.value &&
              (clean_.flaws.at(peak.x - dx, peak.y - dy) & flaw_saturated) == 0;  // a column that ran over
    });
    return found;
  }

  void try_peak(const Peak& peak, int pass) {
    Fitted star;
    star.x = peak.x;
    star.y = peak.y;
    star.noise = noise_at(peak.x, peak.y);
    star.radius = psf_.fit_radius();
    star.height = double(peak.value) / std::sqrt(energy_);
    int run = 0;  // half the width of a saturated patch
    while (run < 40 && clean_.flaws.contains(peak.x + run, peak.y) &&
           (clean_.flaws.at(peak.x + run, peak.y) & flaw_saturated) != 0)
      ++run;
    star.radius += run;
    if (run == 0 && peak.value < 60 && drawn_out(peak)) return;
    if (!fit(star, 4, 0)) return;
    if (std::hypot(star.x - peak.x, star.y - peak.y) > std::max(1.5, 0.7 * psf_.fwhm_px()) + run) return;
    if (star.energy < (run > 0 ? 0.02 : 0.4) * energy_) return;
    judge(star, pass, 0);
    if (star.significance < double(candidate_least)) return;
    if (run == 0) {
      take_patch(residual_, clean_.flaws, star.x, star.y, star.radius + 1, patch_);
      star.margin = better_than_pixels(star);
      if (star.margin < 0 && pass == 0) ++pixels_;
      if (star.margin < 0 || !has_star_width(star, 2)) return;
    }
    add_light(star, -1);
    stars_.push_back(star);
  }

  /// Light that is left beside a star that was fitted alone: what was hidden has pulled its place and height.
  /// @return whether there are two now
  [[nodiscard]] bool try_beside(const Peak& peak, const PlaceIndex& places) {
    std::size_t nearest = stars_.size();
    double closest = beside_most * psf_.fwhm_px();
    places.near(peak.x, peak.y, closest, [&](std::size_t i, double distance) {
      if (distance <= closest) nearest = i, closest = distance;
    });
    if (nearest == stars_.size()) return false;
    Fitted first = stars_[nearest];
    if (is_saturated(first)) return false;
    take_with_light(first, first.radius + 1);
    Fitted second = first;
    const double height = 1.3 * double(peak.value) / std::sqrt(energy_);
    if (!split(first, second, {{first.x, double(peak.x)}, {first.y, double(peak.y)}, {first.height, height}}))
      return false;
    replace(stars_[nearest], first, second);
    stars_.push_back(second);
    return true;
  }

  /// The light of one star by that of two.
  void replace(Fitted& star, const Fitted& first, const Fitted& second) {
    add_light(star, 1);
    add_light(first, -1);
    add_light(second, -1);
    star = first;
  }

  [[nodiscard]] static double significance_of(const Fitted& star) {
    return star.height / std::hypot(star.noise / std::sqrt(star.energy), star.left_over);
  }

  /// Significance beside the noise and beside what brighter stars leave.
  /// @param own  height of the star's own light that was taken away from the residual
  void judge(Fitted& star, int pass, double own) const {
    const int x = std::clamp(static_cast<int>(std::lround(star.x)), 0, residual_.width() - 1);
    const int y = std::clamp(static_cast<int>(std::lround(star.y)), 0, residual_.height() - 1);
    double others = 0;
    for (int j = std::max(0, y - 1); j <= std::min(residual_.height() - 1, y + 1); ++j) {
      for (int i = std::max(0, x - 1); i <= std::min(residual_.width() - 1, x + 1); ++i) {
        const double own_light =
            own * double(psf_.height(static_cast<float>(i - star.x), static_cast<float>(j - star.y)));
        others = std::max(others, double(clean_.signal.at(i, j)) - double(residual_.at(i, j)) - own_light);
      }
    }
    star.left_over = (pass == 0 ? 1 : 1.5) * model_error_ * others;
    star.significance = significance_of(star);
  }

  struct Area {
    int x0, y0, x1, y1;
  };
  [[nodiscard]] Area area(double x, double y, int radius) const {
    const int xi = static_cast<int>(std::lround(x));
    const int yi = static_cast<int>(std::lround(y));
    return {std::max(0, xi - radius), std::max(0, yi - radius), std::min(residual_.width() - 1, xi + radius),
            std::min(residual_.height() - 1, yi + radius)};
  }

  /// Least squares of position and height on the residual frame. @param shot  share of a pixel's light in its
  /// variance
  [[nodiscard]] bool fit(Fitted& star, int rounds, double shot) {
    take_patch(residual_, clean_.flaws, star.x, star.y, star.radius, patch_);
    return fit_patch(star, rounds, shot);
  }

  /// The patch around a star that was taken away, with its light.
  void take_with_light(const Fitted& star, int radius) {
    take_patch(residual_, clean_.flaws, star.x, star.y, radius, patch_);
    profile_heights(profile_, patch_, static_cast<float>(star.x), static_cast<float>(star.y), heights_);
    const auto height = static_cast<float>(star.height);
    for (std::size_t i = 0; i < patch_.size(); ++i) patch_.light[i] += height * heights_[i];
  }

  [[nodiscard]] bool fit_patch(Fitted& star, int rounds, double shot) {
    for (int round = 0; round < rounds; ++round) {
      const FitSums f = fit_sums(profile_, patch_, static_cast<float>(star.x), static_cast<float>(star.y),
                                 static_cast<float>(star.height), static_cast<float>(shot));
      star.energy = double(f.energy);
      // A star at the frame's edge or behind a saturated core leaves directions unseen.
      const double xx = double(f.xx) * 1.0001, yy = double(f.yy) * 1.0001, hh = double(f.hh) * 1.0001;
      const double xy = double(f.xy), xh = double(f.xh), yh = double(f.yh);
      const double rx = double(f.rx), ry = double(f.ry), rh = double(f.rh);
      const double c00 = yy * hh - yh * yh;
      const double c01 = xh * yh - xy * hh;
      const double c02 = xy * yh - xh * yy;
      const double det = xx * c00 + xy * c01 + xh * c02;
      if (!(det > 0)) return false;
      double dx = (c00 * rx + c01 * ry + c02 * rh) / det;
      double dy = (c01 * rx + (xx * hh - xh * xh) * ry + (xy * xh - xx * yh) * rh) / det;
      const double dh = (c02 * rx + (xy * xh - xx * yh) * ry + (xx * yy - xy * xy) * rh) / det;
      if (!std::isfinite(dx + dy + dh)) return false;
      const double longest = 0.4 * psf_.fwhm_px();
      const double length = std::hypot(dx, dy);
      if (length > longest) dx *= longest / length, dy *= longest / length;
      star.x += dx;
      star.y += dy;
      star.height += length > longest ? 0.0 : dh;
      if (!(star.height > 0)) return false;
      if (length < 0.03 * psf_.fwhm_px() / std::max(3.0, star.height) && std::abs(dh) < 0.05) break;
    }
    return star.x > -1 && star.y > -1 && star.x < residual_.width() && star.y < residual_.height();
  }

  void add_light(const Fitted& star, float sign) {
    add_star(psf_, sign * static_cast<float>(star.height), star.x, star.y, residual_);
  }

  /// By how much better, in chi squared, a star explains the peak than one pixel alone or two that touch. The
  /// star is in the patch.
  [[nodiscard]] double better_than_pixels(const Fitted& star) {
    profile_heights(profile_, patch_, static_cast<float>(star.x), static_cast<float>(star.y), heights_);
    float product = 0;
    float energy = 0;
    float of_one = 0;
    float of_two = 0;
    const auto square = [&](int x, int y) {
      if (!residual_.contains(x, y) || clean_.flaws.at(x, y) != 0) return 0.0F;
      const float v = std::max(0.0F, residual_.at(x, y));
      return v * v;
    };
    for (std::size_t i = 0; i < patch_.size(); ++i) {
      const float p = heights_[i] * patch_.use[i];
      product += p * patch_.light[i];
      energy += p * p;
      if (p <= 0.3F) continue;
      const int x = patch_.x + static_cast<int>(patch_.dx[i]);
      const int y = patch_.y + static_cast<int>(patch_.dy[i]);
      const float here = square(x, y);
      of_one = std::max(of_one, here);
      for (const float next :
           {square(x + 1, y), square(x - 1, y + 1), square(x, y + 1), square(x + 1, y + 1)})
        of_two = std::max(of_two, here + next);
    }
    const float of_star = product * product / energy;
    return double(of_star - std::max(of_one, of_two - 3));
  }

  /// Measures the width beside the frame's, on the patch. @return false for what is clearly no star
  [[nodiscard]] bool has_star_width(Fitted& star, int rounds) {
    double log_scale = std::log(star.scale);
    double height = star.height;
    double ss_last = 0;
    for (int round = 0; round < rounds; ++round) {
      const WidthSums f = width_sums(profile_, patch_, static_cast<float>(star.x), static_cast<float>(star.y),
                                     static_cast<float>(height), static_cast<float>(std::exp(-2 * log_scale)),
                                     static_cast<float>(shot_));
      const double ss = double(f.ss), sh = double(f.sh), hh = double(f.hh), rs = double(f.rs),
                   rh = double(f.rh);
      const double det = ss * hh - sh * sh;
      if (!(det > 1e-9 * ss * hh)) break;
      const double step = std::clamp((hh * rs - sh * rh) / det, -0.4, 0.4);
      log_scale = std::clamp(log_scale + step, -1.5, 1.2);
      height = std::max(0.1 * star.height, height + (ss * rh - sh * rs) / det);
      ss_last = det / hh;
      if (std::abs(step) < 0.01) break;
    }
    star.scale = std::exp(log_scale);
    star.scale_error = ss_last > 0 ? star.scale / std::sqrt(ss_last) : star.scale;
    // Beyond three errors and beyond what blends and the field's corners do.
    if (star.scale - 3 * star.scale_error > 1.9) return false;
    return star.scale + 3 * star.scale_error > 0.6;
  }

  /// How much more bright pixels scatter than dark ones, from the bright stars' own residuals.
  void measure_shot_noise() {
    std::vector<float> shares;
    for (const Fitted& star : stars_) {
      if (star.height < 15 || is_saturated(star) || shares.size() >= 200) continue;
      take_patch(residual_, clean_.flaws, star.x, star.y, star.radius, patch_);
      profile_heights(profile_, patch_, static_cast<float>(star.x), static_cast<float>(star.y), heights_);
      float excess = 0;
      float light = 0;
      for (std::size_t i = 0; i < patch_.size(); ++i) {
        excess += patch_.use[i] * (patch_.light[i] * patch_.light[i] - 1);
        light += patch_.use[i] * static_cast<float>(star.height) * heights_[i];
      }
      shares.push_back(excess / light);
    }
    if (shares.size() >= 5) shot_ = std::clamp(double(median_of(shares)), 0.0, 0.5);
  }

  /// What the brightest stars leave beyond their noise, beside their light.
  void measure_model_error() {
    std::vector<float> shares;
    for (const Fitted& star : stars_) {
      if (star.height < double(model_error_height) || is_saturated(star) || shares.size() >= 50) continue;
      take_with_light(star, star.radius);
      profile_heights(profile_, patch_, static_cast<float>(star.x), static_cast<float>(star.y), heights_);
      double excess = 0;
      double energy = 0;
      for (std::size_t i = 0; i < patch_.size(); ++i) {
        const double model = star.height * double(heights_[i]);
        const double r = double(patch_.light[i]) - model;
        const double variance = 1 + shot_ * model;
        excess += double(patch_.use[i]) * (r * r / variance - 1);
        energy += double(patch_.use[i]) * model * model / variance;
      }
      shares.push_back(static_cast<float>(excess / energy));
    }
    if (shares.size() < 5) return;
    shape_error_ = std::sqrt(std::max(0.0, double(median_of(shares))));
    if (options_.close_ones) model_error_ = std::clamp(shape_error_, model_error_least, model_error_most);
  }

  /// Which stars have neighbours whose light matters, which of those are new since @p known, and which touch.
  void find_crowds(std::size_t known) {
    const double reach = 3 * psf_.fwhm_px();
    const double touch = 2.2 * psf_.fwhm_px();
    const PlaceIndex places(stars_);
    for (std::size_t i = 0; i < stars_.size(); ++i) {
      Fitted& star = stars_[i];
      star.crowded = star.touched = false;
      star.changed = star.changed || i >= known;
      places.near(star.x, star.y, reach, [&](std::size_t other, double distance) {
        if (other == i) return;
        star.crowded = true;
        star.changed = star.changed || other >= known;
        star.touched = star.touched || (distance < touch && stars_[other].height < 6 * star.height &&
                                        stars_[other].height > star.height / 6);
      });
    }
  }

  /// What changed again, with its neighbours taken away.
  void refine() {
    for (int round = 0; round < 4; ++round) {
      double farthest = 0;
      for (Fitted& star : stars_) {
        if (!star.changed || (round > 0 && (!star.crowded || star.settled))) continue;
        Fitted better = star;
        take_with_light(star, star.radius);
        const bool fits = fit_patch(better, 2, shot_);
        const double moved = std::hypot(better.x - star.x, better.y - star.y);
        if ((!fits || moved > psf_.fwhm_px()) && is_saturated(star) && better.height > 0) {
          star.settled = true;
          continue;
        }
        if (!fits || moved > psf_.fwhm_px()) {
          add_light(star, 1);
          star.height = 0;
          continue;
        }
        // In noise, of what the frame without its stars changes by.
        const double change = moved / psf_.fwhm_px() * star.height + std::abs(better.height - star.height);
        better.settled = change < 0.1;
        if (change > 0.02) {
          add_light(star, 1);
          star = better;
          add_light(star, -1);
        }
        farthest = std::max(farthest, change);
      }
      std::erase_if(stars_, [](const Fitted& s) { return s.height <= 0; });
      if (farthest < 0.1) break;
    }
    judge_changed();
  }

  /// Beside the other stars only.
  void judge_changed() {
    constexpr double any = std::numeric_limits<double>::infinity();
    std::vector<Fitted> second_stars;
    for (Fitted& star : stars_) {
      if (!star.changed) continue;
      star.changed = false;
      judge(star, 1, star.height);
      const bool saturated = is_saturated(star);  // its core is unknown
      take_with_light(star, star.radius + 1);
      const bool has_width = saturated || has_star_width(star, 4);
      const bool is_star = saturated || (has_width && !is_sharper(star));
      Fitted first = star;
      Fitted second = star;
      const bool wide = !saturated && star.scale - doubt_.errors * star.scale_error > doubt_.scale;
      if (!wide || !(is_star || options_.close_ones) ||
          !split(first, second, drawn_apart(star), is_star ? any : mismatch_of_two())) {
        if (is_star) continue;
        add_light(star, 1);
        sharp_.push_back(star);
        star.height = 0;
        continue;
      }
      replace(star, first, second);
      second_stars.push_back(second);
    }
    std::erase_if(stars_, [](const Fitted& s) { return s.height <= 0; });
    stars_.insert(stars_.end(), second_stars.begin(), second_stars.end());
  }

  /// The likelier two stars are so close by chance, the less the light has to say for it.
  [[nodiscard]] double gain_least() const {
    if (!options_.close_ones) return split_most;
    const double a_pixel = static_cast<double>(stars_.size()) / static_cast<double>(residual_.size());
    const double chance = std::min(1.0, a_pixel * std::numbers::pi * psf_.fwhm_px() * psf_.fwhm_px());
    return std::clamp(split_gain - 2 * std::log(chance), split_least, split_most);
  }

  /// Chi squared that two stars leave of the patch at most, by chance.
  [[nodiscard]] double mismatch_of_two() const {
    const double n = std::accumulate(patch_.use.begin(), patch_.use.end(), 0.0);
    return n + 4 * std::sqrt(2 * n);
  }

  /// Where two stars would be that one is taken for.
  [[nodiscard]] StarPair drawn_apart(const Fitted& star) {
    const auto [angle, distance] = elongation(star);
    const double dx = distance / 2 * std::cos(angle);
    const double dy = distance / 2 * std::sin(angle);
    const double half = 0.6 * star.height;
    return {{star.x - dx, star.x + dx}, {star.y - dy, star.y + dy}, {half, half}};
  }

  /// Two stars where one was: least squares of both together. @pre the patch is around it, with its light
  /// @param mismatch_most  that they may leave of it, in chi squared beside the noise
  /// @return whether they explain the light of the patch so much better that it is two
  [[nodiscard]] bool split(Fitted& first, Fitted& second, const StarPair& start,
                           double mismatch_most = std::numeric_limits<double>::infinity()) {
    TwoStars two(profile_, patch_, shot_);
    const double before = two.mismatch({{first.x, first.x}, {first.y, first.y}, {first.height, 0}});
    const auto found = two.fit(start, psf_.fwhm_px());
    if (!found) return false;
    const StarPair& s = found->stars;
    const double apart = std::hypot(s.x[1] - s.x[0], s.y[1] - s.y[0]);
    if (apart < 0.35 * psf_.fwhm_px()) return false;
    for (std::size_t k = 0; k < 2; ++k) {
      if (std::hypot(s.x[k] - first.x, s.y[k] - first.y) > 1.2 * beside_most * psf_.fwhm_px()) return false;
      if (s.height[k] < doubt_.height_errors * found->height_errors[k] * first.noise) return false;
    }
    const double gained = before - found->mismatch;
    const double energy = first.height * first.height * first.energy;
    const double share = split_share * model_error_ * model_error_;
    if (gained < gain_least() * first.noise * first.noise + share * energy) return false;
    if (found->mismatch > mismatch_most * first.noise * first.noise + share * energy) return false;
    first.x = s.x[0], first.y = s.y[0], first.height = s.height[0];
    second.x = s.x[1], second.y = s.y[1], second.height = s.height[1];
    for (Fitted* star : {&first, &second}) {
      star->scale = 1;
      star->scale_error = 0.3;
      star->changed = true;
      star->significance = significance_of(*star);
    }
    return true;
  }

  /// Direction in which the light around a star is drawn out, and how far two equal stars would be apart for
  /// that.
  [[nodiscard]] std::pair<double, double> elongation(const Fitted& star) {
    profile_heights(profile_, patch_, static_cast<float>(star.x), static_cast<float>(star.y), heights_);
    double xx = 0, xy = 0, yy = 0, light = 0, xx_of_star = 0, yy_of_star = 0, star_light = 0;
    for (std::size_t i = 0; i < patch_.size(); ++i) {
      if (patch_.use[i] == 0) continue;
      const double dx = patch_.x + double(patch_.dx[i]) - star.x;
      const double dy = patch_.y + double(patch_.dy[i]) - star.y;
      const double weight = std::sqrt(double(heights_[i]));  // a window wider than the star
      const double v = weight * double(patch_.light[i]);
      const double m = weight * double(heights_[i]) * star.height;
      xx += v * dx * dx, xy += v * dx * dy, yy += v * dy * dy, light += v;
      xx_of_star += m * dx * dx, yy_of_star += m * dy * dy, star_light += m;
    }
    const double angle = std::atan2(2 * xy, xx - yy) / 2;
    const double along = (xx + yy) / 2 + std::hypot((xx - yy) / 2, xy);
    const double excess =
        along / std::max(light, 1e-6) - (xx_of_star + yy_of_star) / 2 / std::max(star_light, 1e-6);
    return {angle, std::clamp(2 * std::sqrt(std::max(0.0, 2.5 * excess)), 0.5 * psf_.fwhm_px(),
                              1.2 * psf_.fwhm_px())};
  }

  /// Dark where a star of this brightness would give light: the track of a particle. The star is in the
  /// patch.
  [[nodiscard]] bool is_sharper(const Fitted& star) {
    profile_heights(profile_, patch_, static_cast<float>(star.x), static_cast<float>(star.y), heights_);
    const auto height = static_cast<float>(star.height);
    float missing = 0;
    float energy = 0;
    int n = 0;
    for (std::size_t i = 0; i < patch_.size(); ++i) {
      const float p = heights_[i];
      if (p < 0.08F || patch_.use[i] == 0) continue;
      const float r = std::min(0.0F, patch_.light[i] - height * p);
      missing += r * r / (1 + static_cast<float>(shot_) * height * p);
      energy += height * height * p * p;
      ++n;
    }
    // Half of the pixels are below the model by their noise alone.
    const double by_noise = 0.5 * n + 3.5 * std::sqrt(1.25 * n);
    return double(missing) > by_noise + sharper_share * double(energy);
  }

  /// Where the frame has many single pixels that stand out, a faint star that looks much like one is one, the
  /// likelier the more there are beside each star.
  void drop_likely_pixels() {
    const double share =
        static_cast<double>(pixels_) / static_cast<double>(std::max<std::size_t>(1, stars_.size()));
    const double least = 2 * std::log(std::max(1.0, pixel_odds * share));
    if (least <= 0) return;
    for (Fitted& star : stars_) {
      if (star.margin >= least) continue;
      add_light(star, 1);
      star.height = 0;
    }
    std::erase_if(stars_, [](const Fitted& s) { return s.height <= 0; });
  }

  /// Nothing in the sky is dark: what peaks downwards, away from bright stars, coding and rounding have made,
  /// and as many upwards.
  void find_dark_peaks() {
    const int w = filtered_.width();
    const PlaceIndex places(stars_);
    for (int y = 1; y + 1 < filtered_.height(); ++y) {
      const float* row = filtered_.row(y);
      if (count_below(row, -dark_least * lowest_noise_, w) == 0) continue;
      for (int x = 1; x + 1 < w; ++x) {
        if (row[x] >= -dark_least * lowest_noise_) continue;
        const double depth = -double(row[x]) / noise_at(x, y);
        if (depth < double(dark_least) || !is_lowest(x, y)) continue;
        const double brightest = brightest_near(places, x, y);
        const bool beside_star = brightest > dark_star;
        if (beside_star)
          rings_.push_back(static_cast<float>(depth * noise_at(x, y) / std::sqrt(energy_) / brightest));
        else if (dark_peaks_.size() < candidates_max)
          dark_peaks_.push_back(depth);
      }
    }
  }

  /// Height of the brightest star whose coding or shape may leave something at a place.
  [[nodiscard]] double brightest_near(const PlaceIndex& places, double x, double y) const {
    double height = 0;
    places.near(x, y, 4 * psf_.fwhm_px() + 8, [&](std::size_t i, double distance) {
      if (distance > 0.5) height = std::max(height, stars_[i].height);
    });
    return height;
  }

  /// What bright stars have around themselves downwards they have upwards, too: by coding, or because they
  /// are not of the frame's shape. Faint stars that are no brighter than that are none.
  void drop_rings() {
    const auto bright = static_cast<double>(
        std::count_if(stars_.begin(), stars_.end(), [](const Fitted& s) { return s.height > dark_star; }));
    if (rings_.empty() || certain(static_cast<std::ptrdiff_t>(rings_.size())) < rings_least * bright) return;
    const auto place = rings_.begin() + static_cast<std::ptrdiff_t>(0.9 * static_cast<double>(rings_.size()));
    std::nth_element(rings_.begin(), place, rings_.end());
    const double share = double(*place);
    const PlaceIndex places(stars_);
    std::vector<bool> drop;
    for (const Fitted& star : stars_) {
      const double brightest = brightest_near(places, star.x, star.y);
      drop.push_back(brightest > dark_star && star.height < share * brightest &&
                     star.significance < ring_most);
    }
    drop_stars(drop);
  }

  /// The lens' own shape, where it differs from the frame's (coma, halos, the corners), is no star. A true
  /// companion is one star's alone. Where the frame's shape explains the bright stars there is nothing to
  /// drop; where too few show whether it does, most companions have to be common.
  void drop_common_companions() {
    const bool is_unknown = shape_error_ == 0;
    if (!is_unknown && shape_error_ < common_shape_error) return;
    std::vector<std::size_t> bright;
    for (std::size_t i = 0; i < stars_.size(); ++i) {
      if (stars_[i].height > common_height) bright.push_back(i);
    }
    const PlaceIndex places(stars_);
    std::vector<bool> drop(stars_.size(), false);
    int companions = 0;
    for (const std::size_t b : bright) {
      places.near(stars_[b].x, stars_[b].y, companion_reach(), [&](std::size_t c, double distance) {
        if (drop[c] || c == b || distance < companion_nearest * psf_.fwhm_px()) return;
        if (stars_[c].height > companion_most * stars_[b].height) return;
        ++companions;
        drop[c] = is_common(b, c, bright, places);
      });
    }
    if (is_unknown && 2 * std::count(drop.begin(), drop.end(), true) < companions) return;
    drop_stars(drop);
  }

  void drop_stars(const std::vector<bool>& drop) {
    for (std::size_t i = 0; i < stars_.size(); ++i) {
      if (!drop[i]) continue;
      add_light(stars_[i], 1);
      stars_[i].height = 0;
    }
    std::erase_if(stars_, [](const Fitted& s) { return s.height <= 0; });
  }

  [[nodiscard]] double companion_reach() const { return common_reach * psf_.fwhm_px() + common_reach_px; }

  /// Whether what star @p b has at the place of @p c the bright stars around it have as well, at the same
  /// place or turned with the direction to the frame's middle; or the star itself on its other sides.
  [[nodiscard]] bool is_common(std::size_t b, std::size_t c, const std::vector<std::size_t>& bright,
                               const PlaceIndex& places) {
    const Fitted& star = stars_[b];
    const double dx = stars_[c].x - star.x;
    const double dy = stars_[c].y - star.y;
    const auto share = [&](std::size_t of, double turn) {
      const double u = std::cos(turn);
      const double v = std::sin(turn);
      const double height = light_beside(of, u * dx - v * dy, v * dx + u * dy, places);
      return static_cast<float>(height / stars_[of].height);
    };
    const double own = double(share(b, 0));
    const auto are_alike = [&](std::vector<float>&& shares) {
      const auto n = static_cast<double>(shares.size());
      const Middle middle = middle_of(std::move(shares));
      return middle.value > common_certain * middle.spread / std::sqrt(n) &&
             own < middle.value + common_errors * middle.spread;
    };
    std::vector<float> shares;
    for (int k = 1; k < common_sides; ++k)
      shares.push_back(share(b, k * 2 * std::numbers::pi / common_sides));
    if (are_alike(std::move(shares))) return true;
    const std::vector<std::size_t> others = bright_around(b, c, bright);
    if (others.size() < common_least) return false;
    std::vector<float> as_it_is;
    std::vector<float> turned;
    for (const std::size_t o : others) {
      as_it_is.push_back(share(o, 0));
      turned.push_back(share(o, outwards(stars_[o]) - outwards(star)));
    }
    return are_alike(std::move(as_it_is)) || are_alike(std::move(turned));
  }

  /// Direction from the frame's middle.
  [[nodiscard]] double outwards(const Fitted& star) const {
    return std::atan2(star.y - (residual_.height() - 1) / 2.0, star.x - (residual_.width() - 1) / 2.0);
  }

  /// The stars nearest to @p b that are bright enough to show what it has beside itself, none of them @p c.
  [[nodiscard]] std::vector<std::size_t> bright_around(std::size_t b, std::size_t c,
                                                       const std::vector<std::size_t>& bright) const {
    std::vector<std::pair<double, std::size_t>> others;
    for (const std::size_t o : bright) {
      const Fitted& other = stars_[o];
      if (o == b || other.height < common_share * stars_[b].height) continue;
      if (std::hypot(other.x - stars_[c].x, other.y - stars_[c].y) < companion_reach()) continue;
      others.emplace_back(std::hypot(other.x - stars_[b].x, other.y - stars_[b].y), o);
    }
    const std::size_t n = std::min(others.size(), common_most);
    std::partial_sort(others.begin(), others.begin() + static_cast<std::ptrdiff_t>(n), others.end());
    std::vector<std::size_t> nearest;
    for (std::size_t i = 0; i < n; ++i) nearest.push_back(others[i].second);
    return nearest;
  }

  /// Height of a star with the light at a place beside another one, in the frame without that.
  [[nodiscard]] double light_beside(std::size_t star, double dx, double dy, const PlaceIndex& places) {
    const double x = stars_[star].x + dx;
    const double y = stars_[star].y + dy;
    take_patch(residual_, clean_.flaws, x, y, psf_.fit_radius(), patch_);
    profile_heights(profile_, patch_, static_cast<float>(x), static_cast<float>(y), heights_);
    double product = 0, energy = 0;
    for (std::size_t i = 0; i < patch_.size(); ++i) {
      const double weight = double(patch_.use[i]) * double(heights_[i]);
      product += weight * double(patch_.light[i]);
      energy += weight * double(heights_[i]);
    }
    double height = energy > 0 ? product / energy : 0;
    // Of what was taken for stars there, as much as a star at the place shares with them.
    const double square = 4 * double(psf_.sigma_px()) * double(psf_.sigma_px());
    places.near(x, y, 2 * psf_.fwhm_px(), [&](std::size_t i, double distance) {
      if (i != star) height += stars_[i].height * std::exp(-distance * distance / square);
    });
    return height;
  }

  [[nodiscard]] bool is_lowest(int x, int y) const {
    for (int j = -1; j <= 1; ++j) {
      for (int i = -1; i <= 1; ++i) {
        if (filtered_.at(x + i, y + j) < filtered_.at(x, y)) return false;
      }
    }
    return true;
  }

  /// Bright light that no star explains, as compact as one: kept as it is, with a flag. A lens with coma
  /// makes such stars, the edge of the field, and saturation of what is not of the frame's shape.
  void keep_odd_stars() {
    for (const SaturatedCore& core : odd_cores_) {
      if (core.radius <= 2 + 2 * psf_.fwhm_px()) keep_odd(core.x, core.y, core.radius);
    }
    std::vector<int> at;
    std::vector<Peak> peaks;
    for (int y = 1; y + 1 < residual_.height(); ++y) {
      find_above(residual_.row(y), odd_height, residual_.width(), at);
      for (const int x : at) {
        if (x < 1 || x + 1 >= residual_.width() || (clean_.flaws.at(x, y) & ~flaw_saturated) != 0) continue;
        const float v = residual_.at(x, y);
        if (v < odd_share * clean_.signal.at(x, y) || !is_highest(x, y)) continue;
        peaks.push_back({x, y, v});
        if (peaks.size() >= odd_peaks_most) break;
      }
    }
    std::sort(peaks.begin(), peaks.end(), [](const Peak& a, const Peak& b) { return a.value > b.value; });
    for (const Peak& peak : peaks) {
      if (!is_on_ray(peak)) keep_odd(peak.x, peak.y, 0);
    }
  }

  [[nodiscard]] bool is_highest(int x, int y) const {
    for (int j = -1; j <= 1; ++j) {
      for (int i = -1; i <= 1; ++i) {
        if (residual_.at(x + i, y + j) > residual_.at(x, y)) return false;
      }
    }
    return true;
  }

  /// @param core  radius of its saturated patch
  void keep_odd(double x, double y, int core) {
    const double near = core + 1.2 * psf_.fwhm_px() + 1;
    for (const Fitted& s : stars_) {
      if (std::hypot(s.x - x, s.y - y) < near) return;
    }
    const int reach = core + static_cast<int>(std::ceil(1.5 * psf_.fwhm_px())) + 1;
    const Area a = area(x, y, reach);
    if (a.x1 - a.x0 < 2 * reach || a.y1 - a.y0 < 2 * reach) return;
    double peak = 0, light = 0, mx = 0, my = 0, xx = 0, xy = 0, yy = 0, ring = 0;
    int half = 0, outside = 0;
    for (int j = a.y0; j <= a.y1; ++j)
      for (int i = a.x0; i <= a.x1; ++i)
        if (std::hypot(i - x, j - y) <= core + 1) peak = std::max(peak, double(residual_.at(i, j)));
    for (int j = a.y0; j <= a.y1; ++j) {
      for (int i = a.x0; i <= a.x1; ++i) {
        const double r = std::hypot(i - x, j - y);
        const double v = double(residual_.at(i, j));
        if (r > reach + 0.5) continue;
        if (r > reach - 1) ring += v, ++outside;
        half += v > 0.5 * peak;
        const double w = std::max(0.0, v);
        light += w, mx += w * i, my += w * j;
      }
    }
    if (!(light > 0) || ring / std::max(1, outside) > odd_ring * peak) return;
    mx /= light, my /= light;
    for (int j = a.y0; j <= a.y1; ++j) {
      for (int i = a.x0; i <= a.x1; ++i) {
        const double v = std::max(0.0, double(residual_.at(i, j)));
        if (std::hypot(i - x, j - y) > reach + 0.5) continue;
        xx += v * (i - mx) * (i - mx), xy += v * (i - mx) * (j - my), yy += v * (j - my) * (j - my);
      }
    }
    const double middle = (xx + yy) / 2 / light;
    const double half_difference = std::hypot((xx - yy) / 2, xy) / light;
    const double area_of_star = std::numbers::pi / 4 * psf_.fwhm_px() * psf_.fwhm_px();
    // Sharper than a star: a particle; drawn out: its track, or a streak.
    if (half < std::max(3.0, 0.9 * area_of_star)) return;
    if (middle - half_difference < odd_narrow * (middle + half_difference)) return;
    Fitted star;
    star.x = mx, star.y = my;
    star.height = light / psf_.flux();
    star.energy = energy_;
    star.noise = noise_at(mx, my);
    star.scale = std::sqrt(std::max(0.1, middle)) / double(psf_.sigma_px());
    star.radius = psf_.fit_radius() + core;
    star.odd = true;
    star.significance = significance_of(star);
    if (star.significance > double(odd_height)) stars_.push_back(star);
  }

  /// So many at least are not by chance.
  [[nodiscard]] static double certain(std::ptrdiff_t count) {
    const auto n = static_cast<double>(count);
    return std::max(0.0, n - 2 * std::sqrt(n) - dark_by_chance);
  }

  /// Keeps what is significant: the lower the limit, the more peaks of the noise come with it.
  void select() {
    for (Fitted& star : stars_) star.significance = significance_of(star);
    if (options_.close_ones) {
      drop_likely_pixels();
      drop_rings();
      drop_common_companions();
    }
    double least = options_.snr_least;
    if (least <= 0) {
      // Maxima of white noise through a Gaussian filter: second spectral moment 1 / (2 sigma^2).
      const double area =
          static_cast<double>(residual_.size()) / (2 * double(psf_.sigma_px()) * double(psf_.sigma_px()));
      for (least = 4.1; least < (dark_peaks_.empty() ? 5 : dark_limit_most);
           least += least < 5 ? 0.05 : 0.25) {
        const double by_noise = area * 0.0635 * least * std::exp(-least * least / 2);
        const double dark = certain(
            std::count_if(dark_peaks_.begin(), dark_peaks_.end(), [&](double v) { return v >= least; }));
        const double false_ones = least < 5 ? std::max(by_noise, dark) : dark;
        const auto found = std::count_if(stars_.begin(), stars_.end(),
                                         [&](const Fitted& s) { return s.significance >= least; });
        if (false_ones <= 0.018 * static_cast<double>(found)) break;
      }
    }
    for (const Fitted& star : stars_) {
      if (star.significance < least) add_light(star, 1);
    }
    std::erase_if(stars_, [&](const Fitted& s) { return s.significance < least; });
  }

  [[nodiscard]] StarField result() {
    std::sort(stars_.begin(), stars_.end(), [this](const Fitted& a, const Fitted& b) {
      const double one = a.height * unit_at(a);
      const double other = b.height * unit_at(b);
      return one != other ? one > other : (a.y != b.y ? a.y < b.y : a.x < b.x);
    });
    blank_saturated_cores();
    StarField field;
    field.shot = shot_;
    field.shape_error = shape_error_;
    field.masked = Grid<std::uint8_t>(residual_.width(), residual_.height());
    const std::size_t kept =
        std::min(stars_.size(), static_cast<std::size_t>(std::max(0, options_.stars_max)));
    find_crowds(stars_.size());
    for (const Fitted& s : stars_) {
      if (field.stars.size() >= kept) break;
      const double noise = s.noise / std::sqrt(std::max(s.energy, 0.3 * energy_));
      const bool odd = s.odd || s.scale - 3 * s.scale_error > odd_scale;
      const int flags =
          (is_saturated(s) ? star_saturated : 0) | (s.touched ? star_blended : 0) | (odd ? star_odd : 0);
      field.stars.push_back({s.x, s.y, s.height * psf_.flux() * unit_at(s), s.height / noise,
                             psf_.fwhm_px() * s.scale, static_cast<std::uint8_t>(flags)});
      field.doubtful.push_back(s.touched || s.scale - s.scale_error > 1.06);
    }
    for (const Fitted& s : sharp_) mask(s, field.masked);
    field.residual = std::move(residual_);
    field.spare = std::move(filtered_);
    return field;
  }

  [[nodiscard]] double unit_at(const Fitted& star) const {
    return double(clean_.noise_adu.at(star.x, star.y));
  }

  void mask(const Fitted& star, Grid<std::uint8_t>& masked) const {
    for_star_core(psf_, star.height, star.x, star.y, masked.width(), masked.height(),
                  [&](int from, int end, int y) {
                    std::fill(masked.row(y) + from, masked.row(y) + end, std::uint8_t{1});
                  });
  }

  const CleanFrame& clean_;
  const Psf& psf_;
  Profile profile_;
  const StarOptions& options_;
  Doubt doubt_;
  Plane residual_;
  Plane filtered_;
  Surface noise_;
  Patch patch_;
  std::vector<float> heights_;
  double energy_ = 0;
  double per_level_ = 0;  ///< what the height of a star is wrong by, beside the level that it was fitted on
  double shot_ = 0;
  double model_error_ = model_error_most;
  double shape_error_ = 0;
  float lowest_noise_ = 1;
  int pixels_ = 0;                  ///< peaks that one or two pixels explain
  std::vector<double> dark_peaks_;  ///< significance
  std::vector<float> rings_;        ///< dark peaks beside bright stars: share of the star's height
  std::vector<SaturatedCore> odd_cores_;
  std::vector<Fitted> stars_;
  std::vector<Fitted> glaring_;  ///< whose saturated cores were found as such
  PlaceIndex glaring_places_;
  std::vector<Fitted> sharp_;  ///< taken for stars at first
};

}  // namespace

void add_star(const Psf& psf, float height, double x, double y, Plane& plane) {
  const double reach =
      std::min(200.0, std::ceil(psf.radius_at(std::clamp(0.1 / std::abs(double(height)), 1e-5, 0.5)) + 0.5));
  const int y0 = std::max(0, static_cast<int>(std::ceil(y - reach)));
  const int y1 = std::min(plane.height() - 1, static_cast<int>(std::floor(y + reach)));
  for (int row = y0; row <= y1; ++row) {
    const double dy = row - y;
    const double half = std::sqrt(std::max(0.0, reach * reach - dy * dy));
    const int from = std::max(0, static_cast<int>(std::ceil(x - half)));
    const int end = std::min(plane.width() - 1, static_cast<int>(std::floor(x + half))) + 1;
    if (from < end)
      add_profile(psf.profile(), height, static_cast<float>(from - x), static_cast<float>(dy),
                  plane.row(row) + from, end - from);
  }
}

StarField find_stars(const CleanFrame& clean, const StarOptions& options) {
  return Finder(clean, options).run();
}

}  // namespace srfs::image
