// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "image/synthetic_tracking.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <optional>

#include "image/filter.hpp"
#include "image/place_index.hpp"

namespace srfs::image {
namespace {

constexpr std::size_t frames_least = 6;
/// Stars this faint may be the object: their light stays in.
constexpr double faint_star = 6;
/// A point that may be the object, in one frame.
constexpr double seed_least = 3.3;
constexpr std::size_t seeds_most = 3000;  ///< of a frame, the brightest
/// More pairs of points than that are not looked at: every frame's faintest points are left out.
constexpr double pairs_most = 1e7;
/// What stands there in the median of the other frames is no seed.
constexpr float standing_most = 1.3F;
/// The other frames of a pair: given up where the first ones have less than so much each, and where all of
/// them are less significant than that.
constexpr int first_frames = 4;
constexpr float first_least = 0.5F;
constexpr float rest_least = 3.5F;
/// What one frame counts at most: what is brighter in one than in the others is something else.
constexpr float frame_most = 7;
/// An object is seen in so many of the frames, in each with so much.
constexpr double seen_share = 0.66;
constexpr float seen_least = 0.8F;
constexpr double point_least = 1.5;
/// So many objects like one that is kept would be found in a sequence of noise; every pair is looked at in
/// so many places that differ.
constexpr double chance_most = 0.01;
constexpr double places_of_pair = 30;
constexpr std::size_t candidates_most = 20000;
constexpr std::size_t objects_most = 100;
constexpr int climbs_most = 40;

/// From the reference frame's pixels to a frame's.
struct ToFrame {
  double x0, y0, c, s;
  explicit ToFrame(const FrameTransform& t) {
    const double n = t.a * t.a + t.b * t.b;
    c = t.a / n, s = t.b / n;
    x0 = -(c * t.shift_x + s * t.shift_y);
    y0 = -(c * t.shift_y - s * t.shift_x);
  }
  [[nodiscard]] double x(double u, double v) const { return x0 + c * u + s * v; }
  [[nodiscard]] double y(double u, double v) const { return y0 + c * v - s * u; }
};

struct Seed {
  double x, y;              ///< in the reference frame's pixels
  double frame_x, frame_y;  ///< in its own
  float value;
};

struct Motion {
  double x, y, vx, vy;  ///< at time 0
  [[nodiscard]] double x_at(double t) const { return x + vx * t; }
  [[nodiscard]] double y_at(double t) const { return y + vy * t; }
};

struct Stack {
  float sum = 0;
  int frames = 0;
  [[nodiscard]] float significance() const {
    return frames > 0 ? sum / std::sqrt(static_cast<float>(frames)) : 0;
  }
};

struct Candidate {
  Motion motion;
  float significance;
};

class Search {
 public:
  Search(const std::vector<FaintLight>& light, const std::vector<double>& times,
         const SequenceFindings& found, const FaintOptions& options)
      : light_(light), found_(found), options_(options) {
    for (std::size_t k = 0; k < std::min({light.size(), times.size(), found.registrations.size()}); ++k) {
      if (!found.registrations[k].registered || light[k].light.empty()) continue;
      used_.push_back(k);
      times_.push_back(times[k]);
      to_frame_.emplace_back(found.registrations[k].registration.to_reference);
      widest_ = std::max(widest_, light[k].fwhm_px);
    }
  }

  std::vector<Tracklet> run() {
    if (used_.size() < frames_least) return {};
    const auto [first, last] = std::minmax_element(times_.begin(), times_.end());
    first_ = *first, last_ = *last;
    if (!(last_ > first_)) return {};
    interval_ = (last_ - first_) / static_cast<double>(used_.size() - 1);
    for (std::size_t i = 0; i < used_.size(); ++i) seeds_.push_back(seeds_of(i));
    leave_out_the_faintest();
    for (const std::vector<Seed>& s : seeds_) places_.emplace_back(s);
    std::vector<Candidate> candidates;
    for (std::size_t i = 0; i + 2 < used_.size(); ++i) {
      for (std::size_t j = i + 2; j < used_.size(); ++j) add_pairs(i, j, candidates);
    }
    return best_of(candidates);
  }

