// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "image/streak_finder.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <optional>

#include "image/filter.hpp"
#include "image/line_fit.hpp"
#include "image/line_search.hpp"
#include "image/place_index.hpp"
#include "image/rows.hpp"
#include "image/searched_sky.hpp"
#include "image/trail_finder.hpp"
#include "image/two_stars.hpp"

namespace srfs::image {
namespace {

constexpr double hit_least = 5.2;
constexpr float cell_clip = 5;  ///< what one cell counts at most in a line: a star makes none
constexpr int fits_max = 400;   ///< candidates that are fitted
constexpr int cell_px = 2;      ///< of the line search
/// A star that a piece of a streak was taken for is at most so much brighter than the streak.
constexpr double piece_most = 2.2;
constexpr double model_error = 0.05;

/// For the quick check of a line: what one place counts at most, and what the sum has to be, in errors.
constexpr double on_clip = 4;
constexpr double on_least = 3.5;
/// Lines whose ends are nearer than this are the same.
constexpr double same_px = 0.5;
/// Without the stars in it, a seed's light has to have so much of the SNR that a streak has at least.
constexpr double lit_share = 0.25;
/// So many places along a line tell whether it is lit throughout: half of them to this share.
constexpr int even_least = 6;
constexpr double even_share = 0.35;
/// Of a frame coded in blocks: this dark line counts, the strongest ones may be a star's surroundings; lines
/// have to be so many times more significant.
constexpr std::size_t dark_line = 5;
constexpr double dark_share = 1.2;
/// A line that lies on a streak already found in so many of its places shows the streak's light; in fewer,
/// it crosses it.
constexpr int known_least = 4;
/// What a line leaves of the light around it, on average of the pixels: their squares in noise, which is at
/// least this share of its light, each up to a limit. More: something that is no line.
constexpr double model_share_most = 0.1;
constexpr double deviation_clip = 9;
constexpr double deviation_most = 2.5;
/// Pieces of a line as long as a star is wide tell something if their height is known to this share; dark
/// ones have less than this share of the line's, and so many of them are too many.
constexpr double piece_error_most = 0.25;
constexpr double dark_piece = 0.4;
constexpr double dark_pieces_most = 0.25;
/// The least length where no star shows the width.
constexpr double unsure_length_px = 16;
/// Stars of which the common shape leaves so much have tails or wings of their own. Streaks have to be so
/// many FWHM long, and the more significant the more the shape leaves.
constexpr double odd_stars = 0.07;
constexpr double odd_length = 6;
constexpr double odd_limit = 3;
constexpr double odd_limit_most = 1.8;
/// Most of what lies beside a line has at most so much of its height, and all of it but one line.
constexpr double middle_beside = 0.3;
constexpr double second_beside = 0.4;
/// Nothing in the sky is dark: between branches or wires there is light of which as much is missing beside
/// it.
constexpr double dark_beside = 0.35;
/// A ray's star is so much brighter than the ray, whose nearer half is so much brighter than the farther one.
constexpr double ray_star = 5;
constexpr double ray_falls = 1.5;
/// For stars so much brighter a smaller fall will do if it is certain by so many errors.
constexpr double glaring_star = 20;
constexpr double ray_of_glaring_falls = 1.2;
constexpr double glaring_gap_px = 20;  ///< or the ray's length: so far from it the ray may begin
constexpr std::size_t glaring_stars_most = 200;
constexpr double ray_error = 3;
/// So near a much brighter star a line has to stand out from what that has on so many sides, by so many
/// spreads.
constexpr double halo_px = 60;
constexpr int halo_sides = 8;
constexpr double halo_errors = 3;
/// As wide as that is a particle's track at most.
constexpr double track_width_px = 1.55;
/// Of a trail's length: so long is the same line found by its shape.
constexpr double same_length = 0.88;
/// SNR of a piece as long as it is wide, about: what is brighter shows its own ends.
constexpr double clear_trail = 2;
/// A star on a trail is at least so many times as bright.
constexpr double trail_star_most = 4;
/// How much worse a line may fit than stars in its place, of the square of its SNR: the brighter it is, the
/// more the model's errors count.
constexpr double model_share = 0.005;

/// Whether the frame was coded in blocks of 8 x 8 pixels (JPEG): between them values change more than within.
bool is_made_of_blocks(const Plane& signal) {
  constexpr int side = 8;
  constexpr float change_most = 3;  // of a neighbour that counts: stars say nothing
  constexpr double step_least = 1.2;
  std::array<double, side> changes{};
  for (int y = 0; y < signal.height(); y += 4) {
    const float* row = signal.row(y);
    for (int x = 0; x + side < signal.width(); x += side) {
      for (int k = 0; k < side; ++k)
        changes[static_cast<std::size_t>(k)] +=
            double(std::min(change_most, std::abs(row[x + k + 1] - row[x + k])));
    }
  }
  std::sort(changes.begin(), changes.end());
  return changes[side - 1] > step_least * changes[side - 2];
}

/// Where a place is beside a line.
struct Along {
  explicit Along(const Line& l)
      : x(l.x1),
        y(l.y1),
        length(std::max(1e-6, l.length())),
        ux((l.x2 - l.x1) / length),
        uy((l.y2 - l.y1) / length) {}
  [[nodiscard]] double along(double px, double py) const { return (px - x) * ux + (py - y) * uy; }
  [[nodiscard]] double across(double px, double py) const { return std::abs((py - y) * ux - (px - x) * uy); }
  [[nodiscard]] double beyond(double px, double py) const {
    return std::max({0.0, -along(px, py), along(px, py) - length});
  }
  double x, y, length, ux, uy;
};

/// What lies near a line.
class Band {
 public:
  Band(const Line& l, double reach) : line_(l), reach_(reach) {}
  [[nodiscard]] bool contains(double x, double y) const {
    const double t = line_.along(x, y);
    return line_.across(x, y) < reach_ && t > -reach_ - beyond_px && t < line_.length + reach_ + beyond_px;
  }
  static constexpr double beyond_px = 3;
  [[nodiscard]] double length() const { return line_.length; }

