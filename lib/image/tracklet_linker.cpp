// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "image/tracklet_linker.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>

#include <fmt/format.h>

#include "image/place_index.hpp"

namespace srfs::image {
namespace {

/// Of one frame at most so many detections are linked, the most significant.
constexpr std::size_t movers_most = 3000;
constexpr std::size_t tracklets_most = 1000;
/// So many tracklets like one that is kept would be found in a sequence of noise.
constexpr double chance_most = 0.02;
/// A streak whose light the stars of other frames show at its place, to this share, stands still.
constexpr double standing_share = 0.4;

/// Shorter ones are seen as stars, whole or in pieces.
constexpr double shortest_streak = 20;

/// What leaves a streak may be so much faster than what is seen as a point.
constexpr double streak_speed = 4;

/// A detection that may move. Place: (x, y) among the stars, in the reference frame's pixels.
struct Mover {
  double x;
  double y;
  int frame;
  double snr;
  double frame_x;
  double frame_y;
  const Streak* streak;
  double angle;  ///< of the streak, among the stars
  bool used = false;
  const Star* star = nullptr;
};

struct Track {
  double x, y, vx, vy;  ///< at time 0
  double rms = 0;
  [[nodiscard]] double x_at(double t) const { return x + vx * t; }
  [[nodiscard]] double y_at(double t) const { return y + vy * t; }
};

/// Stars of all frames, among the stars: where they stand still.
struct Sky {
  std::vector<PlaceIndex> stars;  ///< of each frame, in the reference frame's pixels
  std::vector<PlaceIndex> on_detector;
};

class Linker {
 public:
  Linker(const std::vector<FrameDetections>& frames, const LinkOptions& options)
      : frames_(frames), options_(options) {}

  SequenceFindings run() {
    found_.streaks.resize(frames_.size());
    found_.registrations.resize(frames_.size());
    for (std::size_t k = 0; k < frames_.size(); ++k) found_.streaks[k] = frames_[k].streaks;
    register_frames();
    if (used_.size() < 2) {
      found_.notes.emplace_back("fewer than two frames with the same stars: nothing to link");
      return std::move(found_);
    }
    time_frames();
    index_sky();
    drop_standing_streaks();
    collect_movers();
    if (known_stars_ > 0)
      found_.notes.push_back(fmt::format(
          "{} detections that moved among the frames are stars of the catalogue: left out", known_stars_));
    const std::size_t n = used_.size();
    hits_least_ =
        n >= 8 ? static_cast<std::size_t>(options_.hits_least) : std::max<std::size_t>(3, (5 * n + 7) / 8);
    if (n >= 3) link();
    return std::move(found_);
  }

 private:
  void register_frames() {
    const auto most_stars =
        std::max_element(frames_.begin(), frames_.end(),
                         [](const auto& a, const auto& b) { return a.stars.size() < b.stars.size(); });
    // The first frame with about as many stars as the best: not one that was dark or blurred.
    std::size_t reference = 0;
    while (2 * frames_[reference].stars.size() < most_stars->stars.size()) ++reference;
    found_.reference = static_cast<int>(reference);
    const FrameDetections& of = frames_[reference];
    for (std::size_t k = 0; k < frames_.size(); ++k) {
      FrameRegistration& result = found_.registrations[k];
      if (k == reference) {
        result.registered = true;
        result.registration.stars = static_cast<int>(of.stars.size());
      } else if (const auto found = register_stars(bright(frames_[k]), bright(of), of.width, of.height)) {
        result.registered = true;
        result.registration = *found;
      } else {
        found_.notes.push_back(
            fmt::format("frame {} has too few stars in common with frame {}: left out", k, reference));
        continue;
      }
      used_.push_back(k);
    }
  }

  [[nodiscard]] static std::vector<Star> bright(const FrameDetections& frame) {
    std::vector<Star> stars;
    for (const Star& s : frame.stars) {
      if (s.snr > 6) stars.push_back(s);
    }
    return stars;
  }