 private:
  [[nodiscard]] const Grid<std::int8_t>& light(std::size_t i) const { return light_[used_[i]].light; }

  /// In the nearest pixel; hidden outside of the frame.
  [[nodiscard]] std::int8_t nearest(std::size_t i, double u, double v) const {
    const Grid<std::int8_t>& l = light(i);
    const double x = to_frame_[i].x(u, v) + 0.5;
    const double y = to_frame_[i].y(u, v) + 0.5;
    if (!(x >= 0 && y >= 0 && x < l.width() && y < l.height())) return faint_hidden;
    return l.at(static_cast<int>(x), static_cast<int>(y));
  }

  /// Linear between the pixels, in noise; nothing where one of them is not seen.
  [[nodiscard]] std::optional<float> sample(std::size_t i, double u, double v) const {
    return sample_frame(i, to_frame_[i].x(u, v), to_frame_[i].y(u, v));
  }
  [[nodiscard]] std::optional<float> sample_frame(std::size_t i, double x, double y) const {
    const Grid<std::int8_t>& l = light(i);
    if (!(x >= 0 && y >= 0 && x < l.width() - 1 && y < l.height() - 1)) return std::nullopt;
    const int xi = static_cast<int>(x);
    const int yi = static_cast<int>(y);
    const std::int8_t* upper = l.row(yi) + xi;
    const std::int8_t* lower = l.row(yi + 1) + xi;
    if (upper[0] == faint_hidden || upper[1] == faint_hidden || lower[0] == faint_hidden ||
        lower[1] == faint_hidden)
      return std::nullopt;
    const auto fx = static_cast<float>(x - xi);
    const auto fy = static_cast<float>(y - yi);
    const auto between = [fx](const std::int8_t* p) {
      return static_cast<float>(p[0]) + fx * static_cast<float>(p[1] - p[0]);
    };
    return (between(upper) * (1 - fy) + between(lower) * fy) / faint_units;
  }

  // --- seeds ---

  [[nodiscard]] std::vector<Seed> seeds_of(std::size_t i) const {
    const Grid<std::int8_t>& l = light(i);
    const auto least = static_cast<std::int8_t>(seed_least * double(faint_units));
    std::vector<Seed> seeds;
    for (int y = 1; y + 1 < l.height(); ++y) {
      const std::int8_t* row = l.row(y);
      for (int x = 1; x + 1 < l.width(); ++x) {
        if (row[x] < least || !is_peak(l, x, y)) continue;
        const Seed seed = seed_at(i, x, y);
        if (!is_known(i, seed) && !stands_still(i, seed)) seeds.push_back(seed);
      }
    }
    keep_brightest(seeds, seeds_most);
    return seeds;
  }

  static void keep_brightest(std::vector<Seed>& seeds, std::size_t most) {
    if (seeds.size() <= most) return;
    std::nth_element(seeds.begin(), seeds.begin() + static_cast<std::ptrdiff_t>(most), seeds.end(),
                     [](const Seed& a, const Seed& b) { return a.value > b.value; });
    seeds.resize(most);
  }

  [[nodiscard]] static bool is_peak(const Grid<std::int8_t>& l, int x, int y) {
    const std::int8_t v = l.at(x, y);
    for (int j = -1; j <= 1; ++j) {
      for (int i = -1; i <= 1; ++i) {
        const std::int8_t other = l.at(x + i, y + j);
        const bool before = j < 0 || (j == 0 && i < 0);  // of equal ones the first counts
        if (other == faint_hidden || other > v || (before && other == v)) return false;
      }
    }
    return true;
  }