 private:
  Along line_;
  double reach_;
};

class Finder {
 public:
  Finder(const CleanFrame& clean, StarField& field, const StreakOptions& options)
      : clean_(clean),
        field_(field),
        options_(options),
        sigma_(double(clean.psf.sigma_px())),
        fwhm_(clean.psf.fwhm_px()),
        sky_(clean),
        light_(std::move(field.residual)),
        mask_(std::move(field.masked)),
        places_(field.stars),
        filtered_(std::move(field.spare)),
        fitter_(light_, mask_, clean.psf, {static_cast<float>(field.shot), static_cast<float>(model_error)}) {
  }

  std::vector<Streak> run() {
    prepare();
    std::vector<Seed> seeds = find_seeds();
    int fits = 0;
    for (const Seed& seed : seeds) {
      if (is_known(seed.line) || sky_.is_in_unrest(seed.line) || sky_.is_beside_no_sky(seed.line)) continue;
      if (!looks_like_streak(seed.line)) continue;
      if (++fits > fits_max) break;
      examine(seed.line);
    }
    for (const Found& f : found_) hide(f.line, -1);
    merge();
    return result();
  }

  /// Memory as large as the frame. @post nothing else is called
  [[nodiscard]] Plane take_spare() { return std::move(filtered_); }
  /// @param star  its index in the field
  [[nodiscard]] bool is_part_of_streak(std::size_t star) const { return taken_[star]; }

 private:
  struct Seed {
    Line line;
    double significance;
  };

  struct Found {
    Line line;
    double snr;
  };

  /// Each pixel's mask counts what hides it. Stars that are certain stay away from the light, doubtful ones
  /// are in it.
  void prepare() {
    std::uint8_t* const masked = mask_.cells().data();
    const std::uint8_t* const flawed = clean_.flaws.cells().data();
    for (std::size_t i = 0; i < mask_.size(); ++i) masked[i] = (masked[i] | flawed[i]) != 0 ? 1 : 0;
    high_pass(light_);
    const std::size_t n = field_.stars.size();
    taken_.assign(n, false);
    shown_.assign(n, false);
    for (std::size_t i = 0; i < n; ++i) {
      if (field_.doubtful[i])
        add_light(i, 1), shown_[i] = true;
      else
        hide(i, 1);
    }
  }

  [[nodiscard]] double height_of(std::size_t star) const {
    const Star& s = field_.stars[star];
    return s.flux / clean_.psf.flux() / double(clean_.noise_adu.at(s.x, s.y));
  }

  void add_light(std::size_t star, float sign) {
    const Star& s = field_.stars[star];
    add_star(clean_.psf, sign * static_cast<float>(height_of(star)), s.x, s.y, light_);
  }

  /// Where a star's model may be wrong by half the noise. @param change  of the count
  void hide(std::size_t star, int change) {
    const Star& s = field_.stars[star];
    for_star_core(clean_.psf, height_of(star), s.x, s.y, mask_.width(), mask_.height(),
                  [&](int from, int end, int y) {
                    std::uint8_t* row = mask_.row(y);
                    for (int x = from; x < end; ++x)
                      row[x] = static_cast<std::uint8_t>(std::clamp(row[x] + change, 0, 255));
                  });
  }

  void show(std::size_t star) {
    if (shown_[star]) return;
    shown_[star] = true;
    add_light(star, 1);
    hide(star, -1);
  }

  void take_away(std::size_t star) {
    if (!shown_[star]) return;
    shown_[star] = false;
    add_light(star, -1);
    hide(star, 1);
  }

  // --- seeds ---

  [[nodiscard]] std::vector<Seed> find_seeds() {
    gaussian_filter(light_, static_cast<float>(sigma_), filtered_, &mask_);
    noise_ = measure_flattened(filtered_, nullptr).noise;
    std::vector<float> noise(static_cast<std::size_t>(filtered_.width()));
    for (int y = 0; y < filtered_.height(); ++y) {
      if (y % noise_rows == 0) noise_.row(std::min(filtered_.height() - 1, y + noise_rows / 2), noise);
      scale_down(filtered_.row(y), noise.data(), 0.5F, filtered_.width());
    }
    std::vector<Seed> seeds;
    double correlation = 0;
    const Plane cells = binned(correlation);
    if (is_made_of_blocks(clean_.signal)) raise_limit(cells, correlation);
    restless_ *= std::clamp(1 + odd_limit * (field_.shape_error - odd_stars), 1.0, odd_limit_most);
    for (const LineHit& hit : search_lines(cells, correlation, hit_least * restless_, cell_clip)) {
      const auto px = [](double cell) { return cell * cell_px + (cell_px - 1) / 2.0; };
      seeds.push_back({Line{px(hit.x1), px(hit.y1), px(hit.x2), px(hit.y2)}, hit.significance});
    }
    add_wide_stars(seeds);
    std::stable_sort(seeds.begin(), seeds.end(),
                     [](const Seed& a, const Seed& b) { return a.significance > b.significance; });
    return seeds;
  }

  /// Nothing in the sky is dark: what lines of less light than around them are there, the coding has made,
  /// and as many of more light.
  void raise_limit(const Plane& cells, double correlation) {
    Plane dark = Plane::unset(cells.width(), cells.height());
    for (std::size_t i = 0; i < dark.size(); ++i) dark.cells()[i] = -cells.cells()[i];
    const std::vector<LineHit> lines = search_lines(dark, correlation, hit_least, cell_clip);
    if (lines.size() > dark_line)
      restless_ = std::max(1.0, dark_share * lines[dark_line].significance / hit_least);
  }

