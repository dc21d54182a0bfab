// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "image/plate_solver.hpp"

#include <algorithm>
#include <cmath>
#include <mutex>
#include <numbers>
#include <numeric>
#include <optional>

#include <fmt/format.h>
#include <Eigen/Dense>

namespace srfs::image {
namespace {

using Eigen::Matrix3d;
using Eigen::Vector2d;
using Eigen::Vector3d;

constexpr double rad_per_deg = std::numbers::pi / 180;
constexpr double arcsec_per_rad = 180 * 3600 / std::numbers::pi;

/// How far around a star its pattern reaches: for frames three times as wide.
constexpr std::array wide_radii_deg{1.7, 3.0, 5.5, 10.0};
constexpr std::array narrow_radii_deg{0.5, 0.9};
/// Patterns start at the brightest star of every cell of this share of the radius.
constexpr double anchor_cell = 0.75;

constexpr std::size_t anchors_most = 30;  ///< of a frame
constexpr std::size_t judged_most = 60;   ///< brightest stars that an attitude has to explain
constexpr std::size_t fitted_most = 300;
constexpr double apart_least = 0.01;  ///< over half the diagonal
/// Chance of an attitude that is believed, all trials together.
constexpr double chance_most = 1e-7;
constexpr std::size_t agreeing_least = 7;
constexpr double reach_px = 3;  ///< of a first attitude's predictions
constexpr double reach_least_px = 0.7;
/// Stars around a pattern that a first attitude has to explain: a lens bends little over them.
constexpr std::size_t around_least = 15;
constexpr std::size_t around_most = 40;
constexpr double chance_of_first = 1e-3;
constexpr double growth = 1.3;  ///< of their number from fit to fit
constexpr double reach_of_growth =
    0.004;  ///< over half the diagonal: what the lens bends beyond the last fit
constexpr int best_fits = 4;
constexpr double fwhm_per_sigma = 2.3548;
constexpr double sure_px = 0.3;  ///< rms of a lens that need not be searched again
/// Parameters of a camera, in stars that are explained by chance at least.
constexpr std::size_t stars_of_pattern = 4;
constexpr std::size_t stars_of_lens = 2;
/// Of what a first focal length says of the field, for distortion.
constexpr double field_slack = 1.15;
/// In wide frames, and behind a lens with distortion, a pattern's shape depends on where it is.
struct Assumption {
  double field_deg;  ///< 0: narrow enough not to matter
  double k1;
};
constexpr std::array assumptions{Assumption{0, 0},      Assumption{30, 0},    Assumption{50, 0},
                                 Assumption{0, 0.03},   Assumption{0, -0.03}, Assumption{30, 0.03},
                                 Assumption{30, -0.03}, Assumption{50, 0.03}, Assumption{50, -0.03}};

/// A shape and the order of its stars.
struct Shape {
  std::array<float, 4> code;
  std::array<std::uint8_t, 4> order;
};

std::optional<Shape> shape_of(const std::array<Vector2d, 4>& p, bool mirrored) {
  std::size_t a = 0;
  std::size_t b = 1;
  double longest = 0;
  for (std::size_t i = 0; i < 4; ++i) {
    for (std::size_t j = i + 1; j < 4; ++j) {
      const double d = (p[i] - p[j]).squaredNorm();
      if (d > longest) longest = d, a = i, b = j;
    }
  }
  if (!(longest > 0)) return std::nullopt;
  std::array<std::size_t, 2> rest{};
  std::size_t n = 0;
  for (std::size_t i = 0; i < 4; ++i) {
    if (i != a && i != b) rest[n++] = i;
  }
  const Vector2d axis = (p[b] - p[a]) / longest;
  const double side = mirrored ? -1 : 1;
  const auto place = [&](std::size_t i) {
    const Vector2d d = p[i] - p[a];
    return Vector2d(d.dot(axis), side * (axis.x() * d.y() - axis.y() * d.x()));
  };
  Vector2d c = place(rest[0]);
  Vector2d d = place(rest[1]);
  if (c.x() + d.x() > 1) {
    c = Vector2d(1, 0) - c;
    d = Vector2d(1, 0) - d;
    std::swap(a, b);
  }
  if (c.x() > d.x()) {
    std::swap(c, d);
    std::swap(rest[0], rest[1]);
  }
  return Shape{{static_cast<float>(c.x()), static_cast<float>(c.y()), static_cast<float>(d.x()),
                static_cast<float>(d.y())},
               {static_cast<std::uint8_t>(a), static_cast<std::uint8_t>(b),
                static_cast<std::uint8_t>(rest[0]), static_cast<std::uint8_t>(rest[1])}};
}

/// Calls use(i, j, k) for all three of n.
template <class Use>
void for_threes(std::size_t n, Use&& use) {
  for (std::size_t i = 0; i < n; ++i) {
    for (std::size_t j = i + 1; j < n; ++j) {
      for (std::size_t k = j + 1; k < n; ++k) use(i, j, k);
    }
  }
}

/// The rotation that takes the second directions to the first ones best (Wahba's problem).
Matrix3d rotation_between(const Matrix3d& products) {
  const Eigen::JacobiSVD<Matrix3d> svd(products, Eigen::ComputeFullU | Eigen::ComputeFullV);
  Matrix3d sign = Matrix3d::Identity();
  sign(2, 2) = (svd.matrixU() * svd.matrixV().transpose()).determinant() < 0 ? -1 : 1;
  return svd.matrixU() * sign * svd.matrixV().transpose();
}

/// On the plane that touches the sky at @p middle, east and north.
Vector2d tangent_place(const Vector3d& middle, const Vector3d& direction) {
  return sky_axes(middle).transpose() * direction / direction.dot(middle);
}

/// Logarithm of the chance that at least @p hits of @p n agree when each does with chance @p p.
double log_chance(std::size_t n, std::size_t hits, double p) {
  const auto count = static_cast<double>(n);
  double sum = 0;
  for (std::size_t k = hits; k <= n; ++k) {
    const auto m = static_cast<double>(k);
    sum += std::exp(std::lgamma(count + 1) - std::lgamma(m + 1) - std::lgamma(count - m + 1) +
                    m * std::log(p) + (count - m) * std::log1p(-p));
  }
  return std::log(std::max(sum, 1e-300));
}

}  // namespace

double place_sigma_px(const Star& star) {
  // Of a Gaussian in noise of the sky.
  const double by_noise = star.snr > 0 ? std::numbers::sqrt2 * star.fwhm_px / (fwhm_per_sigma * star.snr) : 1;
  return std::hypot(place_floor_px, by_noise);
}

const PlateScales& wide_scales() {
  static constexpr PlateScales scales{8.5, wide_radii_deg, 6};
  return scales;
}

const PlateScales& narrow_scales() {
  static constexpr PlateScales scales{faintest_of_catalogue, narrow_radii_deg, 5};
  return scales;
}

PlateSolver::PlateSolver(const PlateScales& scales)
    : stars_([&] {
        const std::vector<CatalogueStar> catalogue = bright_stars(scales.faintest);
        std::vector<Direction> stars;
        stars.reserve(catalogue.size());
        for (const CatalogueStar& s : catalogue)
          stars.push_back({s.direction.cast<float>(), static_cast<float>(s.magnitude)});
        return stars;
      }()),
      sky_([&] {
        std::vector<Vector3d> directions;
        directions.reserve(stars_.size());
        for (const Direction& s : stars_) directions.push_back(s.direction.cast<double>());
        return SkyIndex(directions, scales.radii_deg.front() / 2 * rad_per_deg);
      }()) {
  for (const double radius_deg : scales.radii_deg) add_patterns(radius_deg * rad_per_deg, scales.neighbours);
  sort_by_bucket();
}

/// In place: every quad goes to the next free place of its bucket.
void PlateSolver::sort_by_bucket() {
  first_.assign(buckets + 1, 0);
  for (const Quad& q : quads_) ++first_[bucket_of(q) + 1];
  for (std::size_t i = 1; i < first_.size(); ++i) first_[i] += first_[i - 1];
  std::vector<std::uint32_t> next(first_.begin(), first_.end() - 1);
  for (std::size_t b = 0; b < buckets; ++b) {
    while (next[b] < first_[b + 1]) {
      const std::size_t wanted = bucket_of(quads_[next[b]]);
      if (wanted == b)
        ++next[b];
      else
        std::swap(quads_[next[b]], quads_[next[wanted]++]);
    }
  }
}

std::size_t PlateSolver::bucket_of(const Quad& quad) {
  std::array<int, 4> cells{};
  for (std::size_t k = 0; k < 4; ++k)
    cells[k] = static_cast<int>(std::floor(static_cast<float>(quad.code[k]) * code_unit / cell));
  return bucket_of(cells);
}

std::size_t PlateSolver::bucket_of(const std::array<int, 4>& cells) {
  std::uint64_t key = 0;
  for (const int c : cells) key = key * 128 + static_cast<std::uint64_t>(c + 64);
  return static_cast<std::size_t>((key * 0x9E3779B97F4A7C15ULL) >> 44) & (buckets - 1);
}

void PlateSolver::add_patterns(double radius_rad, std::size_t neighbours) {
  // The brightest star of each cell.
  std::vector<bool> has_brighter(stars_.size(), false);
  const double apart = anchor_cell * radius_rad;
  std::vector<std::size_t> near;
  for (std::size_t i = 0; i < stars_.size(); ++i) {
    if (has_brighter[i]) continue;
    near.clear();
    sky_.near(direction(i), radius_rad, [&](std::size_t k, double square) {
      if (k == i) return;
      near.push_back(k);
      if (square < apart * apart) has_brighter[k] = true;
    });
    // The catalogue's order is that of brightness.
    const auto n = std::min<std::size_t>(near.size(), neighbours);
    std::partial_sort(near.begin(), near.begin() + static_cast<std::ptrdiff_t>(n), near.end());
    const Vector3d middle = direction(i);
    std::array<Vector2d, neighbours_most> places;
    for (std::size_t k = 0; k < n; ++k) places[k] = tangent_place(middle, direction(near[k]));
    for_threes(n, [&](std::size_t a, std::size_t b, std::size_t c) {
      const std::array<std::size_t, 4> four{i, near[a], near[b], near[c]};
      const auto shape = shape_of({Vector2d(0, 0), places[a], places[b], places[c]}, false);
      if (!shape) return;
      Quad quad{};
      for (std::size_t k = 0; k < 4; ++k) {
        quad.code[k] = static_cast<std::int16_t>(std::lround(shape->code[k] / code_unit));
        quad.stars[k] = static_cast<std::uint32_t>(four[shape->order[k]]);
      }
      quads_.push_back(quad);
    });
  }
}

namespace {

bool is_finite(const Star& s) {
  return std::isfinite(s.x) && std::isfinite(s.y) && std::isfinite(s.flux) && std::isfinite(s.snr) &&
         std::isfinite(s.fwhm_px);
}

}  // namespace

/// One frame's search.
class PlateSearch {
 public:
  PlateSearch(const PlateSolver& solver, const std::vector<Star>& stars, int width, int height,
              const PlateOptions& options)
      : solver_(solver), options_(options), width_(width), height_(height) {
    std::vector<std::size_t> order;
    for (std::size_t i = 0; i < stars.size(); ++i) {
      if (is_finite(stars[i])) order.push_back(i);
    }
    std::stable_sort(order.begin(), order.end(),
                     [&](std::size_t a, std::size_t b) { return stars[a].flux > stars[b].flux; });
    for (const std::size_t i : order) {
      if (places_.size() == fitted_most) break;
      const Vector2d place(stars[i].x - (width - 1) / 2.0, stars[i].y - (height - 1) / 2.0);
      // A particle's track may be taken for a row of bright stars.
      const double apart = apart_least * corner_px();
      if (std::any_of(places_.begin(), places_.end(),
                      [&](const Vector2d& q) { return (q - place).squaredNorm() < apart * apart; }))
        continue;
      given_.push_back(i);
      places_.push_back(place);
      sigma_px_.push_back(place_sigma_px(stars[i]));
    }
  }