  [[nodiscard]] Seed seed_at(std::size_t i, int x, int y) const {
    const Grid<std::int8_t>& l = light(i);
    const auto top = [](double before, double v, double after) {
      const double bend = 2 * v - before - after;
      return bend > 0 ? std::clamp((after - before) / (2 * bend), -0.5, 0.5) : 0.0;
    };
    const double v = l.at(x, y);
    const double fx = x + top(l.at(x - 1, y), v, l.at(x + 1, y));
    const double fy = y + top(l.at(x, y - 1), v, l.at(x, y + 1));
    const auto place = transform(i)(fx, fy);
    return {place.x, place.y, fx, fy, static_cast<float>(v) / faint_units};
  }

  [[nodiscard]] const FrameTransform& transform(std::size_t i) const {
    return found_.registrations[used_[i]].registration.to_reference;
  }

  /// Light of what was found already.
  [[nodiscard]] bool is_known(std::size_t i, const Seed& seed) const {
    for (const Streak& s : found_.streaks[used_[i]]) {
      if (distance_px(s, seed.frame_x, seed.frame_y) < s.width_px + widest_) return true;
    }
    return std::any_of(found_.tracklets.begin(), found_.tracklets.end(), [&](const Tracklet& t) {
      return std::hypot(t.x0 + t.vx * times_[i] - seed.x, t.y0 + t.vy * times_[i] - seed.y) < 2 * widest_ + 2;
    });
  }

  /// On the sky, or on the detector.
  [[nodiscard]] bool stands_still(std::size_t i, const Seed& seed) const {
    std::vector<float> sky;
    std::vector<float> detector;
    for (std::size_t k = 0; k < used_.size(); ++k) {
      if (k == i) continue;
      if (const auto v = sample(k, seed.x, seed.y)) sky.push_back(*v);
      if (const auto v = sample_frame(k, seed.frame_x, seed.frame_y)) detector.push_back(*v);
    }
    return (sky.size() > 2 && median_of(sky) > standing_most) ||
           (detector.size() > 2 && median_of(detector) > standing_most);
  }

  /// Bounds the number of pairs.
  void leave_out_the_faintest() {
    const double share = std::sqrt(pairs_most / std::max(pairs_most, expected_pairs()));
    for (std::vector<Seed>& s : seeds_)
      keep_brightest(s, static_cast<std::size_t>(share * static_cast<double>(s.size())));
  }

  [[nodiscard]] double reach(double dt) const { return options_.speed_most * std::abs(dt) / interval_; }

  [[nodiscard]] double expected_pairs() const {
    const double area = static_cast<double>(light(0).size());
    double pairs = 0;
    for (std::size_t i = 0; i < seeds_.size(); ++i) {
      for (std::size_t j = i + 2; j < seeds_.size(); ++j) {
        const double r = reach(times_[j] - times_[i]);
        pairs += static_cast<double>(seeds_[i].size()) * static_cast<double>(seeds_[j].size()) *
                 std::min(1.0, std::numbers::pi * r * r / area);
      }
    }
    return pairs;
  }

  // --- pairs ---

  [[nodiscard]] double moved_least() const { return std::max(3.0, 1.5 * widest_); }

  void add_pairs(std::size_t i, std::size_t j, std::vector<Candidate>& candidates) {
    const double dt = times_[j] - times_[i];
    if (dt == 0) return;
    const double slowest = moved_least() * std::abs(dt) / (last_ - first_);
    for (const Seed& a : seeds_[i]) {
      places_[j].near(a.x, a.y, reach(dt), [&](std::size_t k, double distance) {
        if (distance < slowest) return;
        const Seed& b = seeds_[j][k];
        Motion m{0, 0, (b.x - a.x) / dt, (b.y - a.y) / dt};
        m.x = a.x - m.vx * times_[i], m.y = a.y - m.vy * times_[i];
        ++pairs_;
        if (!is_seen_by_others(m, i, j)) return;
        const Candidate c = settled(m);
        if (c.significance < static_cast<float>(options_.snr_least)) return;
        if (candidates.size() < candidates_most) candidates.push_back(c);
      });
    }
  }