  /// Means of squares of pixels, noise 1 again. @param correlation  of neighbouring cells: sigma of the
  /// filter that made it
  [[nodiscard]] Plane binned(double& correlation) const {
    Plane cells(std::max(1, filtered_.width() / cell_px), std::max(1, filtered_.height() / cell_px));
    // Through the filter, neighbours one and two diagonal apart correlate so.
    const double near = std::exp(-0.25 / (sigma_ * sigma_));
    const auto unit = static_cast<float>(0.25 / std::sqrt((4 + 8 * near + 4 * near * near) / 16));
    for (int y = 0; y < cells.height(); ++y) {
      const float* upper = filtered_.row(std::min(filtered_.height() - 1, cell_px * y));
      const float* lower = filtered_.row(std::min(filtered_.height() - 1, cell_px * y + 1));
      if (filtered_.width() < cell_px) continue;
      float* to = cells.row(y);
      for (int x = 0; x < cells.width(); ++x)
        to[x] = unit *
                (upper[cell_px * x] + upper[cell_px * x + 1] + lower[cell_px * x] + lower[cell_px * x + 1]);
    }
    correlation = std::sqrt(sigma_ * sigma_ + 1.0 / 6) / cell_px;
    return cells;
  }

  /// A short streak is a star that is drawn out.
  void add_wide_stars(std::vector<Seed>& seeds) const {
    for (std::size_t i = 0; i < field_.stars.size(); ++i) {
      const Star& s = field_.stars[i];
      if (!shown_[i] || s.fwhm_px < 1.1 * fwhm_ || s.snr < options_.snr_least) continue;
      const int r = static_cast<int>(std::ceil(2 * fwhm_));
      double light = 0, xx = 0, xy = 0, yy = 0;
      for (int y = std::max(0, static_cast<int>(s.y) - r);
           y <= std::min(light_.height() - 1, static_cast<int>(s.y) + r); ++y) {
        for (int x = std::max(0, static_cast<int>(s.x) - r);
             x <= std::min(light_.width() - 1, static_cast<int>(s.x) + r); ++x) {
          const double dx = x - s.x;
          const double dy = y - s.y;
          const double v = std::exp(-(dx * dx + dy * dy) / (2 * fwhm_ * fwhm_)) * double(light_.at(x, y));
          light += v, xx += v * dx * dx, xy += v * dx * dy, yy += v * dy * dy;
        }
      }
      if (!(light > 0)) continue;
      const double angle = std::atan2(2 * xy, xx - yy) / 2;
      const double half = std::max(3.0, fwhm_);
      const double hx = half * std::cos(angle);
      const double hy = half * std::sin(angle);
      seeds.push_back({Line{s.x - hx, s.y - hy, s.x + hx, s.y + hy}, std::min(s.snr, 30.0) / 2});
    }
  }

  [[nodiscard]] double sample(double x, double y) const {
    const int i = static_cast<int>(x + 0.5);
    const int j = static_cast<int>(y + 0.5);
    return filtered_.contains(i, j) ? double(filtered_.at(i, j)) : 0;
  }

  /// More light than beside it, by more than chance and the stars make, quickly judged.
  [[nodiscard]] bool looks_like_streak(const Line& l) const {
    const double length = std::max(1e-6, l.length());
    const double ux = (l.x2 - l.x1) / length;
    const double uy = (l.y2 - l.y1) / length;
    const double d = 1.7 * fwhm_ + 1.5;
    // Through the filter, values this far apart know little of each other.
    const int n = std::clamp(static_cast<int>(length / (2 * sigma_ + 1)), 2, 60);
    // The line may lie a little off, at each of its ends.
    constexpr std::array<double, 3> off{-1, 0, 1};
    std::array<double, 9> on{};
    double beside = 0;
    double squares = 0;
    for (int i = 0; i <= n; ++i) {
      const double t = static_cast<double>(i) / n;
      const double x = l.x1 + (l.x2 - l.x1) * t;
      const double y = l.y1 + (l.y2 - l.y1) * t;
      std::array<double, 3> here;
      for (std::size_t k = 0; k < 3; ++k)
        here[k] = std::min(sample(x - off[k] * uy, y + off[k] * ux), on_clip);
      for (std::size_t k = 0; k < 9; ++k) {
        const double place = (1 - t) * static_cast<double>(k / 3) + t * static_cast<double>(k % 3);
        on[k] += here[static_cast<std::size_t>(place + 0.5)];
      }
      for (const double side : {-1.0, 1.0}) {
        const double v = std::clamp(sample(x - side * d * uy, y + side * d * ux), -on_clip, on_clip);
        beside += v;
        squares += v * v;
      }
    }
    const double count = n + 1;
    const double spread = std::sqrt(std::max(1.0, squares / (2 * count) - std::pow(beside / (2 * count), 2)));
    const auto best = std::max_element(on.begin(), on.end());
    const double light = *best / count - beside / (2 * count);
    if (light <= on_least * spread / std::sqrt(count)) return false;
    const auto offsets = static_cast<std::size_t>(best - on.begin());
    return n < even_least || is_lit_throughout(l, off[offsets / 3], off[offsets % 3], n, light);
  }

  /// Half of the line has to have a good part of its light: stars in a row light little of it.
  /// @param off1, off2  of the ends, across
  [[nodiscard]] bool is_lit_throughout(const Line& l, double off1, double off2, int n, double light) const {
    const double length = std::max(1e-6, l.length());
    const double ux = (l.x2 - l.x1) / length;
    const double uy = (l.y2 - l.y1) / length;
    std::vector<float> seen;
    for (int i = 0; i <= n; ++i) {
      const double t = static_cast<double>(i) / n;
      const double off = off1 + t * (off2 - off1);
      const int x = static_cast<int>(l.x1 + (l.x2 - l.x1) * t - off * uy + 0.5);
      const int y = static_cast<int>(l.y1 + (l.y2 - l.y1) * t + off * ux + 0.5);
      if (filtered_.contains(x, y) && mask_.at(x, y) == 0) seen.push_back(filtered_.at(x, y));
    }
    if (static_cast<int>(seen.size()) < even_least) return true;
    const double error = 1.25 / std::sqrt(static_cast<double>(seen.size()));
    return double(median_of(seen)) > even_share * light - 2 * error;
  }

  /// Within the light of a streak already found, or about the same as one refused.
  [[nodiscard]] bool is_known(const Line& seed) const {
    for (const Found& f : found_) {
      const Band band(f.line, 3 * sigma_ + 3);
      if (places_along(seed, [&](double x, double y) { return band.contains(x, y); }) >= known_least)
        return true;
    }
    const double length = seed.length();
    return std::any_of(refused_.begin(), refused_.end(), [&](const Band& band) {
      return band.length() < 2.2 * length && band.contains(seed.x1, seed.y1) &&
             band.contains(seed.x2, seed.y2);
    });
  }