  std::optional<PlateSolution> run() {
    if (places_.size() < agreeing_least) return std::nullopt;
    const std::vector<std::size_t> anchors = choose_anchors();
    std::optional<PlateSolution> best;
    for (const Assumption& assumed : assumptions) {
      if (assumed.field_deg > options_.field_most_deg) continue;
      assume(assumed);
      auto found = try_anchors(anchors);
      if (!found) continue;
      // Another assumption may lead to a lens that explains more.
      if (found->fit.rms_px < sure_px) return found;
      if (!best || found->matches.size() > best->matches.size()) best = std::move(found);
    }
    return best;
  }

 private:
  static constexpr int trials_most = 60000;  ///< with each assumption

  void assume(const Assumption& assumed) {
    assumed_focal_px_ =
        assumed.field_deg > 0 ? width_ / 2.0 / std::tan(assumed.field_deg / 2 * rad_per_deg) : 0;
    assumed_k1_ = assumed.k1;
    trials_left_ = trials_most;
    straight_.clear();
    for (const Vector2d& p : places_)
      straight_.push_back(p * (1 + assumed.k1 * p.squaredNorm() / (corner_px() * corner_px())));
  }
  [[nodiscard]] double corner_px() const { return std::hypot(width_, height_) / 2; }

  /// The brightest stars, those near the middle first.
  [[nodiscard]] std::vector<std::size_t> choose_anchors() const {
    std::vector<std::size_t> anchors;
    for (std::size_t i = 0; i < std::min(places_.size(), anchors_most); ++i) anchors.push_back(i);
    std::stable_sort(anchors.begin(), anchors.end(), [&](std::size_t a, std::size_t b) {
      return places_[a].squaredNorm() < places_[b].squaredNorm();
    });
    return anchors;
  }

