// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "image/trail_finder.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <numeric>
#include <optional>
#include <unordered_map>

#include "image/filter.hpp"
#include "image/line_search.hpp"
#include "image/rows.hpp"
#include "image/searched_sky.hpp"

namespace srfs::image {
namespace {

/// What one pixel counts in a cell, in noise: a star or a hot pixel lights no
/// line.
constexpr float pixel_clip = 6;
constexpr float cell_clip = 5;
constexpr std::array<int, 2> cells_px{4, 8};
constexpr float cell_lit = 1.4F;
constexpr double lit_cells = 0.42;
constexpr double hit_least = 6.5;
constexpr std::size_t seeds_most = 120;  ///< that are looked at closely
constexpr int rounds_most = 12;          ///< of settling one
constexpr int profile_rows = 80;         ///< of a strip that make its profile, about
constexpr double dark_costs = 0.9;       ///< of a dark bin, beside the gain of a lit one, for the ends
constexpr double lit_share_of_height = 0.3;
constexpr double lit_errors = 2.5;
constexpr double lit_least = 0.5;       ///< share of the bins of a trail
constexpr double stands_out_least = 6;  ///< spreads that the number of lit bins is above that beside it
constexpr double shortest_px = 24;
constexpr double elongation_least = 5;   ///< length beside width
constexpr double track_longest_px = 64;  ///< a particle's
constexpr double track_widest_px = 2.2;  ///< and so wide at most, however wide the stars
constexpr int lit_bins = 5;
constexpr int lit_bins_of_stars = 8;  ///< of a trail as wide as stars: a row of them may be that short
constexpr double ragged_most = 0.75;  ///< more: stars in a row, or the glare of one
constexpr double ragged_most_short = 0.3;
constexpr double snr_least = 12;
constexpr double fading_ends = 0.65;  ///< less, and light that follows the distance from the middle so well
constexpr double fading = -0.75;
constexpr double unexplained_least = 0.03;  ///< share of a trail's light squared that stars leave
constexpr double width_most_px = 17;
constexpr double widest = 7;      ///< beside stars
constexpr double short_row = 20;  ///< FWHM; more stars do not stand in a row
constexpr double beads_least = 0.45;
constexpr double even_ends = 0.3;    ///< of the outer quarters' light beside the middle's
constexpr double beside_most = 0.3;  ///< of the height, in the light beside the trail
constexpr double ray_star = 3;       ///< a ray's star is so many times as bright as the ray
constexpr double glaring_star = 15;  ///< its very middle lies on its rays
constexpr double ray_longest_px = 200;
constexpr double ray_falls_ragged = 0.8;  ///< more, of a trail whose light changes along it
constexpr double ray_falls = 1.35;
/// A star so many times as bright as a trail is none of its knots. Where it has more than this share of the
/// trail's height, nothing is known; farther out, to so little light, its own is taken away.
constexpr double trail_star = 6;
constexpr double hidden_share = 1;
constexpr float halo_least = 0.3F;
constexpr int halo_radius_max = 100;
constexpr double joined_gap_share = 0.6;  ///< of the length of both pieces

struct Trail {
  double x1, y1, x2, y2;
  double width = 3;   ///< FWHM across
  double height = 0;  ///< of its middle line, in noise
  double snr = 0;
  double light = 0;  ///< sum, in noise
  double ragged = 0;

  [[nodiscard]] double length() const { return std::hypot(x2 - x1, y2 - y1); }
  [[nodiscard]] Line line() const { return {x1, y1, x2, y2}; }
};

/// Pixels beside a line, in steps of a pixel along and across it.
struct Strip {
  int along = 0;
  int across = 0;  ///< 2 reach + 1
  int reach = 0;
  std::vector<float> light;  ///< 0 where nothing is known
  std::vector<std::uint8_t> known;
  [[nodiscard]] std::size_t at(int t, int s) const {
    return static_cast<std::size_t>(t) * static_cast<std::size_t>(across) +
           static_cast<std::size_t>(s + reach);
  }
};

/// A piece of a trail's length.
struct Bin {
  double light = 0;  ///< mean beside the sky left and right of it
  double error = 0;
  bool seen = false;
};

class Finder {
 public:
  Finder(const CleanFrame& clean, std::span<const Star> stars, const TrailOptions& options, Plane spare)
      : clean_(clean), stars_(stars), options_(options), sky_(clean), light_(std::move(spare)) {
    light_ = clean.signal;
    for (const Spike& s : clean.spikes) light_.at(s.x, s.y) = s.light;
  }

  std::vector<Streak> run() {
    for (const int cell : cells_px) {
      if (light_.width() < 16 * cell || light_.height() < 16 * cell) continue;
      std::size_t looked = 0;
      const Plane cells = cells_of(cell);
      for (const LineHit& hit : hits(cells)) {
        const Line seed = in_pixels(hit, cell);
        if (!is_lit_throughout(cells, hit) || is_known(seed)) continue;
        if (sky_.is_in_unrest(seed) || sky_.is_beside_no_sky(seed)) continue;
        if (++looked > seeds_most) break;
        if (const auto trail = examine(seed, cell))
          found_.push_back(*trail);
        else
          refused_.push_back(seed);
      }
    }
    join();
    return result();
  }

 private:
  // --- where to look ---