  [[nodiscard]] bool is_seen_by_others(const Motion& m, std::size_t i, std::size_t j) const {
    int sum = 0;
    int frames = 0;
    for (std::size_t k = 0; k < used_.size(); ++k) {
      if (k == i || k == j) continue;
      const std::int8_t v = nearest(k, m.x_at(times_[k]), m.y_at(times_[k]));
      if (v == faint_hidden) continue;
      sum += std::min<int>(v, static_cast<int>(frame_most * faint_units));
      if (++frames == first_frames && static_cast<float>(sum) < first_least * first_frames * faint_units)
        return false;
    }
    return static_cast<float>(sum) > rest_least * faint_units * std::sqrt(static_cast<float>(frames));
  }

  [[nodiscard]] Stack stacked(const Motion& m) const {
    Stack stack;
    for (std::size_t k = 0; k < used_.size(); ++k) {
      if (const auto v = sample(k, m.x_at(times_[k]), m.y_at(times_[k])))
        stack.sum += std::min(*v, frame_most), ++stack.frames;
    }
    return stack;
  }

  /// The most significant motion near by: its first and its last place are moved, by ever less.
  [[nodiscard]] Candidate settled(const Motion& from) const {
    std::array<double, 4> ends{from.x_at(first_), from.y_at(first_), from.x_at(last_), from.y_at(last_)};
    const auto motion = [&] {
      Motion m{0, 0, (ends[2] - ends[0]) / (last_ - first_), (ends[3] - ends[1]) / (last_ - first_)};
      m.x = ends[0] - m.vx * first_, m.y = ends[1] - m.vy * first_;
      return m;
    };
    float best = stacked(motion()).significance();
    int climbs = 0;
    for (double step = 0.4 * widest_; step > 0.05 * widest_; step /= 2) {
      for (bool again = true; again && climbs < climbs_most;) {
        again = false;
        for (double& end : ends) {
          for (const double by : {-step, step}) {
            end += by;
            const float s = stacked(motion()).significance();
            ++climbs;
            if (s > best)
              best = s, again = true;
            else
              end -= by;
          }
        }
      }
      climbs = 0;
    }
    return {motion(), best};
  }

  // --- objects ---

  [[nodiscard]] std::vector<Tracklet> best_of(std::vector<Candidate>& candidates) const {
    std::sort(candidates.begin(), candidates.end(),
              [](const Candidate& a, const Candidate& b) { return a.significance > b.significance; });
    std::vector<Tracklet> objects;
    std::vector<Motion> kept;
    for (const Candidate& c : candidates) {
      if (objects.size() >= objects_most) break;
      if (std::any_of(kept.begin(), kept.end(), [&](const Motion& m) { return shares_light(c.motion, m); }))
        continue;
      auto object = object_of(c.motion);
      if (!object) continue;
      kept.push_back(c.motion);
      objects.push_back(*std::move(object));
    }
    return objects;
  }

  /// Two that cross each other are in the same place in one frame or two.
  [[nodiscard]] bool shares_light(const Motion& a, const Motion& b) const {
    std::size_t same = 0;
    for (const double t : times_)
      same += std::hypot(a.x_at(t) - b.x_at(t), a.y_at(t) - b.y_at(t)) < 1.5 * widest_ + 1;
    return same >= 3;
  }

  /// On the sky and on the detector: a seed beside what stands there may settle on it.
  [[nodiscard]] bool moves(const Motion& m) const {
    if (std::hypot(m.vx, m.vy) * (last_ - first_) < moved_least()) return false;
    double left = 0, right = 0, top = 0, bottom = 0;
    for (std::size_t k = 0; k < used_.size(); ++k) {
      const double u = m.x_at(times_[k]);
      const double v = m.y_at(times_[k]);
      const double x = to_frame_[k].x(u, v);
      const double y = to_frame_[k].y(u, v);
      left = k == 0 ? x : std::min(left, x), right = k == 0 ? x : std::max(right, x);
      top = k == 0 ? y : std::min(top, y), bottom = k == 0 ? y : std::max(bottom, y);
    }
    return std::hypot(right - left, bottom - top) >= moved_least();
  }