  [[nodiscard]] static bool is_on(const Line& l, double x, double y, double reach) {
    return Band(l, reach).contains(x, y);
  }

  // --- one candidate ---

  /// With the light of the doubtful stars, then without.
  void examine(const Line& seed) {
    Line line = seed;
    std::optional<double> snr = fit_among_stars(line);
    if (!snr) {
      line = seed;
      snr = fit_without_stars(line);
    }
    if (snr) {
      found_.push_back({line, *snr});
      hide(line, 1);
      refused_fits_.clear();  // what crosses this one may be a streak without it
    } else {
      refused_.emplace_back(seed, sigma_ + 2);
    }
  }

  /// A streak that crosses this one is judged by what is seen on both sides of it. @param change  of the
  /// count
  void hide(const Line& line, int change) {
    const double reach = fitter_.reach_px(line);
    for_pixels_along(line, light_.width(), light_.height(), reach, reach, [&](int x, int y, double, double) {
      mask_.at(x, y) = static_cast<std::uint8_t>(std::clamp(mask_.at(x, y) + change, 0, 255));
    });
  }

  [[nodiscard]] double snr_least() const { return options_.snr_least * restless_; }

  [[nodiscard]] double shortest_px() const {
    const double visible = std::max(0.75 * options_.length_least_px, 1.3 * fwhm_);
    if (options_.caution <= 0) return visible;  // other frames tell
    // Where no star says how sharp the optics are, a short one may be a star; where stars have tails, too.
    if (!clean_.psf_measured || clean_.psf_unsure) return std::max(visible, unsure_length_px);
    return field_.shape_error > odd_stars ? std::max(visible, odd_length * fwhm_) : visible;
  }

  [[nodiscard]] double noise_at(const Line& l) const {
    return std::max(0.5, double(noise_.at((l.x1 + l.x2) / 2, (l.y1 + l.y2) / 2)));
  }

  /// Settles a line and judges it. @return its SNR
  [[nodiscard]] std::optional<double> settled(Line& line) {
    const auto significance = fitter_.settle(line, snr_least() * noise_at(line), shortest_px());
    if (!significance) return std::nullopt;
    return *significance / noise_at(line);
  }

  [[nodiscard]] std::optional<double> fit_among_stars(Line& line) {
    auto snr = settled(line);
    if (!snr || was_refused(line)) return std::nullopt;
    const Line first = line;
    // Stars that a line of this height cannot be go, certain ones that may be pieces of it come.
    const auto too_bright = [&](std::size_t i) {
      return shown_[i] && height_of(i) > piece_most * line.height;
    };
    const auto may_be_piece = [&](std::size_t i) {
      return !shown_[i] && height_of(i) < piece_most * line.height &&
             is_on(line, field_.stars[i].x, field_.stars[i].y, 0.75 * fwhm_);
    };
    const std::vector<std::size_t> gone = stars_near(line, too_bright);
    const std::vector<std::size_t> come = stars_near(line, may_be_piece);
    for (const std::size_t i : gone) take_away(i);
    for (const std::size_t i : come) show(i);
    if (!gone.empty() || !come.empty()) snr = settled(line);
    if (snr && is_streak(line, *snr)) {
      const std::vector<std::size_t> pieces = stars_near(line, [&](std::size_t i) {
        return shown_[i] && !taken_[i] && is_on(line, field_.stars[i].x, field_.stars[i].y, 0.75 * fwhm_);
      });
      if (explains_better(line, *snr, pieces) && !are_two_stars(line)) {
        for (const std::size_t i : pieces) taken_[i] = true;
        return snr;
      }
    }
    for (const std::size_t i : gone) show(i);
    for (const std::size_t i : come) take_away(i);
    refused_fits_.push_back(first);
    return std::nullopt;
  }

  /// Many seeds lead to the same line.
  [[nodiscard]] bool was_refused(const Line& line) const {
    return std::any_of(refused_fits_.begin(), refused_fits_.end(), [&](const Line& l) {
      return std::max({std::abs(l.x1 - line.x1), std::abs(l.y1 - line.y1), std::abs(l.x2 - line.x2),
                       std::abs(l.y2 - line.y2)}) < same_px;
    });
  }

  [[nodiscard]] std::optional<double> fit_without_stars(Line& line) {
    Line around = line;
    const std::vector<std::size_t> stars =
        stars_near(around, [&](std::size_t i) { return shown_[i] && !taken_[i]; });
    if (stars.empty()) return std::nullopt;  // nothing new
    for (const std::size_t i : stars) take_away(i);
    const bool is_lit = fitter_.nearby_significance(line) > lit_share * snr_least() * noise_at(line);
    const auto snr = is_lit ? settled(line) : std::nullopt;
    if (snr && is_streak(line, *snr) && !are_two_stars(line)) return snr;
    for (const std::size_t i : stars) show(i);
    return std::nullopt;
  }

  /// Stars whose light reaches a line or what may be the rest of it.
  template <class Which>
  [[nodiscard]] std::vector<std::size_t> stars_near(const Line& l, Which&& which) const {
    std::vector<std::size_t> near;
    const double reach = 2.5 * fwhm_ + 2;
    const Band band(l, reach);
    const double margin = 2 * reach + Band::beyond_px;  // the band's corners, whichever way it lies
    places_.around(std::min(l.x1, l.x2) - margin, std::min(l.y1, l.y2) - margin,
                   std::max(l.x1, l.x2) + margin, std::max(l.y1, l.y2) + margin, [&](std::size_t i) {
                     if (band.contains(field_.stars[i].x, field_.stars[i].y) && which(i)) near.push_back(i);
                   });
    std::sort(near.begin(), near.end());
    return near;
  }