  /// Sums of squares of clipped pixels without what is larger than a trail,
  /// noise 1.
  [[nodiscard]] Plane cells_of(int cell) {
    Plane cells(light_.width() / cell, light_.height() / cell);
    std::vector<float> clipped(static_cast<std::size_t>(light_.width()));
    std::vector<float> sums(clipped.size());
    for (int y = 0; y < cells.height(); ++y) {
      std::fill(sums.begin(), sums.end(), 0.0F);
      for (int i = 0; i < cell; ++i) {
        clip_row(light_.row(y * cell + i), pixel_clip, clipped.data(), light_.width());
        add_row(clipped.data(), sums.data(), light_.width());
      }
      float* to = cells.row(y);
      for (int x = 0; x < cells.width(); ++x) {
        const auto from = sums.begin() + static_cast<std::ptrdiff_t>(x) * cell;
        to[x] = std::accumulate(from, from + cell, 0.0F) / static_cast<float>(cell);
      }
    }
    high_pass(cells);
    std::vector<float> sizes;
    for (std::size_t i = 0; i < cells.size(); i += 3) sizes.push_back(std::abs(cells.cells()[i]));
    const float unit = std::max(0.3F, 1.4826F * median_of(sizes));
    if (cell == cells_px.front()) noise_ = std::max(1.0, double(unit));
    for (float& v : cells.cells()) v /= unit;
    return cells;
  }

  [[nodiscard]] static std::vector<LineHit> hits(const Plane& cells) {
    // In a field so full that stars light many cells, these are the noise.
    float squares = 0;
    for (const float v : cells.cells()) squares += std::pow(std::clamp(v, -4.0F, cell_clip), 2.0F);
    const double crowd = std::sqrt(double(squares) / static_cast<double>(cells.size()));
    return search_lines(cells, 0.3, hit_least * std::max(1.0, crowd), cell_clip);
  }

  /// Most cells along it are lit, which of stars in a row they are not.
  [[nodiscard]] static bool is_lit_throughout(const Plane& cells, const LineHit& hit) {
    const double dx = hit.x2 - hit.x1;
    const double dy = hit.y2 - hit.y1;
    const int n = std::max(1, static_cast<int>(std::max(std::abs(dx), std::abs(dy))));
    const bool steep = std::abs(dy) > std::abs(dx);
    std::vector<float> along;
    for (int i = 0; i <= n; ++i) {
      const int x = static_cast<int>(std::lround(hit.x1 + dx * i / n));
      const int y = static_cast<int>(std::lround(hit.y1 + dy * i / n));
      float most = -1;
      for (const int k : {-1, 0, 1}) {
        const int px = steep ? x + k : x;
        const int py = steep ? y : y + k;
        if (cells.contains(px, py)) most = std::max(most, cells.at(px, py));
      }
      along.push_back(most);
    }
    const auto lit = std::count_if(along.begin(), along.end(), [](float v) { return v > cell_lit; });
    return static_cast<double>(lit) > lit_cells * static_cast<double>(along.size());
  }

  static Line in_pixels(const LineHit& hit, int cell) {
    const auto px = [&](double c) { return c * cell + (cell - 1) / 2.0; };
    return {px(hit.x1), px(hit.y1), px(hit.x2), px(hit.y2)};
  }

  /// Of nine places along a line, how many are near another.
  [[nodiscard]] static int places_on(const Line& seed, const Line& other, double reach) {
    const double length = std::max(1.0, other.length());
    const double ux = (other.x2 - other.x1) / length;
    const double uy = (other.y2 - other.y1) / length;
    int on = 0;
    for (int k = 0; k < 9; ++k) {
      const double x = seed.x1 + (k + 0.5) / 9 * (seed.x2 - seed.x1) - other.x1;
      const double y = seed.y1 + (k + 0.5) / 9 * (seed.y2 - seed.y1) - other.y1;
      const double t = x * ux + y * uy;
      on += std::abs(y * ux - x * uy) < reach && t > -reach && t < length + reach;
    }
    return on;
  }

  [[nodiscard]] bool is_known(const Line& seed) const {
    for (const Trail& t : found_) {
      if (places_on(seed, t.line(), 1.5 * t.width + 6) >= 5) return true;
    }
    return std::any_of(refused_.begin(), refused_.end(), [&](const Line& l) {
      return seed.length() < 1.5 * l.length() && places_on(seed, l, 6) >= 8;
    });
  }

  // --- the light beside a line ---

  [[nodiscard]] Strip strip_along(const Trail& t, double from, double to, int reach) const {
    Strip strip;
    strip.along = std::max(1, static_cast<int>(to - from));
    strip.reach = reach;
    strip.across = 2 * reach + 1;
    strip.light.resize(static_cast<std::size_t>(strip.along) * static_cast<std::size_t>(strip.across));
    strip.known.resize(strip.light.size());
    const double length = std::max(1e-3, t.length());
    const double ux = (t.x2 - t.x1) / length;
    const double uy = (t.y2 - t.y1) / length;
    for (int i = 0; i < strip.along; ++i) {
      const double x0 = t.x1 + (from + i + 0.5) * ux;
      const double y0 = t.y1 + (from + i + 0.5) * uy;
      for (int s = -reach; s <= reach; ++s) {
        const double px = x0 - s * uy + 0.5;
        const double py = y0 + s * ux + 0.5;
        if (!(px >= 0 && py >= 0 && px < light_.width() && py < light_.height())) continue;
        const int x = static_cast<int>(px);
        const int y = static_cast<int>(py);
        if ((clean_.flaws.at(x, y) & (flaw_invalid | flaw_no_sky)) != 0) continue;
        strip.light[strip.at(i, s)] = light_.at(x, y);
        strip.known[strip.at(i, s)] = 1;
      }
    }
    take_stars_away(t, from, strip);
    return strip;
  }