  /// In seconds where every frame says when it was taken, and all at different times; else in frames.
  void time_frames() {
    found_.timed =
        std::all_of(used_.begin(), used_.end(), [&](std::size_t k) { return frames_[k].time_s.has_value(); });
    std::vector<double> times;
    for (const std::size_t k : used_)
      times.push_back(found_.timed ? *frames_[k].time_s : static_cast<double>(k));
    std::vector<double> sorted = times;
    std::sort(sorted.begin(), sorted.end());
    if (std::adjacent_find(sorted.begin(), sorted.end()) != sorted.end()) {
      found_.timed = false;
      for (std::size_t i = 0; i < used_.size(); ++i) times[i] = static_cast<double>(used_[i]);
    }
    const auto reference = static_cast<std::size_t>(
        std::find(used_.begin(), used_.end(), static_cast<std::size_t>(found_.reference)) - used_.begin());
    const double zero = times[reference];
    for (double& t : times) t -= zero;
    times_ = std::move(times);
    interval_ =
        (*std::max_element(times_.begin(), times_.end()) - *std::min_element(times_.begin(), times_.end())) /
        static_cast<double>(times_.size() - 1);
  }

  [[nodiscard]] const FrameTransform& transform(std::size_t i) const {
    return found_.registrations[used_[i]].registration.to_reference;
  }
  [[nodiscard]] const FrameDetections& frame(std::size_t i) const { return frames_[used_[i]]; }

  void index_sky() {
    for (std::size_t i = 0; i < used_.size(); ++i) {
      std::vector<FrameTransform::Point> places;
      for (const Star& s : frame(i).stars) places.push_back(transform(i)(s.x, s.y));
      sky_.stars.emplace_back(places);
      sky_.on_detector.emplace_back(frame(i).stars);
      widest_ = std::max(widest_, frame(i).fwhm_px);
    }
  }

  /// In how many other frames something is at this place among the stars.
  [[nodiscard]] std::size_t standing(std::size_t i, double x, double y) const {
    const double reach = std::max(1.0, 0.4 * widest_);
    std::size_t n = 0;
    for (std::size_t j = 0; j < used_.size(); ++j) {
      bool any = false;
      if (j != i) sky_.stars[j].near(x, y, reach, [&](std::size_t, double) { any = true; });
      n += any;
    }
    return n;
  }

  /// In how many other frames, with another part of the sky before it, something is at this place of the
  /// detector.
  [[nodiscard]] std::size_t on_detector(std::size_t i, double x, double y) const {
    std::size_t n = 0;
    const auto [sky_x, sky_y] = transform(i)(x, y);
    for (std::size_t j = 0; j < used_.size(); ++j) {
      if (j == i) continue;
      const auto [other_x, other_y] = transform(j)(x, y);
      if (std::hypot(other_x - sky_x, other_y - sky_y) < 2) continue;
      bool any = false;
      sky_.on_detector[j].near(x, y, 0.7, [&](std::size_t, double) { any = true; });
      n += any;
    }
    return n;
  }

  /// How many other frames make a detection one that stands still.
  [[nodiscard]] std::size_t standing_least() const { return used_.size() >= 5 ? 2 : 1; }

  /// Stars that touch look like a short streak, in every frame.
  void drop_standing_streaks() {
    for (std::size_t i = 0; i < used_.size(); ++i)
      std::erase_if(found_.streaks[used_[i]], [&](const Streak& s) { return stands_still(i, s); });
  }