  /// Whether the line explains the light better than the stars that it would replace.
  [[nodiscard]] bool explains_better(const Line& line, double snr, const std::vector<std::size_t>& pieces) {
    if (pieces.empty()) return true;
    const double reach = fitter_.reach_px(line) + 0.5 * fwhm_;
    const LineShape shape = fitter_.shape_of(line);
    const double unit = noise_at(line) * noise_at(line);
    const double as_line =
        line_mismatch(shape, 1, fitter_.collect(line, reach, reach), fitter_.noise()) / unit;
    for (const std::size_t i : pieces) add_light(i, -1);
    const double as_stars =
        line_mismatch(shape, 0, fitter_.collect(line, reach, reach), fitter_.noise()) / unit;
    for (const std::size_t i : pieces) add_light(i, 1);
    return as_line < as_stars + advantage(pieces.size(), snr) + StreakOptions{}.caution - options_.caution;
  }

  /// How much worse a line may fit than so many stars: it has fewer parameters. But in a crowded field stars
  /// that touch are the likelier explanation, the less so the more of them stand in a row.
  [[nodiscard]] double advantage(std::size_t stars, double snr) const {
    const double n = static_cast<double>(stars);
    const double parameters = 3 * n - 5;
    const double density = static_cast<double>(field_.stars.size()) / static_cast<double>(light_.size());
    // Where the next one of a row has to be: as near as a touching one, and beside the row by little.
    const double next = std::min(1.0, density * 2 * fwhm_ * fwhm_);
    const double rows = touching_pairs() * std::pow(next, std::max(0.0, n - 2));
    return std::min(4 * parameters, std::max(8.0, 2 * parameters)) + model_share * snr * snr -
           2 * std::log(1 + rows);
  }

  /// Whether two stars explain a short line's light about as well: then they are likelier.
  [[nodiscard]] bool are_two_stars(const Line& line) const {
    const double length = line.length();
    if (length > 5 * fwhm_ + 10) return false;
    const double x = (line.x1 + line.x2) / 2;
    const double y = (line.y1 + line.y2) / 2;
    Patch patch;
    take_patch(light_, mask_, x, y, static_cast<int>(std::ceil(length / 2 + 1.3 * fwhm_)), patch);
    const Band band(line, 1.3 * fwhm_);
    LinePixels pixels;
    std::vector<std::size_t> at;
    for (std::size_t i = 0; i < patch.size(); ++i) {
      const float px = static_cast<float>(patch.x) + patch.dx[i];
      const float py = static_cast<float>(patch.y) + patch.dy[i];
      if (!band.contains(double(px), double(py))) patch.use[i] = 0;
      if (patch.use[i] == 0) continue;
      at.push_back(i);
      pixels.x.push_back(px);
      pixels.y.push_back(py);
      pixels.light.push_back(patch.light[i]);
    }
    TwoStars stars(clean_.psf.profile(), patch, field_.shot);
    // As far apart as spreads their light like a line's.
    const double dx = (line.x2 - line.x1) / std::sqrt(12);
    const double dy = (line.y2 - line.y1) / std::sqrt(12);
    const double height = line.height * std::max(1.0, 0.5 * length / fwhm_);
    const auto found = stars.fit({{x - dx, x + dx}, {y - dy, y + dy}, {height, height}}, fwhm_);
    if (!found) return false;
    std::vector<float> heights;
    line_heights(fitter_.shape_of(line), pixels, heights);
    double as_line = 0;
    double as_stars = 0;
    for (std::size_t k = 0; k < at.size(); ++k) {
      const double model = line.height * double(heights[k]);
      const double of_stars = double(stars.light(found->stars, at[k]));
      const double light = double(pixels.light[k]);
      const double most = std::max(model, of_stars);
      const double variance = 1 + field_.shot * most + model_error * model_error * most * most;
      as_line += (light - model) * (light - model) / variance;
      as_stars += (light - of_stars) * (light - of_stars) / variance;
    }
    const double unit = noise_at(line) * noise_at(line);
    return as_stars < as_line + unit * options_.caution * (1 + 0.5 * std::log(1 + touching_pairs()));
  }

  /// Of stars, by chance.
  [[nodiscard]] double touching_pairs() const {
    const double n = static_cast<double>(field_.stars.size());
    const double reach = 1.5 * fwhm_;
    return n * n * 1.57 * reach * reach / static_cast<double>(light_.size());
  }

  /// A part of a line: its light, weighted by the line's model, and the energy of the weights.
  struct Part {
    double product = 0;
    double energy = 0;
  };

  /// Dark in between, where the noise lets it be seen: stars in a row.
  [[nodiscard]] static bool is_interrupted(const std::vector<Part>& pieces, double height) {
    int looked = 0;
    int dark = 0;
    for (const Part& piece : pieces) {
      const double error = 1 / std::sqrt(std::max(1e-9, piece.energy));
      if (error > piece_error_most * height) continue;
      ++looked;
      dark += piece.product / piece.energy < dark_piece * height - 1.5 * error;
    }
    return looked >= 3 && dark >= dark_pieces_most * looked;
  }