  /// A star much brighter than the trail that it lies on says nothing of it, neither how bright it is nor
  /// where it ends; what it has all around itself is its own.
  void take_stars_away(const Trail& t, double from, Strip& strip) const {
    if (!(t.height > 0)) return;
    const double length = std::max(1e-3, t.length());
    const double ux = (t.x2 - t.x1) / length;
    const double uy = (t.y2 - t.y1) / length;
    for (std::size_t n = 0; n < stars_.size(); ++n) {
      const Star& star = stars_[n];
      if (height_of(star) < trail_star * t.height) break;  // brightest first
      const double along = (star.x - t.x1) * ux + (star.y - t.y1) * uy - from - 0.5;
      const double across = (star.y - t.y1) * ux - (star.x - t.x1) * uy;
      const double beside = std::max(0.0, std::abs(across) - strip.reach);
      const double beyond = std::max({0.0, -along, along - strip.along});
      if (std::hypot(beside, beyond) > halo_radius_max) continue;
      take_star_away(halo_of(n), along, across, hidden_share * t.height, strip);
    }
  }

  /// @param most  light that a star may have where the strip is still of use
  static void take_star_away(const std::vector<float>& halo, double along, double across, double most,
                             Strip& strip) {
    const auto reach = static_cast<double>(halo.size()) - 1;
    const int first = std::max(0, static_cast<int>(std::ceil(along - reach)));
    const int last = std::min(strip.along - 1, static_cast<int>(std::floor(along + reach)));
    for (int i = first; i <= last; ++i) {
      const double half = std::sqrt(std::max(0.0, reach * reach - (i - along) * (i - along)));
      const int left = std::max(-strip.reach, static_cast<int>(std::ceil(across - half)));
      const int right = std::min(strip.reach, static_cast<int>(std::floor(across + half)));
      for (int k = left; k <= right; ++k) {
        const std::size_t at = strip.at(i, k);
        if (strip.known[at] == 0) continue;
        const float light = halo[static_cast<std::size_t>(std::hypot(i - along, k - across) + 0.5)];
        strip.known[at] = double(light) < most ? 1 : 0;
        strip.light[at] = strip.known[at] != 0 ? strip.light[at] - light : 0;
      }
    }
  }

  /// A star's light by the distance from its middle, down to little: of eight pieces of each ring one that
  /// no trail through the star reaches.
  [[nodiscard]] const std::vector<float>& halo_of(std::size_t star) const {
    const auto [place, is_new] = halos_.try_emplace(star);
    std::vector<float>& halo = place->second;
    if (!is_new) return halo;
    const Star& s = stars_[star];
    int quiet = 0;
    for (int r = 0; r < halo_radius_max && quiet < 2; ++r) {
      halo.push_back(ring_light(s, r));
      quiet = halo.back() < halo_least ? quiet + 1 : 0;
    }
    halo.push_back(0);
    return halo;
  }

  [[nodiscard]] float ring_light(const Star& s, int r) const {
    const int pieces = r < 4 ? 1 : 8;
    const int steps = std::max(3, static_cast<int>(2 * std::numbers::pi * r / pieces));
    std::vector<float> medians;
    std::vector<float> values;
    for (int piece = 0; piece < pieces; ++piece) {
      values.clear();
      for (int k = 0; k < steps; ++k) {
        const double angle = 2 * std::numbers::pi * (piece + (k + 0.5) / steps) / pieces;
        const int x = static_cast<int>(std::lround(s.x + r * std::cos(angle)));
        const int y = static_cast<int>(std::lround(s.y + r * std::sin(angle)));
        if (light_.contains(x, y) && (clean_.flaws.at(x, y) & (flaw_invalid | flaw_no_sky)) == 0)
          values.push_back(light_.at(x, y));
      }
      if (!values.empty()) medians.push_back(median_of(values));
    }
    if (medians.empty()) return 0;
    const auto low = medians.begin() + static_cast<std::ptrdiff_t>(medians.size() / 3);
    std::nth_element(medians.begin(), low, medians.end());
    return *low;
  }

  [[nodiscard]] double height_of(const Star& s) const {
    return s.flux / clean_.psf.flux() / double(clean_.noise_adu.at(s.x, s.y));
  }

  /// Moves the ends across until the band between them has the most light, no
  /// pixel counting more than
  /// @p clip.
  static void turn(Trail& t, const Strip& strip, double band, int most, float clip) {
    const int half = std::max(0, static_cast<int>(std::lround((band - 1) / 2)));
    const int range = std::min(most, strip.reach - half);
    if (range < 1) return;
    // Light of the band around each place, by running sums.
    const int wide = 2 * range + 1;
    std::vector<float> bands(static_cast<std::size_t>(strip.along) * static_cast<std::size_t>(wide));
    for (int i = 0; i < strip.along; ++i) {
      for (int d = -range; d <= range; ++d) {
        float sum = 0;
        for (int s = d - half; s <= d + half; ++s) sum += std::min(clip, strip.light[strip.at(i, s)]);
        bands[static_cast<std::size_t>(i * wide + d + range)] =
            std::min(sum, clip * (0.7F * static_cast<float>(half) + 1));
      }
    }
    double best = -1e30;
    double d1 = 0, d2 = 0;
    const int step = std::max(1, strip.along / 96);
    for (int a = -range; a <= range; ++a) {
      for (int b = -range; b <= range; ++b) {
        double sum = 0;
        for (int i = 0; i < strip.along; i += step) {
          const double share = (i + 0.5) / strip.along;
          const int d = static_cast<int>(std::lround(a + share * (b - a)));
          sum += double(bands[static_cast<std::size_t>(i * wide + d + range)]);
        }
        // The nearest of equal ones.
        sum -= 1e-3 * (a * a + b * b);
        if (sum > best) best = sum, d1 = a, d2 = b;
      }
    }
    shift(t, d1, d2);
  }