  [[nodiscard]] bool stands_still(std::size_t i, const Streak& s) const {
    const auto [x1, y1] = transform(i)(s.x1, s.y1);
    const auto [x2, y2] = transform(i)(s.x2, s.y2);
    std::size_t seen = 0;
    std::size_t lit = 0;
    for (std::size_t j = 0; j < used_.size(); ++j) {
      if (j == i) continue;
      const auto a = transform(j).inverse(x1, y1);
      const auto b = transform(j).inverse(x2, y2);
      const FrameDetections& other = frame(j);
      const auto inside = [&](const auto& p) {
        return p.x > 0 && p.y > 0 && p.x < other.width - 1 && p.y < other.height - 1;
      };
      if (!inside(a) || !inside(b)) continue;
      ++seen;
      lit += light_along(j, a.x, a.y, b.x, b.y) > standing_share * s.flux;
    }
    return seen > 0 && 2 * lit >= seen;
  }

  /// Light of the stars and of the parts of streaks of a frame that lie along a line.
  [[nodiscard]] double light_along(std::size_t j, double x1, double y1, double x2, double y2) const {
    const double length = std::max(1e-6, std::hypot(x2 - x1, y2 - y1));
    const double ux = (x2 - x1) / length;
    const double uy = (y2 - y1) / length;
    const double across_most = 0.8 * frame(j).fwhm_px + 0.5;
    const double beyond = 0.7 * frame(j).fwhm_px;
    const auto on_line = [&](double x, double y) {
      const double t = (x - x1) * ux + (y - y1) * uy;
      return std::abs((y - y1) * ux - (x - x1) * uy) < across_most && t > -beyond && t < length + beyond;
    };
    double light = 0;
    sky_.on_detector[j].near((x1 + x2) / 2, (y1 + y2) / 2, length / 2 + across_most + beyond,
                             [&](std::size_t k, double) {
                               const Star& s = frame(j).stars[k];
                               if (on_line(s.x, s.y)) light += s.flux;
                             });
    for (const Streak& s : frame(j).streaks) {
      constexpr int parts = 20;
      for (int k = 0; k < parts; ++k) {
        const double share = (k + 0.5) / parts;
        if (on_line(s.x1 + share * (s.x2 - s.x1), s.y1 + share * (s.y2 - s.y1))) light += s.flux / parts;
      }
    }
    return light;
  }

  void collect_movers() {
    movers_.resize(used_.size());
    for (std::size_t i = 0; i < used_.size(); ++i) {
      std::vector<Mover>& of_frame = movers_[i];
      for (const Streak& s : found_.streaks[used_[i]]) {
        const double x = (s.x1 + s.x2) / 2;
        const double y = (s.y1 + s.y2) / 2;
        const auto place = transform(i)(x, y);
        const auto end = transform(i)(s.x2, s.y2);
        of_frame.push_back({place.x, place.y, static_cast<int>(i), s.snr, x, y, &s,
                            std::atan2(end.y - place.y, end.x - place.x)});
      }
      const std::vector<bool>& known = frame(i).is_known_star;
      for (std::size_t n = 0; n < frame(i).stars.size(); ++n) {
        const Star& s = frame(i).stars[n];
        const auto place = transform(i)(s.x, s.y);
        if (standing(i, place.x, place.y) >= standing_least() || on_detector(i, s.x, s.y) >= standing_least())
          continue;
        if (n < known.size() && known[n]) {
          ++known_stars_;
          continue;
        }
        of_frame.push_back({place.x, place.y, static_cast<int>(i), s.snr, s.x, s.y, nullptr, 0, false, &s});
      }
      if (of_frame.size() > movers_most) {
        std::nth_element(of_frame.begin(), of_frame.begin() + movers_most, of_frame.end(),
                         [](const Mover& a, const Mover& b) { return a.snr > b.snr; });
        of_frame.resize(movers_most);
      }
      places_.emplace_back(of_frame);
      Significances& significances = significances_.emplace_back();
      for (const Mover& m : of_frame)
        (m.streak != nullptr ? significances.streaks : significances.points).push_back(m.snr);
      std::sort(significances.points.begin(), significances.points.end());
      std::sort(significances.streaks.begin(), significances.streaks.end());
    }
  }