  [[nodiscard]] std::optional<PlateSolution> try_anchors(const std::vector<std::size_t>& anchors) {
    // From the middle of what is likely outwards.
    for (const double share : {0.24, 0.3, 0.19, 0.375, 0.15, 0.47, 0.12, 0.59, 0.095, 0.73}) {
      for (const std::size_t anchor : anchors) {
        if (auto found = try_anchor(anchor, share * width_)) return found;
        if (trials_left_ <= 0) return std::nullopt;
      }
    }
    return std::nullopt;
  }

  [[nodiscard]] std::optional<PlateSolution> try_anchor(std::size_t anchor, double radius) {
    // Brightest first already.
    std::array<std::size_t, PlateSolver::neighbours_most> near{};
    std::size_t n = 0;
    for (std::size_t i = 0; i < places_.size() && n < near.size(); ++i) {
      if (i != anchor && (places_[i] - places_[anchor]).squaredNorm() < radius * radius) near[n++] = i;
    }
    std::optional<PlateSolution> found;
    for_threes(n, [&](std::size_t a, std::size_t b, std::size_t c) {
      if (!found) found = try_pattern({anchor, near[a], near[b], near[c]});
    });
    return found;
  }

  /// As they would be seen if the camera looked at the first of them.
  [[nodiscard]] std::array<Vector2d, 4> flat(const std::array<std::size_t, 4>& four) const {
    std::array<Vector2d, 4> places;
    if (assumed_focal_px_ > 0) {
      const auto ray = [&](std::size_t k) {
        return Vector3d(straight_[four[k]].x(), straight_[four[k]].y(), assumed_focal_px_).normalized();
      };
      const Vector3d middle = ray(0);
      Eigen::Matrix<double, 2, 3> axes;  // right and down
      axes.row(0) = (Vector3d(1, 0, 0) - middle.x() * middle).normalized();
      axes.row(1) = middle.cross(Vector3d(axes.row(0)));
      for (std::size_t k = 0; k < 4; ++k) places[k] = axes * ray(k) / ray(k).dot(middle);
    } else {
      for (std::size_t k = 0; k < 4; ++k) places[k] = straight_[four[k]];
    }
    return places;
  }