  static void shift(Trail& t, double d1, double d2) {
    const double length = std::max(1e-3, t.length());
    const double ux = (t.x2 - t.x1) / length;
    const double uy = (t.y2 - t.y1) / length;
    t.x1 -= d1 * uy, t.y1 += d1 * ux;
    t.x2 -= d2 * uy, t.y2 += d2 * ux;
  }

  /// The light across, of part of the length: a mean without the brightest and
  /// the darkest tenths.
  static std::vector<double> profile_of(const Strip& strip, int from, int end) {
    std::vector<double> profile;
    std::vector<float> values;
    const int step = std::max(1, (end - from) / profile_rows);
    for (int s = -strip.reach; s <= strip.reach; ++s) {
      values.clear();
      for (int i = from; i < end; i += step) {
        if (strip.known[strip.at(i, s)] != 0) values.push_back(strip.light[strip.at(i, s)]);
      }
      const std::size_t cut = values.size() / 10;
      if (values.size() < 3) {
        profile.push_back(0);
        continue;
      }
      std::nth_element(values.begin(), values.begin() + static_cast<std::ptrdiff_t>(cut), values.end());
      std::nth_element(values.begin() + static_cast<std::ptrdiff_t>(cut),
                       values.end() - static_cast<std::ptrdiff_t>(cut) - 1, values.end());
      double sum = 0;
      for (std::size_t k = cut; k < values.size() - cut; ++k) sum += double(values[k]);
      profile.push_back(sum / static_cast<double>(values.size() - 2 * cut));
    }
    return profile;
  }

  struct Across {
    double middle;
    double width;
    double height;
    double level;
  };

  /// Middle, width and height of what stands out of a profile near its middle.
  static std::optional<Across> measure_across(const std::vector<double>& profile, double search) {
    const int reach = static_cast<int>(profile.size()) / 2;
    std::vector<float> outer;
    for (int s = -reach; s <= reach; ++s) {
      if (std::abs(s) > 0.6 * reach)
        outer.push_back(static_cast<float>(profile[static_cast<std::size_t>(s + reach)]));
    }
    const double level = double(median_of(outer));
    const auto at = [&](int s) {
      return s < -reach || s > reach ? 0 : profile[static_cast<std::size_t>(s + reach)] - level;
    };
    int peak = 0;
    for (int s = -static_cast<int>(search); s <= static_cast<int>(search); ++s) {
      if (at(s) > at(peak)) peak = s;
    }
    const double height = at(peak);
    if (!(height > 0)) return std::nullopt;
    // Where it falls to half on both sides.
    const auto half_at = [&](int way) {
      int s = peak;
      while (std::abs(s) < reach && at(s + way) > height / 2) s += way;
      const double here = at(s), next = at(s + way);
      return s + way * (here > next ? std::clamp((here - height / 2) / (here - next), 0.0, 1.0) : 0.5);
    };
    const double left = half_at(-1);
    const double right = half_at(1);
    return Across{(left + right) / 2, std::max(0.8, right - left), height, level};
  }

  /// The bins of a piece of a line.
  [[nodiscard]] std::vector<Bin> bins_of(const Strip& strip, const Trail& t, int bin_px) const {
    const int core = std::max(0, static_cast<int>(std::lround(0.55 * t.width - 0.3)));
    const int inner = std::min(strip.reach - 1, static_cast<int>(std::ceil(1.2 * t.width + 1)));
    const int outer = std::min(strip.reach, static_cast<int>(std::ceil(2.5 * t.width + 3)));
    const auto most = static_cast<float>(4 * t.height + 3);
    std::vector<Bin> bins;
    std::vector<float> beside;
    for (int from = 0; from + bin_px <= strip.along; from += bin_px) {
      beside.clear();
      double sum = 0;
      int n = 0;
      for (int i = from; i < from + bin_px; ++i) {
        for (int s = -outer; s <= outer; ++s) {
          if (strip.known[strip.at(i, s)] == 0) continue;
          const float v = strip.light[strip.at(i, s)];
          if (std::abs(s) <= core)
            sum += double(std::min(v, most)), ++n;
          else if (std::abs(s) >= inner)
            beside.push_back(v);
        }
      }
      Bin bin;
      bin.seen = 2 * n >= bin_px * (2 * core + 1) && beside.size() >= 4;
      if (bin.seen) {
        bin.light = sum / n - double(median_of(beside));
        bin.error = noise_ * std::sqrt(1.0 / n + 1.5 / static_cast<double>(beside.size()));
      }
      bins.push_back(bin);
    }
    return bins;
  }

  [[nodiscard]] static bool is_lit(const Bin& bin, double height) {
    return bin.seen && bin.light > std::max(lit_share_of_height * height, lit_errors * bin.error);
  }

  // --- one candidate ---

  [[nodiscard]] int reach_for(const Trail& t) const {
    return std::clamp(static_cast<int>(std::ceil(2.5 * t.width + 4)), 8, 90);
  }

  /// As long as a star is wide at least: between two of a row there are dark
  /// ones.
  [[nodiscard]] int bin_px(const Trail& t) const {
    const double star = clean_.psf_measured ? clean_.psf.fwhm_px() : 2;
    return std::clamp(static_cast<int>(std::lround(std::max({3.0, 1.2 * star, 0.5 * t.width}))), 3, 12);
  }