  /// How many detections as significant as this one its frame has.
  [[nodiscard]] double rivals(const Mover& m) const {
    const Significances& of_frame = significances_[static_cast<std::size_t>(m.frame)];
    const std::vector<double>& all = m.streak != nullptr ? of_frame.streaks : of_frame.points;
    return static_cast<double>(all.end() - std::lower_bound(all.begin(), all.end(), m.snr));
  }

  /// Share of all directions that a detection on a track may have.
  [[nodiscard]] double direction_share(const Mover& m) const {
    return m.streak == nullptr ? 1 : std::min(1.0, 2 * turn_most(m) / std::numbers::pi);
  }

  /// How many tracklets with as many hits, each as significant, the detections of the frames would make by
  /// chance, had they no order.
  [[nodiscard]] double made_by_chance(const std::vector<std::pair<std::size_t, std::size_t>>& hits) const {
    const auto n = static_cast<double>(used_.size());
    const auto h = static_cast<double>(hits.size());
    double log_chance = std::lgamma(n + 1) - std::lgamma(h + 1) - std::lgamma(n - h + 1);
    for (std::size_t i = 0; i < hits.size(); ++i) {
      const auto& [f, k] = hits[i];
      const Mover& m = movers_[f][k];
      log_chance += std::log(rivals(m) * direction_share(m));
      if (i == 0) continue;
      // The last one is anywhere in reach of the first; the others are where these two say.
      const bool last = i + 1 == hits.size();
      const double radius = last ? reach(m, times_[f] - times_[hits.front().first]) : tolerance(m);
      const double area = static_cast<double>(frame(f).width) * static_cast<double>(frame(f).height);
      log_chance += std::log(std::min(1.0, std::numbers::pi * radius * radius / area));
    }
    return std::exp(log_chance);
  }

  /// How far a detection may have moved in a time.
  [[nodiscard]] double reach(const Mover& m, double dt) const {
    return (m.streak != nullptr ? streak_speed : 1) * options_.speed_most * std::abs(dt) / interval_;
  }

  /// Every pair of detections that are far apart in time is a track; the best ones that others lie on are
  /// kept.
  void link() {
    struct Candidate {
      Track track;
      std::vector<std::pair<std::size_t, std::size_t>> hits;  ///< frame, mover
      double snr;
    };
    std::vector<Candidate> candidates;
    const std::size_t n = used_.size();
    // Of hits_least_ hits in n frames two are at least so many frames apart, the first of them not later than
    // this.
    const std::size_t apart = hits_least_ - 1;
    for (std::size_t i = 0; i + apart < n; ++i) {
      for (std::size_t j = i + apart; j < n; ++j) {
        const double dt = times_[j] - times_[i];
        for (const Mover& a : movers_[i]) {
          places_[j].near(a.x, a.y, reach(a, dt), [&](std::size_t k, double distance) {
            const Mover& b = movers_[j][k];
            if (distance > reach(b, dt)) return;
            Track track;
            track.vx = (b.x - a.x) / dt, track.vy = (b.y - a.y) / dt;
            track.x = a.x - track.vx * times_[i], track.y = a.y - track.vy * times_[i];
            if (!goes_along(a, track) || !goes_along(b, track)) return;
            Candidate c{track, {}, 0};
            if (settle(c.track, c.hits, c.snr)) candidates.push_back(std::move(c));
          });
        }
        keep_best(candidates);
      }
    }
    std::sort(candidates.begin(), candidates.end(),
              [](const Candidate& a, const Candidate& b) { return a.snr > b.snr; });
    std::vector<Kept> kept;
    for (Candidate& c : candidates) {
      // What a better one has used is not there any more.
      std::erase_if(c.hits, [&](const auto& h) { return movers_[h.first][h.second].used; });
      if (c.hits.size() < hits_least_ || found_.tracklets.size() >= tracklets_most) continue;
      double squares = 0;
      for (const auto& [f, m] : c.hits) squares += movers_[f][m].snr * movers_[f][m].snr;
      if (std::sqrt(squares) < options_.snr_least || made_by_chance(c.hits) > chance_most) continue;
      if (std::any_of(kept.begin(), kept.end(), [&](const Kept& k) { return is_piece(c.track, k); }))
        continue;
      kept.push_back({c.track, trail_of(c.hits)});
      for (const auto& [f, m] : c.hits) movers_[f][m].used = true;
      add(c.track, c.hits, std::sqrt(squares));
    }
  }