  /// Lit on its whole length, by nothing sharper than the optics, and mostly seen.
  [[nodiscard]] bool is_even(const Line& l, double snr) {
    constexpr int parts = 4;
    std::array<double, parts> product{};
    std::array<double, parts> energy{};
    std::vector<Part> pieces(static_cast<std::size_t>(std::max(1.0, l.length() / fwhm_)));
    double seen = 0;
    double all = 0;
    double spikes = 0;
    const double reach = fitter_.reach_px(l);
    const LinePixels& pixels = fitter_.collect(l, reach, reach);
    std::vector<float> heights;
    line_heights(fitter_.shape_of(l), pixels, heights);
    const double length = std::max(1e-3, l.length());
    const double ux = (l.x2 - l.x1) / length;
    const double uy = (l.y2 - l.y1) / length;
    double deviation = 0;
    for (std::size_t i = 0; i < pixels.size(); ++i) {
      const double m = double(heights[i]);
      seen += m;
      const double model = l.height * m;
      const double r = double(pixels.light[i]) - model;
      const double variance = 1 + field_.shot * model + model_share_most * model_share_most * model * model;
      deviation += std::min(r * r / variance, deviation_clip);
      const double t = ((double(pixels.x[i]) - l.x1) * ux + (double(pixels.y[i]) - l.y1) * uy) / length;
      const auto part = static_cast<std::size_t>(std::clamp(static_cast<int>(t * parts), 0, parts - 1));
      product[part] += m * double(pixels.light[i]);
      energy[part] += m * m;
      const auto piece =
          static_cast<std::size_t>(std::clamp(t, 0.0, 0.999) * static_cast<double>(pieces.size()));
      pieces[piece].product += m * double(pixels.light[i]);
      pieces[piece].energy += m * m;
    }
    if (deviation > deviation_most * static_cast<double>(pixels.size())) return false;
    if (is_interrupted(pieces, l.height)) return false;
    const double narrow = 0.5 / (sigma_ * sigma_ * l.scale * l.scale);
    for_pixels_along(l, light_.width(), light_.height(), reach, 0, [&](int x, int y, double, double across) {
      const double m = std::exp(-across * across * narrow);
      all += m;
      if ((clean_.flaws.at(x, y) & flaw_spike) != 0) spikes += m;
    });
    if (seen < (length < 25 ? 0.7 : 0.45) * all || spikes > 0.15 * all) return false;
    int lit = 0;
    int looked = 0;
    std::size_t brightest = 0;
    for (std::size_t k = 0; k < parts; ++k) {
      if (product[k] > product[brightest]) brightest = k;
      if (energy[k] < 0.05) continue;
      ++looked;
      const double height = product[k] / energy[k];
      const double error = 1 / std::sqrt(energy[k]);
      lit += height > 0.4 * l.height - 1.5 * error && height < 2.5 * l.height + 3 * error;
    }
    // The part that shines most may be a star; the rest has to be a streak without it.
    double rest_product = 0;
    double rest_energy = 0;
    for (std::size_t k = 0; k < parts; ++k) {
      if (k != brightest) rest_product += product[k], rest_energy += energy[k];
    }
    const double rest = rest_energy > 0 ? rest_product / std::sqrt(rest_energy) / noise_at(l) : 0;
    return looked >= 2 && lit >= looked - 1 && rest > std::max(0.45 * snr, 0.65 * snr_least());
  }

  [[nodiscard]] bool is_streak(const Line& l, double snr) {
    // Between stars that touch there is room for something short and faint.
    if (snr < snr_least() * (l.length() < 25 ? 1.2 : 1) || l.length() < shortest_px()) return false;
    const double error = 2 / snr;
    // The sharper the optics, the more a particle's track looks like a streak. What passes in a moment may be
    // sharper than stars, which the air and the mount have moved during the exposure.
    const double narrowest = std::clamp(track_width_px / fwhm_, 0.75, 0.92);
    if (l.scale > 1.2 + error || l.scale < narrowest - error) return false;
    return !sky_.is_along_edge(l, fwhm_) && !sky_.is_beside_no_sky(l) && is_even(l, snr) &&
           stands_out(l, snr) && !is_ray_of_star(l) && !is_of_halo(l);
  }

  /// It stands out little from what a much brighter star beside it has at the same place on its other sides:
  /// a star's model may be wrong by that.
  [[nodiscard]] bool is_of_halo(const Line& l) const {
    const Along line(l);
    for (std::size_t i = 0; i < std::min(field_.stars.size(), glaring_stars_most); ++i) {
      const Star& s = field_.stars[i];
      if (height_of(i) < glaring_star * l.height) break;  // brightest first
      if (std::hypot(line.across(s.x, s.y), line.beyond(s.x, s.y)) > halo_px) continue;
      std::vector<float> others;
      for (int k = 1; k < halo_sides; ++k) {
        const auto height = height_along(turned(l, s, k * 2 * std::numbers::pi / halo_sides));
        if (height) others.push_back(static_cast<float>(*height));
      }
      if (2 * others.size() < halo_sides) continue;
      const Middle middle = middle_of(std::move(others));
      if (l.height < std::max(0.0, middle.value) + halo_errors * middle.spread) return true;
    }
    return false;
  }

  [[nodiscard]] static Line turned(const Line& l, const Star& around, double angle) {
    const double c = std::cos(angle);
    const double s = std::sin(angle);
    const auto x = [&](double dx, double dy) { return around.x + c * dx - s * dy; };
    const auto y = [&](double dx, double dy) { return around.y + s * dx + c * dy; };
    Line line = l;
    line.x1 = x(l.x1 - around.x, l.y1 - around.y), line.y1 = y(l.x1 - around.x, l.y1 - around.y);
    line.x2 = x(l.x2 - around.x, l.y2 - around.y), line.y2 = y(l.x2 - around.x, l.y2 - around.y);
    return line;
  }

  /// Of the light along a line, by its model; nothing where most of it is hidden or outside.
  [[nodiscard]] std::optional<double> height_along(const Line& l) const {
    const double narrow = 0.5 / (sigma_ * sigma_ * l.scale * l.scale);
    double product = 0, seen = 0, all = 0;
    for_pixels_along(l, light_.width(), light_.height(), 2 * sigma_ * l.scale, 0,
                     [&](int x, int y, double, double across) {
                       const double m = std::exp(-across * across * narrow);
                       all += m * m;
                       if (mask_.at(x, y) == 0) product += m * double(light_.at(x, y)), seen += m * m;
                     });
    const double whole = l.length() * sigma_ * l.scale * std::sqrt(std::numbers::pi);
    if (seen < 0.5 * std::max(all, whole)) return std::nullopt;
    return product / seen;
  }