  [[nodiscard]] std::optional<Trail> examine(const Line& seed, int cell) const {
    Trail t{seed.x1, seed.y1, seed.x2, seed.y2};
    t.width = 0.8 * cell;
    {
      // A seed is as coarse as its cells.
      const int reach = 3 * cell + 4;
      const Strip strip = strip_along(t, 0, t.length(), reach);
      turn(t, strip, t.width, 2 * cell, pixel_clip);
      if (is_known(t.line())) return std::nullopt;
    }
    for (int round = 0; round < rounds_most; ++round) {
      if (!settle_across(t, round)) return std::nullopt;
      const double before = t.length();
      if (!settle_ends(t)) return std::nullopt;
      if (round >= 2 && std::abs(t.length() - before) < 3) break;
    }
    if (!settle_across(t, rounds_most)) return std::nullopt;
    return is_trail(t) ? std::optional(t) : std::nullopt;
  }

  /// Middle line, width and height. @return false where nothing stands out
  [[nodiscard]] bool settle_across(Trail& t, int round) const {
    for (int again = 0; again < 3; ++again) {
      const Strip strip = strip_along(t, 0, t.length(), reach_for(t));
      if (round > 0) {
        Trail turned = t;
        turn(turned, strip, t.width, std::max(1, static_cast<int>(0.7 * t.width)),
             std::max(pixel_clip, static_cast<float>(2 * t.height)));
        t.x1 = turned.x1, t.y1 = turned.y1, t.x2 = turned.x2, t.y2 = turned.y2;
      }
      const Strip moved = round > 0 ? strip_along(t, 0, t.length(), reach_for(t)) : strip;
      const double search = std::max(2.0, t.width);
      const auto all = measure_across(profile_of(moved, 0, moved.along), search);
      if (!all) return false;
      // The middle of both halves, where they are alike.
      const int half = moved.along / 2;
      const auto first = measure_across(profile_of(moved, 0, half), search);
      const auto second = measure_across(profile_of(moved, half, moved.along), search);
      if (first && second && half >= 8 && std::abs(first->middle - second->middle) < all->width) {
        const double slope = second->middle - first->middle;
        const double middle = (first->middle + second->middle) / 2;
        shift(t, middle - slope, middle + slope);
      } else {
        shift(t, all->middle, all->middle);
      }
      t.height = all->height;
      const double width = all->width;
      const bool same = width < 1.3 * t.width && width > 0.7 * t.width;
      t.width = width;
      if (same) break;
    }
    return t.width < std::max(width_most_px, widest * clean_.psf.fwhm_px()) &&
           t.height * std::sqrt(t.width * t.length()) > 5 * noise_;
  }

  [[nodiscard]] bool settle_ends(Trail& t) const {
    const double length = t.length();
    const double more = std::max(40.0, 0.5 * length);
    const int step = bin_px(t);
    const Strip strip = strip_along(t, -more, length + more, reach_for(t));
    const std::vector<Bin> bins = bins_of(strip, t, step);
    // The piece with the most lit bins, of those that overlap with the line.
    double sum = 0, best = 0;
    std::size_t start = 0, from = 0, end = 0;
    for (std::size_t i = 0; i < bins.size(); ++i) {
      if (sum <= 0) sum = 0, start = i;
      if (bins[i].seen) sum += is_lit(bins[i], t.height) ? 1 : -dark_costs;
      const double at = static_cast<double>(i + 1) * step - more;
      const double begin = static_cast<double>(start) * step - more;
      if (sum > best && at > 0 && begin < length) best = sum, from = start, end = i + 1;
    }
    if (best < 3) return false;
    double t1 = static_cast<double>(from) * step - more;
    double t2 = static_cast<double>(end) * step - more;
    sharpen_ends(t, strip, more, bins, from, end, step, t1, t2);
    const double ux = (t.x2 - t.x1) / length;
    const double uy = (t.y2 - t.y1) / length;
    const double x = t.x1, y = t.y1;
    t.x1 = x + t1 * ux, t.y1 = y + t1 * uy;
    t.x2 = x + t2 * ux, t.y2 = y + t2 * uy;
    return t2 - t1 > 8;
  }

  /// An end lies in its bin, or in the next, where the light of three steps
  /// falls below half of the bins'.
  void sharpen_ends(const Trail& t, const Strip& strip, double before, const std::vector<Bin>& bins,
                    std::size_t from, std::size_t end, int step, double& t1, double& t2) const {
    const std::vector<Bin> steps = bins_of(strip, t, 1);
    const auto light_at = [&](int i) {
      double sum = 0;
      int n = 0;
      for (int k = i - 1; k <= i + 1; ++k) {
        if (k >= 0 && k < static_cast<int>(steps.size()) && steps[static_cast<std::size_t>(k)].seen)
          sum += steps[static_cast<std::size_t>(k)].light, ++n;
      }
      return n > 0 ? sum / n : 0;
    };
    const auto half_of = [&](std::size_t a, std::size_t b) {
      double sum = 0;
      int n = 0;
      for (std::size_t i = a; i < b; ++i) {
        if (is_lit(bins[i], t.height)) sum += bins[i].light, ++n;
      }
      return n > 0 ? std::min(sum / n, 1.5 * t.height) / 2 : t.height / 2;
    };
    const double half1 = half_of(from, std::min(end, from + 4));
    const double half2 = half_of(end > from + 4 ? end - 4 : from, end);
    const int last = static_cast<int>(steps.size());
    int a = std::clamp(static_cast<int>(t1 + before) - step, 0, last - 1);
    const int a_most = std::min(last - 1, a + 3 * step);
    while (a < a_most && light_at(a) < half1) ++a;
    int b = std::clamp(static_cast<int>(t2 + before) + step, 0, last - 1);
    const int b_least = std::max(0, b - 3 * step);
    while (b > b_least && light_at(b) < half2) --b;
    if (b <= a) return;
    t1 = a - before;
    t2 = b + 1 - before;
  }

  // --- what it is ---