  [[nodiscard]] std::optional<PlateSolution> try_pattern(const std::array<std::size_t, 4>& four) {
    const std::array<Vector2d, 4> places = flat(four);
    std::optional<PlateSolution> found;
    // With rows that count downwards, pixels have the handedness of east and north.
    for (const bool mirrored : {false, true}) {
      const auto shape = shape_of(places, mirrored);
      if (!shape) return std::nullopt;
      for_alike(shape->code, [&](const PlateSolver::Quad& quad) {
        if (found || trials_left_ <= 0) return;
        ++trials_;
        --trials_left_;
        std::array<std::size_t, 4> order{};
        for (std::size_t k = 0; k < 4; ++k) order[k] = four[shape->order[k]];
        found = try_match(order, quad, mirrored);
      });
      if (found) break;
    }
    return found;
  }

  template <class Use>
  void for_alike(const PlateSolver::Code& code, Use&& use) const {
    std::array<std::array<int, 2>, 4> cells{};
    for (std::size_t k = 0; k < 4; ++k)
      cells[k] = {static_cast<int>(std::floor((code[k] - PlateSolver::tolerance) / PlateSolver::cell)),
                  static_cast<int>(std::floor((code[k] + PlateSolver::tolerance) / PlateSolver::cell))};
    for (unsigned choice = 0; choice < 16; ++choice) {
      std::array<int, 4> at{};
      bool twice = false;
      for (std::size_t k = 0; k < 4; ++k) {
        const bool upper = (choice >> k & 1U) != 0;
        twice = twice || (upper && cells[k][0] == cells[k][1]);
        at[k] = cells[k][upper ? 1 : 0];
      }
      if (twice) continue;
      const std::size_t bucket = PlateSolver::bucket_of(at);
      for (std::uint32_t q = solver_.first_[bucket]; q < solver_.first_[bucket + 1]; ++q) {
        const PlateSolver::Quad& quad = solver_.quads_[q];
        bool alike = true;
        for (std::size_t k = 0; k < 4; ++k)
          alike = alike && std::abs(static_cast<float>(quad.code[k]) * PlateSolver::code_unit - code[k]) <
                               PlateSolver::tolerance;
        if (alike) use(quad);
      }
    }
  }