  /// Beside what lines next to it show: a ridge of something wide, and in crowds of faint stars every line,
  /// has light there too.
  [[nodiscard]] bool stands_out(const Line& l, double snr) {
    std::vector<double> beside = fitter_.heights_beside(l);
    if (beside.size() < 3) return true;
    std::sort(beside.begin(), beside.end());
    const double middle = beside[beside.size() / 2];
    const double second = beside[beside.size() - 2];  // the highest may be a star
    if (middle > middle_beside * l.height || second > second_beside * l.height) return false;
    if (beside.front() < -dark_beside * l.height - 3 * l.height / snr) return false;
    if (l.length() < 25) return true;
    // The high-pass may have darkened all of them.
    const double level = std::min(0.0, middle);
    double squares = 0;
    for (std::size_t i = 0; i + 1 < beside.size(); ++i) squares += (beside[i] - level) * (beside[i] - level);
    const double spread = std::sqrt(squares / static_cast<double>(beside.size() - 1));
    const double error = l.height / snr;
    return l.height - std::max(0.0, middle) > std::max(5 * error, 3 * spread);
  }

  [[nodiscard]] bool is_saturated_at(double x, double y) const {
    const int i = static_cast<int>(std::lround(x));
    const int j = static_cast<int>(std::lround(y));
    return clean_.flaws.contains(i, j) && (clean_.flaws.at(i, j) & flaw_saturated) != 0;
  }

  /// What a telescope's struts, a lens or an overexposed column make of a much brighter star: light that
  /// falls off along the line, away from it, or goes through the very middle of a saturated one.
  [[nodiscard]] bool is_ray_of_star(const Line& l) {
    const Band band(l, 0.7 * fwhm_ + 1.5);
    const std::vector<std::size_t> on_it = stars_near(l, [&](std::size_t k) {
      return band.contains(field_.stars[k].x, field_.stars[k].y) && height_of(k) > ray_star * l.height;
    });
    std::vector<std::size_t> sources;
    if (!on_it.empty()) {
      sources.push_back(*std::max_element(on_it.begin(), on_it.end(), [&](std::size_t a, std::size_t b) {
        return height_of(a) < height_of(b);
      }));
    }
    // A saturated one hides where its rays begin.
    const Along line(l);
    for (std::size_t i = 0; i < std::min(field_.stars.size(), glaring_stars_most); ++i) {
      const Star& s = field_.stars[i];
      if (height_of(i) < glaring_star * l.height || !is_saturated_at(s.x, s.y)) continue;
      const double gap = line.beyond(s.x, s.y);
      if (gap < std::max(line.length, glaring_gap_px) && line.across(s.x, s.y) < fwhm_ + 0.05 * gap)
        sources.push_back(i);
    }
    if (sources.empty()) return false;
    const LinePixels& pixels = fitter_.collect(l, fitter_.reach_px(l), 0);
    std::vector<float> heights;
    line_heights(fitter_.shape_of(l), pixels, heights);
    return std::any_of(sources.begin(), sources.end(),
                       [&](std::size_t star) { return comes_from(star, l, line, pixels, heights); });
  }

  [[nodiscard]] bool comes_from(std::size_t i, const Line& l, const Along& line, const LinePixels& pixels,
                                const std::vector<float>& heights) const {
    const Star& star = field_.stars[i];
    const double height = height_of(i);
    const double source = line.along(star.x, star.y);
    if (height > glaring_star * l.height) {
      const bool is_inside = source > 0 && source < line.length && is_saturated_at(star.x, star.y);
      if (is_inside && line.across(star.x, star.y) < std::max(1.0, 0.35 * fwhm_)) return true;
    }
    const auto distance = [&](std::size_t k) {
      return std::abs(line.along(double(pixels.x[k]), double(pixels.y[k])) - source);
    };
    double of_middle = 0, energy = 0;  // of what is seen: the star hides some
    for (std::size_t k = 0; k < pixels.size(); ++k) {
      of_middle += double(heights[k]) * double(heights[k]) * distance(k);
      energy += double(heights[k]) * double(heights[k]);
    }
    Part near, far;
    for (std::size_t k = 0; k < pixels.size(); ++k) {
      Part& part = distance(k) * energy < of_middle ? near : far;
      part.product += double(heights[k]) * double(pixels.light[k]);
      part.energy += double(heights[k]) * double(heights[k]);
    }
    if (near.energy <= 0 || far.energy <= 0) return false;
    const double by_star = near.product / near.energy;
    const double away = std::max(0.0, far.product / far.energy);
    const double error = noise_at(l) * std::sqrt(1 / near.energy + 1 / far.energy);
    return by_star > ray_falls * away ||
           (height > glaring_star * l.height && by_star - ray_of_glaring_falls * away > ray_error * error);
  }

  // --- all of them ---

  /// Two pieces that go on in each other's direction.
  [[nodiscard]] static std::optional<Line> joined(const Line& a, const Line& b, double sigma) {
    const Line& l = a.length() >= b.length() ? a : b;
    const Line& s = a.length() >= b.length() ? b : a;
    const Along line(l);
    double t1 = line.along(s.x1, s.y1);
    double t2 = line.along(s.x2, s.y2);
    if (t1 > t2) std::swap(t1, t2);
    const double gap = std::max({0.0, t1 - line.length, -t2});
    const double slack = 1.5 * sigma + 1 + 0.03 * gap;
    if (line.across(s.x1, s.y1) > slack || line.across(s.x2, s.y2) > slack) return std::nullopt;
    if (gap > std::max(12.0, 0.6 * (line.length + s.length()))) return std::nullopt;
    const double from = std::min(0.0, t1);
    const double to = std::max(line.length, t2);
    Line whole = l;
    whole.x1 = l.x1 + from * line.ux, whole.y1 = l.y1 + from * line.uy;
    whole.x2 = l.x1 + to * line.ux, whole.y2 = l.y1 + to * line.uy;
    return whole;
  }

  void merge() {
    for (bool again = true; again;) {
      again = false;
      for (std::size_t i = 0; i < found_.size() && !again; ++i) {
        for (std::size_t j = i + 1; j < found_.size() && !again; ++j) again = merge(i, j);
      }
    }
  }