  [[nodiscard]] bool is_trail(Trail& t) const {
    const double length = t.length();
    if (length < std::max({shortest_px, options_.length_least_px, elongation_least * t.width})) return false;
    if (is_sharp(t) && length < track_longest_px) return false;
    if (sky_.is_along_edge(t.line(), t.width) || sky_.is_beside_no_sky(t.line()) ||
        sky_.is_in_unrest(t.line()))
      return false;
    const int step = bin_px(t);
    const Strip strip = strip_along(t, 0, length, reach_for(t));
    std::vector<Bin> bins = bins_of(strip, t, step);
    const Surroundings around = surroundings_of(t, step);
    for (Bin& bin : bins) bin.error = std::max(bin.error, around.spread);
    return is_lit_throughout(t, bins, step) && has_even_ends(bins) && is_alone(t, strip) &&
           stands_out(t, bins, around) && !is_ray(t, bins, step) && !are_stars(t);
  }

  /// As a particle's track, which the optics do not blur.
  [[nodiscard]] bool is_sharp(const Trail& t) const {
    return t.width <
           (clean_.psf_measured ? std::clamp(0.8 * clean_.psf.fwhm_px(), 1.4, track_widest_px) : 1.6);
  }

  /// As wide as a row of stars would be.
  [[nodiscard]] bool is_as_wide_as_stars(const Trail& t) const {
    return t.width > 0.75 * clean_.psf.fwhm_px() && t.width < 1.4 * clean_.psf.fwhm_px();
  }

  [[nodiscard]] bool is_lit_throughout(Trail& t, const std::vector<Bin>& bins, int step) const {
    std::vector<float> lights;
    int seen = 0, even = 0;
    double error = 0, sum = 0;
    for (const Bin& bin : bins) {
      if (!bin.seen) continue;
      ++seen;
      error += bin.error * bin.error;
      sum += bin.light;
      if (is_lit(bin, t.height)) lights.push_back(static_cast<float>(bin.light));
    }
    const int lit = static_cast<int>(lights.size());
    if (lit < (is_as_wide_as_stars(t) ? lit_bins_of_stars : lit_bins)) return false;
    if (2 * seen < static_cast<int>(bins.size()) || lit < lit_least * seen) return false;
    const double middle = double(median_of(lights));
    for (const float v : lights) even += double(v) < 3 * middle;
    const double core = 2 * std::max(0, static_cast<int>(std::lround(0.55 * t.width - 0.3))) + 1;
    t.snr = sum / std::sqrt(error);
    t.light = sum * step * std::max(core, 1.064 * t.width);
    t.ragged = raggedness(bins, lights, middle);
    return 10 * even > 8 * lit && t.ragged < ragged_most_of(t) &&
           t.snr > std::max(snr_least, 1.4 * options_.snr_least);
  }

  /// The halos of a few bright stars may lie in a row: what is short for its width has to be more even.
  static double ragged_most_of(const Trail& t) {
    const double longer = std::clamp((t.length() / t.width - elongation_least) / elongation_least, 0.0, 1.0);
    return ragged_most_short + longer * (ragged_most - ragged_most_short);
  }

  /// Scatter of its light along it where it is lit, beside the middle value,
  /// without that of the noise.
  static double raggedness(const std::vector<Bin>& bins, const std::vector<float>& lights, double middle) {
    std::vector<float> off;
    for (const float v : lights) off.push_back(static_cast<float>(std::abs(double(v) - middle)));
    double noise = 0;
    for (const Bin& bin : bins) noise += bin.error * bin.error / static_cast<double>(bins.size());
    const double spread = 1.4826 * double(median_of(off));
    return std::sqrt(std::max(0.0, spread * spread - noise)) / middle;
  }

  /// What fades evenly to both ends is a galaxy or the ridge of something wide.
  static bool has_even_ends(const std::vector<Bin>& bins) {
    const double middle = static_cast<double>(bins.size() - 1) / 2;
    double n = 0, d = 0, l = 0, dd = 0, dl = 0, ll = 0, outer = 0, inner = 0, outer_n = 0, inner_n = 0;
    for (std::size_t i = 0; i < bins.size(); ++i) {
      if (!bins[i].seen) continue;
      const double away = std::abs(static_cast<double>(i) - middle);
      const double light = bins[i].light;
      n += 1, d += away, l += light, dd += away * away, dl += away * light, ll += light * light;
      const bool is_outer = away > 2.0 / 3 * middle;
      (is_outer ? outer : inner) += light;
      (is_outer ? outer_n : inner_n) += 1;
    }
    if (outer_n == 0 || inner_n == 0) return true;
    const double share = outer / outer_n / (inner / inner_n);
    const double covariance = dl - d * l / n;
    const double spread = std::sqrt((dd - d * d / n) * (ll - l * l / n));
    const double correlation = spread > 0 ? covariance / spread : 0;
    return share > even_ends && (share > fading_ends || correlation > fading);
  }

  /// Little light right beside it, and as little on both sides: neither an edge
  /// nor a ridge.
  static bool is_alone(const Trail& t, const Strip& strip) {
    const std::vector<double> profile = profile_of(strip, 0, strip.along);
    const auto mean = [&](double from, double to) {
      double sum = 0;
      int n = 0;
      for (int s = static_cast<int>(std::floor(from)); s <= static_cast<int>(std::ceil(to)); ++s) {
        if (std::abs(s) <= strip.reach) sum += profile[static_cast<std::size_t>(s + strip.reach)], ++n;
      }
      return n > 0 ? sum / n : 0;
    };
    const double near = 1.4 * t.width + 1;
    const double far = 2.4 * t.width + 3;
    const double left = mean(-far, -near);
    const double right = mean(near, far);
    const double error = 1 / std::sqrt(std::max(1.0, static_cast<double>(strip.along) * (far - near)));
    return std::abs(left - right) < beside_most * t.height + 4 * error &&
           std::min(left, right) > -beside_most * t.height - 4 * error;
  }