  /// @param slack  above 1: widens the bounds
  [[nodiscard]] bool has_likely_field(double field_deg, double slack) const {
    return field_deg * slack > options_.field_least_deg && field_deg < slack * options_.field_most_deg;
  }

  [[nodiscard]] std::optional<PlateSolution> try_match(const std::array<std::size_t, 4>& four,
                                                       const PlateSolver::Quad& quad, bool mirrored) {
    std::array<Vector3d, 4> sky;
    for (std::size_t k = 0; k < 4; ++k) sky[k] = solver_.direction(quad.stars[k]);
    const Vector2d& a = straight_[four[0]];
    const Vector2d& b = straight_[four[1]];
    CameraModel camera{Matrix3d::Identity(), 0, mirrored, Vector2d::Zero(), assumed_k1_, 0, corner_px()};
    const auto ray = [&](std::size_t k) { return camera.direction(places_[four[k]]); };
    const double angle = 2 * std::asin((sky[0] - sky[1]).norm() / 2);
    camera.focal_px = (a - b).norm() / angle;
    for (int round = 0; round < 4; ++round)
      camera.focal_px *= 2 * std::asin((ray(0) - ray(1)).norm() / 2) / angle;
    if (!has_likely_field(2 * std::atan(width_ / 2.0 / camera.focal_px) / rad_per_deg, field_slack))
      return std::nullopt;
    Matrix3d products = Matrix3d::Zero();
    for (std::size_t k = 0; k < 4; ++k) products += sky[k] * ray(k).transpose();
    camera.to_sky = rotation_between(products);
    const double tolerance = std::max(1.5, 0.004 * (a - b).norm()) / camera.focal_px;
    Vector2d middle = Vector2d::Zero();
    for (std::size_t k = 0; k < 4; ++k) {
      if ((ray(k) - sky[k]).norm() > tolerance) return std::nullopt;
      middle += places_[four[k]] / 4;
    }
    return judge(camera, middle);
  }