  /// @return whether j is no more
  bool merge(std::size_t i, std::size_t j) {
    const auto whole = joined(found_[i].line, found_[j].line, sigma_);
    if (!whole) return false;
    Line fitted = *whole;
    const double snr = fitter_.fit(fitted).value_or(0) / noise_at(*whole);
    const bool better = snr >= std::max(found_[i].snr, found_[j].snr) && is_streak(fitted, snr);
    // Pieces that do not make one whole lie beside each other; of those that overlap the better one stays.
    const double overlap = found_[i].line.length() + found_[j].line.length() - whole->length();
    if (!better && overlap < 0.3 * std::min(found_[i].line.length(), found_[j].line.length())) return false;
    if (better)
      found_[i] = {fitted, snr};
    else if (found_[j].snr > found_[i].snr)
      found_[i] = found_[j];
    found_.erase(found_.begin() + static_cast<std::ptrdiff_t>(j));
    return true;
  }

  /// Nothing is known of a line outside of the frame.
  void end_in_frame(Line& l) const {
    const auto end_at = [](double x1, double& y1, double x2, double y2, double least, double most) {
      const double x = std::clamp(x1, least, most);
      if (x != x1 && x1 != x2) y1 += (y2 - y1) * (x - x1) / (x2 - x1);
      return x;
    };
    const double right = light_.width() - 0.5;
    const double bottom = light_.height() - 0.5;
    l.x1 = end_at(l.x1, l.y1, l.x2, l.y2, -0.5, right);
    l.x2 = end_at(l.x2, l.y2, l.x1, l.y1, -0.5, right);
    l.y1 = end_at(l.y1, l.x1, l.y2, l.x2, -0.5, bottom);
    l.y2 = end_at(l.y2, l.x2, l.y1, l.x1, -0.5, bottom);
  }

  [[nodiscard]] std::vector<Streak> result() {
    std::vector<Streak> streaks;
    for (auto& [l, snr] : found_) {
      fitter_.weigh_ends(l, noise_at(l));
      end_in_frame(l);
      const double unit = double(clean_.noise_adu.at((l.x1 + l.x2) / 2, (l.y1 + l.y2) / 2));
      // Across the line a Gaussian; along it all light lies between the ends, on average.
      const double light = l.length() * std::sqrt(2 * std::numbers::pi) * sigma_ * l.scale;
      streaks.push_back({l.x1, l.y1, l.x2, l.y2, snr, l.height * light * unit, 2.3548 * sigma_ * l.scale});
    }
    std::sort(streaks.begin(), streaks.end(), [](const Streak& a, const Streak& b) { return a.snr > b.snr; });
    return streaks;
  }

  const CleanFrame& clean_;
  const StarField& field_;
  const StreakOptions& options_;
  double sigma_;
  double fwhm_;
  SearchedSky sky_;
  Plane light_;  ///< without background and certain stars, in noise
  Grid<std::uint8_t> mask_;
  PlaceIndex places_;  ///< of the stars
  Plane filtered_;     ///< the light through the matched filter, noise 1
  LineFitter fitter_;
  Surface noise_;        ///< of the filtered light, before it was made 1
  double restless_ = 1;  ///< how many times more significant a line has to be here
  std::vector<Found> found_;
  std::vector<Band> refused_;       ///< seeds
  std::vector<Line> refused_fits_;  ///< what they led to
  std::vector<bool> taken_;         ///< stars that are parts of streaks
  std::vector<bool> shown_;         ///< stars whose light is in light_
};

/// Whether a streak is a piece of a trail, or the same.
bool is_piece_of(const Streak& piece, const Streak& trail) {
  const Along line(Line{trail.x1, trail.y1, trail.x2, trail.y2});
  const double reach = 0.8 * std::max(piece.width_px, trail.width_px) + 3;
  const double x = (piece.x1 + piece.x2) / 2;
  const double y = (piece.y1 + piece.y2) / 2;
  return line.beyond(x, y) == 0 && line.across(piece.x1, piece.y1) < reach &&
         line.across(piece.x2, piece.y2) < reach;
}

/// Of a line that both finders have, the matched one is more exact, where it is not only a piece.
void merge_trails(std::vector<Streak>&& trails, std::vector<Streak>& streaks) {
  for (Streak& trail : trails) {
    // Where the noise hides a trail's ends, those of the matched line are as good.
    const double length = trail.length_px();
    const bool is_clear = trail.snr > clear_trail * std::sqrt(length);
    const double same =
        is_clear ? std::min(same_length * length, length - 3 * trail.width_px - 4) : 0.5 * length;
    const auto is_same = [&](const Streak& s) { return is_piece_of(s, trail) && s.length_px() > same; };
    const bool contained = std::any_of(streaks.begin(), streaks.end(), [&](const Streak& s) {
      return is_piece_of(trail, s) && trail.length_px() < s.length_px();
    });
    if (contained || std::any_of(streaks.begin(), streaks.end(), is_same)) continue;
    std::erase_if(streaks, [&](const Streak& s) { return is_piece_of(s, trail); });
    streaks.push_back(trail);
  }
  std::sort(streaks.begin(), streaks.end(), [](const Streak& a, const Streak& b) { return a.snr > b.snr; });
}

/// Stars that a trail's light was taken for: on it, and not much brighter than it.
void drop_stars_of(const std::vector<Streak>& trails, const CleanFrame& clean, StarField& field) {
  for (const Streak& t : trails) {
    const Along line(Line{t.x1, t.y1, t.x2, t.y2});
    const double height = t.flux / (t.length_px() * 1.064 * t.width_px);
    std::erase_if(field.stars, [&](const Star& s) {
      return line.beyond(s.x, s.y) == 0 && line.across(s.x, s.y) < 0.8 * t.width_px + 0.5 &&
             s.flux / clean.psf.flux() < trail_star_most * height;
    });
  }
}

}  // namespace

std::vector<Streak> find_streaks(const CleanFrame& clean, StarField& field, const StreakOptions& options) {
  Finder finder(clean, field, options);
  std::vector<Streak> streaks = finder.run();
  std::vector<Streak> trails =
      find_trails(clean, field.stars, {options.snr_least, options.length_least_px}, finder.take_spare());
  std::size_t i = 0;
  std::erase_if(field.stars, [&](const Star&) { return finder.is_part_of_streak(i++); });
  drop_stars_of(trails, clean, field);
  merge_trails(std::move(trails), streaks);
  return streaks;
}

}  // namespace srfs::image