  /// The same bins on lines beside a trail: what the sky there makes of them,
  /// by noise, stars and texture.
  struct Surroundings {
    double spread = 0;  ///< of a bin's light
    std::vector<std::vector<Bin>> lines;
  };

  [[nodiscard]] Surroundings surroundings_of(const Trail& t, int step) const {
    Surroundings around;
    std::vector<float> lights;
    const double spacing = std::max(2.2 * t.width + 2, 5.0);
    for (const int k : {-5, -4, -3, -2, 2, 3, 4, 5}) {
      Trail other = t;
      shift(other, k * spacing, k * spacing);
      around.lines.push_back(bins_of(strip_along(other, 0, other.length(), reach_for(t)), t, step));
      for (const Bin& bin : around.lines.back()) {
        if (bin.seen) lights.push_back(static_cast<float>(bin.light));
      }
    }
    if (lights.size() < 16) return around;
    const float middle = median_of(lights);
    // Nothing in the sky is dark: a tenth that is much darker has been made by coding, and as much light.
    const auto tenth = lights.begin() + static_cast<std::ptrdiff_t>(lights.size() / 10);
    std::nth_element(lights.begin(), tenth, lights.end());
    const double dark = double(middle - *tenth) / 1.2816;
    for (float& v : lights) v = std::abs(v - middle);
    around.spread = std::max(1.4826 * double(median_of(lights)), dark);
    return around;
  }

  /// More of it is lit than of the lines beside it.
  [[nodiscard]] bool stands_out(const Trail& t, const std::vector<Bin>& bins,
                                const Surroundings& around) const {
    const auto count = [&](const std::vector<Bin>& of) {
      int seen = 0, lit = 0;
      for (Bin bin : of) {
        seen += bin.seen;
        bin.error = std::max(bin.error, around.spread);
        lit += is_lit(bin, t.height);
      }
      return std::pair(seen, lit);
    };
    const auto [seen, lit] = count(bins);
    int beside_seen = 0, beside_lit = 0, alike = 0;
    for (const std::vector<Bin>& line : around.lines) {
      const auto [n, on] = count(line);
      beside_seen += n;
      beside_lit += on;
      alike += n > 4 && on * seen > 0.6 * lit * n;
    }
    if (beside_seen < seen) return true;
    const double p = std::max(0.02, static_cast<double>(beside_lit) / beside_seen);
    const double n = seen;
    const double least = std::min(stands_out_least, 0.5 * std::sqrt(n / 0.1));
    return alike <= 1 && lit - n * p > least * std::sqrt(n * p * (1 - p) + 1) && lit > 1.8 * n * p;
  }

  /// Whether the stars found there explain its light: then they stand in a row.
  [[nodiscard]] bool are_stars(const Trail& t) const {
    if (!is_as_wide_as_stars(t)) return false;
    const double length = t.length();
    if (length < short_row * clean_.psf.fwhm_px() && is_beaded(t)) return true;
    const double ux = (t.x2 - t.x1) / length;
    const double uy = (t.y2 - t.y1) / length;
    std::vector<const Star*> near;
    const double reach = 3 * clean_.psf.fwhm_px();
    for (const Star& s : stars_) {
      const double along = (s.x - t.x1) * ux + (s.y - t.y1) * uy;
      const double off = std::abs((s.y - t.y1) * ux - (s.x - t.x1) * uy);
      if (off < t.width + reach && along > -reach && along < length + reach) near.push_back(&s);
    }
    if (near.size() < 3) return false;
    double light = 0, left = 0;
    for_pixels_along(
        t.line(), light_.width(), light_.height(), 0.6 * t.width, 0, [&](int x, int y, double, double) {
          if (clean_.flaws.at(x, y) != 0) return;
          double model = 0;
          for (const Star* s : near) {
            if (std::abs(s->x - x) > reach || std::abs(s->y - y) > reach) continue;
            model += s->flux / clean_.psf.flux() / double(clean_.noise_adu.at(s->x, s->y)) *
                     double(clean_.psf.height(static_cast<float>(x - s->x), static_cast<float>(y - s->y)));
          }
          const double v = double(light_.at(x, y));
          light += v * v - 1;
          left += (v - model) * (v - model) - 1;
        });
    return left < unexplained_least * light;
  }

  /// Its light changes as fast as that of stars beside each other.
  [[nodiscard]] bool is_beaded(const Trail& t) const {
    const std::vector<Bin> steps = bins_of(strip_along(t, 0, t.length(), reach_for(t)), t, 1);
    double n = 0, sum = 0, squares = 0, noise = 0;
    for (std::size_t i = 2; i + 2 < steps.size(); ++i) {
      if (!steps[i].seen) continue;
      n += 1, sum += steps[i].light, squares += steps[i].light * steps[i].light;
      noise += steps[i].error * steps[i].error;
    }
    if (n < 8 || sum <= 0) return false;
    const double mean = sum / n;
    return squares / n - mean * mean - noise / n > beads_least * beads_least * mean * mean;
  }