  struct Pair {
    std::size_t place;
    std::size_t star;
  };
  using Places = std::span<const std::size_t>;

  [[nodiscard]] std::vector<Pair> pairs_of(const CameraModel& camera, Places places, double reach) const {
    std::vector<Pair> pairs;
    for (const std::size_t i : places) {
      std::size_t nearest = 0;
      double least = 1e9;
      solver_.sky_.near(camera.direction(places_[i]), reach / camera.focal_px,
                        [&](std::size_t k, double square) {
                          if (square < least) least = square, nearest = k;
                        });
      if (least < 1e9) pairs.push_back({i, nearest});
    }
    return pairs;
  }

  [[nodiscard]] CameraFit refine(CameraModel& camera, const std::vector<Pair>& pairs, LensTerms lens) const {
    std::vector<SeenStar> stars;
    stars.reserve(pairs.size());
    for (const Pair& p : pairs)
      stars.push_back({places_[p.place], solver_.direction(p.star), sigma_px_[p.place]});
    return fit_camera(camera, stars, lens);
  }

  /// All places, those nearest to @p middle first; @p sorted of them in order.
  [[nodiscard]] std::vector<std::size_t> around(const Vector2d& middle, std::size_t sorted) const {
    std::vector<std::size_t> order(places_.size());
    std::iota(order.begin(), order.end(), 0);
    std::partial_sort(order.begin(), order.begin() + static_cast<std::ptrdiff_t>(sorted), order.end(),
                      [&](std::size_t a, std::size_t b) {
                        return (places_[a] - middle).squaredNorm() < (places_[b] - middle).squaredNorm();
                      });
    return order;
  }

  /// Fits the camera to the stars around the pattern, then to those farther out, and takes it only where
  /// chance does not explain how many stars agree.
  [[nodiscard]] std::optional<PlateSolution> judge(CameraModel camera, const Vector2d& middle) const {
    std::size_t n = std::min(places_.size(), std::clamp(places_.size() / 2, around_least, around_most));
    std::vector<std::size_t> order = around(middle, n);
    std::vector<Pair> pairs = pairs_of(camera, Places(order).first(n), reach_px);
    if (pairs.size() < agreeing_least ||
        chance_of(camera, n, pairs.size(), stars_of_pattern, reach_px) > std::log(chance_of_first))
      return std::nullopt;
    order = around(middle, order.size());
    double reach = reach_px;
    CameraFit fit{};
    for (bool all = false; !all;) {
      fit = refine(camera, pairs, LensTerms::few);
      if (!(fit.rms_px <= reach) || pairs.size() < agreeing_least) return std::nullopt;
      all = n == order.size();
      n = std::min(order.size(), static_cast<std::size_t>(growth * static_cast<double>(n)));
      reach = std::max(reach_px, reach_of_growth * camera.corner_px);
      pairs = pairs_of(camera, Places(order).first(n), reach);
    }
    // All stars for the best fit.
    for (int round = 0; round < best_fits; ++round) {
      fit = refine(camera, pairs, LensTerms::all);
      if (!(fit.rms_px <= reach)) return std::nullopt;
      reach = std::clamp(5 * fit.spread_px, reach_least_px, reach_px);
      pairs = pairs_of(camera, order, reach);
    }
    if (pairs.size() < agreeing_least || !is_beyond_chance(camera, reach)) return std::nullopt;
    const PlateSolution solution = solution_of(camera, fit, pairs);
    if (!has_likely_field(solution.attitude.field_deg, 1)) return std::nullopt;
    return solution;
  }