  /// Without what stands where it passes.
  [[nodiscard]] std::optional<float> own_light(std::size_t k, const Motion& m) const {
    const double x = m.x_at(times_[k]);
    const double y = m.y_at(times_[k]);
    const auto v = sample(k, x, y);
    if (!v) return std::nullopt;
    std::vector<float> others;
    for (std::size_t i = 0; i < used_.size(); ++i) {
      if (std::hypot(m.x_at(times_[i]) - x, m.y_at(times_[i]) - y) < 2 * widest_) continue;
      if (const auto other = sample(i, x, y)) others.push_back(*other);
    }
    const float standing = others.size() > 2 ? std::max(0.0F, median_of(others)) : 0.0F;
    return standing > standing_most ? *v - standing : *v;
  }

  /// Judged by all frames: seen in most of them, beyond what chance makes of so many pairs without the two
  /// brightest.
  [[nodiscard]] std::optional<Tracklet> object_of(const Motion& m) const {
    if (!moves(m)) return std::nullopt;
    std::vector<float> values;
    std::size_t lit = 0;
    for (std::size_t k = 0; k < used_.size(); ++k) {
      const auto v = own_light(k, m);
      if (!v) continue;
      values.push_back(std::min(*v, frame_most));
      lit += *v > seen_least;
    }
    if (values.size() < std::max<std::size_t>(frames_least, used_.size() / 2) ||
        static_cast<double>(lit) < seen_share * static_cast<double>(values.size()))
      return std::nullopt;
    std::sort(values.begin(), values.end());
    double sum = 0;
    for (std::size_t i = 0; i + 2 < values.size(); ++i) sum += double(values[i]);
    const double rest = sum / std::sqrt(static_cast<double>(values.size() - 2));
    sum += double(values[values.size() - 1]) + double(values[values.size() - 2]);
    const double snr = sum / std::sqrt(static_cast<double>(values.size()));
    const double chance = 0.5 * std::erfc(rest / std::numbers::sqrt2) * pairs_ * places_of_pair;
    if (snr < options_.snr_least || chance > chance_most) return std::nullopt;
    return tracklet_of(m, snr);
  }

  [[nodiscard]] Tracklet tracklet_of(const Motion& m, double snr) const {
    Tracklet t{{}, m.x, m.y, m.vx, m.vy, snr, 0};
    double squares = 0;
    for (std::size_t k = 0; k < used_.size(); ++k) {
      const auto peak = peak_near(k, m.x_at(times_[k]), m.y_at(times_[k]));
      if (!peak) continue;
      const FaintLight& of = light_[used_[k]];
      t.points.push_back({static_cast<int>(used_[k]), peak->frame_x, peak->frame_y, double(peak->value),
                          std::nullopt, double(peak->value) * of.flux_of_noise, of.fwhm_px});
      squares += std::pow(peak->x - m.x_at(times_[k]), 2) + std::pow(peak->y - m.y_at(times_[k]), 2);
    }
    t.rms_px = std::sqrt(squares / (2 * static_cast<double>(std::max<std::size_t>(1, t.points.size()))));
    return t;
  }