  /// What struts, lens or an overexposed column make of a much brighter star.
  [[nodiscard]] bool is_ray(const Trail& t, const std::vector<Bin>& bins, int step) const {
    const double length = t.length();
    const double ux = (t.x2 - t.x1) / length;
    const double uy = (t.y2 - t.y1) / length;
    const std::size_t most = std::min<std::size_t>(stars_.size(), 200);
    for (std::size_t i = 0; i < most; ++i) {
      const Star& s = stars_[i];
      const double height = height_of(s);
      if (height < ray_star * t.height) break;  // brightest first
      const double along = (s.x - t.x1) * ux + (s.y - t.y1) * uy;
      const double gap = std::max({0.0, -along, along - length});
      const double off = std::abs((s.y - t.y1) * ux - (s.x - t.x1) * uy);
      if (off > std::max(2.0, 0.7 * t.width) + 0.04 * gap || gap > std::max(30.0, length)) continue;
      const bool glaring = height > glaring_star * t.height && is_saturated_near(s);
      // Both its arms are about as long.
      if (glaring && length < ray_longest_px && std::abs(along / length - 0.5) < 0.2 &&
          off < std::max(1.0, 0.35 * clean_.psf.fwhm_px()))
        return true;
      const bool overexposed =
          std::min(std::abs(ux), std::abs(uy)) < 0.02 && gap < 2 * t.width + 20 && is_saturated_near(s);
      if (overexposed || falls_from(bins, step, along, length, ray_falls + ray_falls_ragged * t.ragged))
        return true;
    }
    return false;
  }

  [[nodiscard]] bool is_saturated_near(const Star& s) const {
    const int x = static_cast<int>(std::lround(s.x));
    const int y = static_cast<int>(std::lround(s.y));
    return clean_.flaws.contains(x, y) && (clean_.flaws.at(x, y) & flaw_saturated) != 0;
  }

  static bool falls_from(const std::vector<Bin>& bins, int step, double source, double length, double least) {
    const double farthest = std::max(std::abs(source), std::abs(length - source));
    const double nearest = std::max({0.0, -source, source - length});
    const double middle = (nearest + farthest) / 2;
    std::vector<float> near, far;
    for (std::size_t i = 0; i < bins.size(); ++i) {
      if (!bins[i].seen) continue;
      const double d = std::abs((static_cast<double>(i) + 0.5) * step - source);
      (d < middle ? near : far).push_back(static_cast<float>(bins[i].light));
    }
    if (near.size() < 2 || far.size() < 2) return false;
    return double(median_of(near)) > least * std::max(0.0, double(median_of(far)));
  }

  // --- all of them ---

  /// Pieces along one line, as wide and as bright, are one trail.
  void join() {
    for (bool again = true; again;) {
      again = false;
      for (std::size_t i = 0; i < found_.size() && !again; ++i) {
        for (std::size_t j = i + 1; j < found_.size() && !again; ++j) {
          const auto whole = joined(found_[i], found_[j]);
          if (!whole) continue;
          found_[i] = *whole;
          found_.erase(found_.begin() + static_cast<std::ptrdiff_t>(j));
          again = true;
        }
      }
    }
  }

  [[nodiscard]] std::optional<Trail> joined(const Trail& a, const Trail& b) const {
    const Trail& l = a.length() >= b.length() ? a : b;
    const Trail& s = a.length() >= b.length() ? b : a;
    const double length = l.length();
    const double ux = (l.x2 - l.x1) / length;
    const double uy = (l.y2 - l.y1) / length;
    const auto along = [&](double x, double y) { return (x - l.x1) * ux + (y - l.y1) * uy; };
    const auto across = [&](double x, double y) { return std::abs((y - l.y1) * ux - (x - l.x1) * uy); };
    const double t1 = std::min(along(s.x1, s.y1), along(s.x2, s.y2));
    const double t2 = std::max(along(s.x1, s.y1), along(s.x2, s.y2));
    const double gap = std::max({0.0, t1 - length, -t2});
    const double slack = 0.6 * std::max(l.width, s.width) + 1.5 + 0.03 * gap;
    if (across(s.x1, s.y1) > slack || across(s.x2, s.y2) > slack) return std::nullopt;
    if (gap > joined_gap_share * (length + s.length())) return std::nullopt;
    if (gap == 0 && t1 > -4 && t2 < length + 4) return l;  // a piece of it
    Trail whole = l;
    const double from = std::min(0.0, t1), to = std::max(length, t2);
    whole.x1 = l.x1 + from * ux, whole.y1 = l.y1 + from * uy;
    whole.x2 = l.x1 + to * ux, whole.y2 = l.y1 + to * uy;
    if (settle_across(whole, 1) && is_trail(whole)) return whole;
    return gap == 0 ? std::optional(l) : std::nullopt;
  }

  [[nodiscard]] std::vector<Streak> result() const {
    std::vector<Streak> streaks;
    for (const Trail& t : found_) {
      const double unit = double(clean_.noise_adu.at((t.x1 + t.x2) / 2, (t.y1 + t.y2) / 2));
      streaks.push_back({t.x1, t.y1, t.x2, t.y2, t.snr, t.light * unit, t.width, t.ragged});
    }
    std::sort(streaks.begin(), streaks.end(), [](const Streak& a, const Streak& b) { return a.snr > b.snr; });
    return streaks;
  }

  const CleanFrame& clean_;
  std::span<const Star> stars_;
  TrailOptions options_;
  SearchedSky sky_;
  Plane light_;       ///< the signal with what was taken for spikes
  double noise_ = 1;  ///< of the mean of many pixels, beside that of independent ones
  mutable std::unordered_map<std::size_t, std::vector<float>> halos_;  ///< of stars, by their index
  std::vector<Trail> found_;
  std::vector<Line> refused_;
};

}  // namespace

std::vector<Streak> find_trails(const CleanFrame& clean, std::span<const Star> stars,
                                const TrailOptions& options, Plane spare) {
  return Finder(clean, stars, options, std::move(spare)).run();
}

}  // namespace srfs::image