  /// A tracklet that was kept.
  struct Kept {
    Track track;
    double trail;  ///< px that it moves while a frame is exposed, at most
  };

  [[nodiscard]] double trail_of(const std::vector<std::pair<std::size_t, std::size_t>>& hits) const {
    double longest = shortest_streak;
    for (const auto& [f, k] : hits) {
      const Streak* streak = movers_[f][k].streak;
      if (streak != nullptr) longest = std::max(longest, streak->length_px());
    }
    return longest;
  }

  /// Whether a track follows one that was kept all the time, not farther away along it than its trail is
  /// long: a short streak is seen as two stars here and there.
  [[nodiscard]] bool is_piece(const Track& track, const Kept& of) const {
    const double vx = of.track.vx;
    const double vy = of.track.vy;
    const double speed = std::hypot(vx, vy);
    if (!(speed > 0)) return false;
    const double along_most = std::min(speed * interval_, of.trail + widest_);
    const auto near = [&](double t) {
      const double dx = track.x_at(t) - of.track.x_at(t);
      const double dy = track.y_at(t) - of.track.y_at(t);
      return std::abs(dy * vx - dx * vy) < (1 + 1.5 * widest_) * speed &&
             std::abs(dx * vx + dy * vy) < along_most * speed;
    };
    const auto [first, last] = std::minmax_element(times_.begin(), times_.end());
    return near(*first) && near(*last);
  }

  template <class Candidates>
  static void keep_best(Candidates& candidates) {
    constexpr std::size_t most = 20 * tracklets_most;
    if (candidates.size() <= most) return;
    std::nth_element(candidates.begin(), candidates.begin() + most / 2, candidates.end(),
                     [](const auto& a, const auto& b) { return a.snr > b.snr; });
    candidates.resize(most / 2);
  }

  /// A streak lies along its motion.
  [[nodiscard]] bool goes_along(const Mover& m, const Track& track) const {
    if (m.streak == nullptr) return true;
    double turn = std::abs(m.angle - std::atan2(track.vy, track.vx));
    turn = std::fmod(turn, std::numbers::pi);
    turn = std::min(turn, std::numbers::pi - turn);
    return turn < turn_most(m);
  }

  /// @pre it is a streak
  [[nodiscard]] double turn_most(const Mover& m) const {
    return 0.1 + widest_ / std::max(m.streak->length_px(), 1.0);
  }

  /// How far from its place a detection may be found.
  [[nodiscard]] double tolerance(const Mover& m) const {
    const double along = m.streak == nullptr ? 0 : 0.1 * m.streak->length_px();
    return 0.5 + 1.3 * widest_ / std::max(3.0, m.snr) + along;
  }