  /// The brightest point less than half a star's width from a place; nothing where that is none.
  [[nodiscard]] std::optional<Seed> peak_near(std::size_t k, double u, double v) const {
    const Grid<std::int8_t>& l = light(k);
    const double x = to_frame_[k].x(u, v);
    const double y = to_frame_[k].y(u, v);
    const double r = std::max(1.0, 0.5 * widest_);
    std::optional<Seed> best;
    for (int j = static_cast<int>(std::ceil(y - r)); j <= static_cast<int>(y + r); ++j) {
      for (int i = static_cast<int>(std::ceil(x - r)); i <= static_cast<int>(x + r); ++i) {
        if (i < 1 || j < 1 || i + 1 >= l.width() || j + 1 >= l.height()) continue;
        if (std::hypot(i - x, j - y) > r || !is_peak(l, i, j)) continue;
        const Seed seed = seed_at(k, i, j);
        if (double(seed.value) > (best ? double(best->value) : point_least)) best = seed;
      }
    }
    return best;
  }

  const std::vector<FaintLight>& light_;
  const SequenceFindings& found_;
  const FaintOptions& options_;
  std::vector<std::size_t> used_;  ///< frames that are registered
  std::vector<double> times_;      ///< of those
  std::vector<ToFrame> to_frame_;
  double first_ = 0;
  double last_ = 0;
  double interval_ = 1;
  double widest_ = 1;  ///< FWHM, px
  std::vector<std::vector<Seed>> seeds_;
  std::vector<PlaceIndex> places_;
  double pairs_ = 0;
};

}  // namespace

FaintLight faint_light(const CleanFrame& clean, const StarField& field, const std::vector<bool>& known) {
  FaintLight of_frame;
  of_frame.fwhm_px = clean.psf.fwhm_px();
  Plane light = field.residual;
  Grid<std::uint8_t> hidden = field.masked;
  for (std::size_t i = 0; i < hidden.size(); ++i) hidden.cells()[i] |= clean.flaws.cells()[i];
  std::vector<float> fluxes;
  for (std::size_t i = 0; i < field.stars.size(); ++i) {
    const Star& s = field.stars[i];
    const double height = s.flux / clean.psf.flux() / double(clean.noise_adu.at(s.x, s.y));
    if (s.snr > 0 && s.snr < 30) fluxes.push_back(static_cast<float>(s.flux / s.snr));
    if (i < known.size() && known[i]) continue;
    if (s.snr < faint_star)
      add_star(clean.psf, static_cast<float>(height), s.x, s.y, light);
    else
      for_star_core(
          clean.psf, height, s.x, s.y, hidden.width(), hidden.height(),
          [&](int from, int end, int y) { std::fill(hidden.row(y) + from, hidden.row(y) + end, 1); });
  }
  if (!fluxes.empty()) of_frame.flux_of_noise = double(median_of(fluxes));
  Plane filtered;
  gaussian_filter(light, clean.psf.sigma_px(), filtered, &hidden);
  const SkyLevel sky = measure_flattened(filtered, &hidden);
  of_frame.light = Grid<std::int8_t>::unset(light.width(), light.height());
  std::vector<float> noise(static_cast<std::size_t>(light.width()));
  std::vector<float> level(noise.size());
  for (int y = 0; y < light.height(); ++y) {
    if (y % noise_rows == 0) {
      const int middle = std::min(light.height() - 1, y + noise_rows / 2);
      sky.noise.row(middle, noise);
      sky.level.row(middle, level);
    }
    const float* from = filtered.row(y);
    const std::uint8_t* mask = hidden.row(y);
    std::int8_t* to = of_frame.light.row(y);
    for (int x = 0; x < light.width(); ++x) {
      const auto i = static_cast<std::size_t>(x);
      const float v = faint_units * (from[x] - level[i]) / std::max(0.5F, noise[i]);
      const float clipped = v > -127 ? std::min(v, 127.0F) : -127.0F;  // not a number: nothing
      to[x] =
          mask[x] != 0 ? faint_hidden : static_cast<std::int8_t>(static_cast<int>(clipped + 127.5F) - 127);
    }
  }
  return of_frame;
}

std::vector<Tracklet> find_faint(const std::vector<FaintLight>& light, const std::vector<double>& times,
                                 const SequenceFindings& found, const FaintOptions& options) {
  return Search(light, times, found, options).run();
}

}  // namespace srfs::image