  /// Logarithm of the chance that so many of @p n places agree, all trials together.
  /// @param taken  of them that agree by the fit
  [[nodiscard]] double chance_of(const CameraModel& camera, std::size_t n, std::size_t agreeing,
                                 std::size_t taken, double reach) const {
    // Of the catalogue's stars around here, each takes its share of the frame.
    const Vector3d middle = camera.direction(Vector2d::Zero());
    const double half = std::atan(camera.corner_px / camera.focal_px);
    double stars = 0;
    solver_.sky_.near(middle, half, [&](std::size_t, double) { ++stars; });
    const double area = 2 * std::numbers::pi * (1 - std::cos(half));
    // That any place has a star near it. Where nearly each has one, agreement says nothing.
    const double expected = stars / area * std::numbers::pi * std::pow(reach / camera.focal_px, 2);
    const double p = std::clamp(1 - std::exp(-expected), 1e-6, 1 - 1e-9);
    return log_chance(n - taken, agreeing - taken, p) + std::log(std::max(1, trials_));
  }

  [[nodiscard]] bool is_beyond_chance(const CameraModel& camera, double reach) const {
    std::vector<std::size_t> brightest(std::min(judged_most, places_.size()));
    std::iota(brightest.begin(), brightest.end(), 0);
    const std::size_t agreeing = pairs_of(camera, brightest, reach).size();
    constexpr std::size_t taken = stars_of_pattern + stars_of_lens;
    if (agreeing <= taken ||
        chance_of(camera, brightest.size(), agreeing, taken, reach) > std::log(chance_most))
      return false;
    // The brightest stars that have to be in the frame are there.
    std::vector<std::size_t> inside;
    const double half = std::atan(camera.corner_px / camera.focal_px) * field_slack;
    solver_.sky_.near(camera.direction(Vector2d::Zero()), half, [&](std::size_t k, double) {
      if (is_inside(camera, k)) inside.push_back(k);
    });
    std::sort(inside.begin(), inside.end());
    if (inside.size() > 12) inside.resize(12);
    std::size_t seen = 0;
    for (const std::size_t k : inside) {
      const Vector2d at = camera.pixel(solver_.direction(k));
      seen += std::any_of(places_.begin(), places_.end(),
                          [&](const Vector2d& q) { return (q - at).norm() < 3 * reach_px; });
    }
    return 2 * seen >= inside.size();
  }

  [[nodiscard]] bool is_inside(const CameraModel& camera, std::size_t star) const {
    const Vector3d direction = solver_.direction(star);
    if (!camera.is_ahead(direction)) return false;
    const Vector2d at = camera.pixel(direction);
    return std::abs(at.x()) < width_ / 2.0 - 4 && std::abs(at.y()) < height_ / 2.0 - 4;
  }