  /// Gathers what lies on a track and fits it to that, twice. @return whether it is a tracklet
  bool settle(Track& track, std::vector<std::pair<std::size_t, std::size_t>>& hits, double& snr) const {
    for (int round = 0; round < 2; ++round) {
      hits.clear();
      for (std::size_t i = 0; i < used_.size(); ++i) {
        std::size_t best = 0;
        double best_snr = 0;
        // The first time the two that made it stand for all: their errors count too.
        places_[i].near(track.x_at(times_[i]), track.y_at(times_[i]), 0.5 + 0.5 * widest_ + 3,
                        [&](std::size_t k, double distance) {
                          const Mover& m = movers_[i][k];
                          if (distance > (round == 0 ? 1.4 : 1.0) * tolerance(m) || !goes_along(m, track) ||
                              m.snr < best_snr)
                            return;
                          best = k;
                          best_snr = m.snr;
                        });
        if (best_snr > 0) hits.emplace_back(i, best);
        // As many as are missing already cannot come any more.
        if (hits.size() + used_.size() - i - 1 < hits_least_) return false;
      }
      if (hits.size() < hits_least_) return false;
      fit(track, hits);
    }
    double squares = 0;
    for (const auto& [i, k] : hits) squares += movers_[i][k].snr * movers_[i][k].snr;
    snr = std::sqrt(squares);
    const double moved =
        std::hypot(track.vx, track.vy) * std::abs(times_[hits.back().first] - times_[hits.front().first]);
    return snr >= options_.snr_least && moved > std::max(3.0, 1.5 * widest_);
  }

  void fit(Track& track, const std::vector<std::pair<std::size_t, std::size_t>>& hits) const {
    double w = 0, t = 0, tt = 0, x = 0, y = 0, tx = 0, ty = 0;
    for (const auto& [i, k] : hits) {
      const Mover& m = movers_[i][k];
      const double weight = 1 / (tolerance(m) * tolerance(m));
      w += weight, t += weight * times_[i], tt += weight * times_[i] * times_[i];
      x += weight * m.x, y += weight * m.y, tx += weight * times_[i] * m.x, ty += weight * times_[i] * m.y;
    }
    const double det = w * tt - t * t;
    if (!(det > 0)) return;
    track.vx = (w * tx - t * x) / det, track.vy = (w * ty - t * y) / det;
    track.x = (x - track.vx * t) / w, track.y = (y - track.vy * t) / w;
    double squares = 0;
    for (const auto& [i, k] : hits) {
      const Mover& m = movers_[i][k];
      squares += std::pow(m.x - track.x_at(times_[i]), 2) + std::pow(m.y - track.y_at(times_[i]), 2);
    }
    track.rms = std::sqrt(squares / (2 * static_cast<double>(hits.size())));
  }

  void add(const Track& track, const std::vector<std::pair<std::size_t, std::size_t>>& hits, double snr) {
    Tracklet t{{}, track.x, track.y, track.vx, track.vy, snr, track.rms};
    for (const auto& [i, k] : hits) {
      const Mover& m = movers_[i][k];
      t.points.push_back({static_cast<int>(used_[i]), m.frame_x, m.frame_y, m.snr,
                          m.streak != nullptr ? std::optional(*m.streak) : std::nullopt,
                          m.star != nullptr ? m.star->flux : 0, m.star != nullptr ? m.star->fwhm_px : 0});
    }
    found_.tracklets.push_back(std::move(t));
  }

  const std::vector<FrameDetections>& frames_;
  const LinkOptions& options_;
  SequenceFindings found_;
  std::vector<std::size_t> used_;  ///< frames that are registered, in order
  std::vector<double> times_;      ///< of those, from the reference frame's
  double interval_ = 1;            ///< between two of them, mean
  double widest_ = 1;              ///< FWHM of the stars, px
  Sky sky_;
  std::vector<std::vector<Mover>> movers_;
  std::vector<PlaceIndex> places_;  ///< of the movers
  struct Significances {
    std::vector<double> points;   ///< ascending
    std::vector<double> streaks;  ///< the same
  };
  std::vector<Significances> significances_;  ///< of the movers of each frame
  std::size_t hits_least_ = 3;
  std::size_t known_stars_ = 0;  ///< detections that seem to move, and are stars of the catalogue
};

}  // namespace

SequenceFindings link_tracklets(const std::vector<FrameDetections>& frames, const LinkOptions& options) {
  if (frames.empty()) return {};
  return Linker(frames, options).run();
}

}  // namespace srfs::image