  [[nodiscard]] PlateSolution solution_of(const CameraModel& camera, const CameraFit& fit,
                                          const std::vector<Pair>& pairs) const {
    const auto degrees = [](double rad) {
      const double deg = rad / rad_per_deg;
      return deg < 0 ? deg + 360 : deg;
    };
    const auto apart = [&](const Vector2d& a, const Vector2d& b) {
      return 2 * std::asin((camera.direction(a) - camera.direction(b)).norm() / 2);
    };
    const Vector3d middle = camera.direction(Vector2d::Zero());
    const Vector2d up = tangent_place(middle, camera.direction(Vector2d(0, -1)));
    const double scale = arcsec_per_rad * apart(Vector2d(-0.5, 0), Vector2d(0.5, 0));
    PlateSolution solution;
    solution.attitude = {degrees(std::atan2(middle.y(), middle.x())),
                         std::asin(std::clamp(middle.z(), -1.0, 1.0)) / rad_per_deg,
                         degrees(std::atan2(up.x(), up.y())),
                         scale,
                         camera.mirrored,
                         static_cast<int>(pairs.size()),
                         fit.rms_px * scale,
                         apart(Vector2d(-width_ / 2.0, 0), Vector2d(width_ / 2.0, 0)) / rad_per_deg,
                         fit.rms_px,
                         {camera.focal_px, camera.axis.x(), camera.axis.y(), camera.k1, camera.k2}};
    solution.camera = camera;
    solution.fit = fit;
    for (const Pair& p : pairs)
      solution.matches.push_back({given_[p.place], solver_.stars_[p.star].magnitude});
    return solution;
  }

  const PlateSolver& solver_;
  const PlateOptions& options_;
  int width_;
  int height_;
  std::vector<std::size_t> given_;  ///< of each place: the star in the list
  std::vector<Vector2d> places_;    ///< from the frame's middle, brightest first
  std::vector<double> sigma_px_;
  std::vector<Vector2d> straight_;  ///< with the assumed distortion taken away
  double assumed_focal_px_ = 0;     ///< 0: shapes are the same all over the frame
  double assumed_k1_ = 0;
  int trials_ = 0;
  int trials_left_ = 0;
};

std::optional<PlateSolution> PlateSolver::solve(const std::vector<Star>& stars, int width, int height,
                                                const PlateOptions& options) const {
  return PlateSearch(*this, stars, width, height, options).run();
}

FieldSolver::FieldSolver() : wide_(shared_wide()) {}

std::shared_ptr<const PlateSolver> FieldSolver::shared_wide() {
  static std::mutex mutex;
  static std::weak_ptr<const PlateSolver> known;
  const std::lock_guard lock(mutex);
  auto solver = known.lock();
  if (!solver) {
    solver = std::make_shared<const PlateSolver>(wide_scales());
    known = solver;
  }
  return solver;
}

std::optional<PlateSolution> FieldSolver::solve(const std::vector<Star>& stars, int width, int height,
                                                const PlateOptions& options) {
  if (stars.size() < agreeing_least) return std::nullopt;
  if (auto found = wide_->solve(stars, width, height, options)) return found;
  if (options.field_least_deg >= narrow_most_deg) return std::nullopt;
  if (!narrow_) narrow_ = std::make_unique<const PlateSolver>(narrow_scales());
  return narrow_->solve(stars, width, height,
                        {options.field_least_deg, std::min(options.field_most_deg, narrow_most_deg)});
}

std::string FieldSolver::why_unsolved(const std::vector<Star>& stars, int width, int height,
                                      const PlateOptions& options) {
  const std::string bounds = fmt::format("a field of {:g} to {:g} degrees (min_field, max_field)",
                                         options.field_least_deg, options.field_most_deg);
  const bool is_bounded =
      options.field_least_deg > field_least_deg || options.field_most_deg < field_most_deg;
  std::optional<PlateSolution> beyond;
  if (is_bounded && stars.size() >= agreeing_least) {
    beyond = wide_->solve(stars, width, height, {});
    if (!beyond && narrow_) beyond = narrow_->solve(stars, width, height, {field_least_deg, narrow_most_deg});
  }
  if (!beyond)
    return fmt::format("no solution: {} stars, no attitude with {} explains them", stars.size(), bounds);
  const double field_deg = beyond->attitude.field_deg;
  const bool narrow = field_deg < options.field_most_deg;
  return fmt::format("no solution with {}: {} of {} stars fit a field of {:.2f} degrees, {} {}={:g}", bounds,
                     beyond->attitude.stars, stars.size(), field_deg, narrow ? "below" : "above",
                     narrow ? "min_field" : "max_field",
                     narrow ? options.field_least_deg : options.field_most_deg);
}

}  // namespace srfs::image
