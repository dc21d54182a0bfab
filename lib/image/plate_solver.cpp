// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "image/plate_solver.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>
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

/// How far around a star its pattern reaches: for frames of about 5, 9 and 16 degrees.
constexpr std::array pattern_radii_deg{1.7, 3.0, 5.5};
/// Patterns start at the brightest star of every cell of this share of the radius.
constexpr double anchor_cell = 0.75;

constexpr std::size_t anchors_most = 30;  ///< of a frame
constexpr std::size_t judged_most = 60;   ///< brightest stars that an attitude has to explain
constexpr std::size_t fitted_most = 300;
/// Chance of an attitude that is believed, all trials together.
constexpr double chance_most = 1e-7;
constexpr std::size_t agreeing_least = 7;
constexpr double reach_px = 3;  ///< of a first attitude's predictions

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

struct Camera {
  Matrix3d to_sky;  ///< from the camera's axes (x right, y down, z ahead) to J2000
  double focal_px;
  bool mirrored;  ///< x counts to the left
};

}  // namespace

PlateSolver::PlateSolver(const std::vector<CatalogueStar>& catalogue)
    : stars_(catalogue),
      directions_([&] {
        std::vector<Vector3d> directions;
        directions.reserve(catalogue.size());
        for (const CatalogueStar& s : catalogue) directions.push_back(s.direction);
        return directions;
      }()),
      sky_(directions_, 1.0 * rad_per_deg) {
  for (const double radius_deg : pattern_radii_deg) add_patterns(radius_deg * rad_per_deg);
  // By bucket.
  const auto bucket = [](const Quad& q) {
    std::array<int, 4> cells{};
    for (std::size_t k = 0; k < 4; ++k) cells[k] = static_cast<int>(std::floor(q.code[k] / cell));
    return bucket_of(cells);
  };
  first_.assign(buckets + 1, 0);
  std::vector<std::uint32_t> of;
  of.reserve(quads_.size());
  for (const Quad& q : quads_) {
    of.push_back(static_cast<std::uint32_t>(bucket(q)));
    ++first_[of.back() + 1];
  }
  for (std::size_t i = 1; i < first_.size(); ++i) first_[i] += first_[i - 1];
  std::vector<Quad> sorted(quads_.size());
  std::vector<std::uint32_t> next(first_.begin(), first_.end() - 1);
  for (std::size_t i = 0; i < quads_.size(); ++i) sorted[next[of[i]]++] = quads_[i];
  quads_ = std::move(sorted);
}

std::size_t PlateSolver::bucket_of(const std::array<int, 4>& cells) {
  std::uint64_t key = 0;
  for (const int c : cells) key = key * 128 + static_cast<std::uint64_t>(c + 64);
  return static_cast<std::size_t>((key * 0x9E3779B97F4A7C15ULL) >> 44) & (buckets - 1);
}

void PlateSolver::add_patterns(double radius_rad) {
  // The brightest star of each cell.
  std::vector<bool> has_brighter(directions_.size(), false);
  const double apart = anchor_cell * radius_rad;
  std::vector<std::size_t> near;
  for (std::size_t i = 0; i < directions_.size(); ++i) {
    if (has_brighter[i]) continue;
    near.clear();
    sky_.near(directions_[i], radius_rad, [&](std::size_t k, double square) {
      if (k == i) return;
      near.push_back(k);
      if (square < apart * apart) has_brighter[k] = true;
    });
    // The catalogue's order is that of brightness.
    const auto n = std::min<std::size_t>(near.size(), neighbours);
    std::partial_sort(near.begin(), near.begin() + static_cast<std::ptrdiff_t>(n), near.end());
    const Vector3d& middle = directions_[i];
    const Vector3d east = Vector3d(-middle.y(), middle.x(), 0).norm() > 1e-6
                              ? Vector3d(-middle.y(), middle.x(), 0).normalized()
                              : Vector3d(1, 0, 0);
    const Vector3d north = middle.cross(east);
    const auto flat = [&](std::size_t k) {
      const Vector3d& d = directions_[k];
      const double ahead = d.dot(middle);
      return Vector2d(d.dot(east) / ahead, d.dot(north) / ahead);
    };
    std::array<Vector2d, neighbours> places;
    for (std::size_t k = 0; k < n; ++k) places[k] = flat(near[k]);
    for_threes(n, [&](std::size_t a, std::size_t b, std::size_t c) {
      const std::array<std::size_t, 4> four{i, near[a], near[b], near[c]};
      const auto shape = shape_of({Vector2d(0, 0), places[a], places[b], places[c]}, false);
      if (!shape) return;
      Quad quad{shape->code, {}};
      for (std::size_t k = 0; k < 4; ++k) quad.stars[k] = static_cast<std::uint32_t>(four[shape->order[k]]);
      quads_.push_back(quad);
    });
  }
}

/// One frame's search.
class PlateSearch {
 public:
  PlateSearch(const PlateSolver& solver, const std::vector<Star>& stars, int width, int height,
              const PlateOptions& options)
      : solver_(solver), options_(options), width_(width), height_(height) {
    std::vector<Star> sorted = stars;
    std::sort(sorted.begin(), sorted.end(), [](const Star& a, const Star& b) { return a.flux > b.flux; });
    if (sorted.size() > fitted_most) sorted.resize(fitted_most);
    for (const Star& s : sorted) places_.emplace_back(s.x - (width - 1) / 2.0, s.y - (height - 1) / 2.0);
  }

  std::optional<Attitude> run() {
    if (places_.size() < agreeing_least) return std::nullopt;
    const std::vector<std::size_t> anchors = choose_anchors();
    // From the middle of what is likely outwards.
    for (const double share : {0.24, 0.3, 0.19, 0.375, 0.15, 0.47, 0.12, 0.59, 0.095, 0.73}) {
      for (const std::size_t anchor : anchors) {
        if (auto found = try_anchor(anchor, share * width_)) return found;
        if (trials_ > trials_most) return std::nullopt;
      }
    }
    return std::nullopt;
  }

 private:
  static constexpr int trials_most = 60000;

  /// The brightest stars, those near the middle first.
  [[nodiscard]] std::vector<std::size_t> choose_anchors() const {
    std::vector<std::size_t> anchors;
    for (std::size_t i = 0; i < std::min(places_.size(), anchors_most); ++i) anchors.push_back(i);
    std::stable_sort(anchors.begin(), anchors.end(), [&](std::size_t a, std::size_t b) {
      return places_[a].squaredNorm() < places_[b].squaredNorm();
    });
    return anchors;
  }

  [[nodiscard]] std::optional<Attitude> try_anchor(std::size_t anchor, double radius) {
    // Brightest first already.
    std::array<std::size_t, PlateSolver::neighbours> near{};
    std::size_t n = 0;
    for (std::size_t i = 0; i < places_.size() && n < near.size(); ++i) {
      if (i != anchor && (places_[i] - places_[anchor]).squaredNorm() < radius * radius) near[n++] = i;
    }
    std::optional<Attitude> found;
    for_threes(n, [&](std::size_t a, std::size_t b, std::size_t c) {
      if (!found) found = try_pattern({anchor, near[a], near[b], near[c]});
    });
    return found;
  }

  [[nodiscard]] std::optional<Attitude> try_pattern(const std::array<std::size_t, 4>& four) {
    const std::array<Vector2d, 4> places{places_[four[0]], places_[four[1]], places_[four[2]],
                                         places_[four[3]]};
    std::optional<Attitude> found;
    // With rows that count downwards, pixels have the handedness of east and north.
    for (const bool mirrored : {false, true}) {
      const auto shape = shape_of(places, mirrored);
      if (!shape) return std::nullopt;
      for_alike(shape->code, [&](const PlateSolver::Quad& quad) {
        if (found) return;
        ++trials_;
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
          alike = alike && std::abs(quad.code[k] - code[k]) < PlateSolver::tolerance;
        if (alike) use(quad);
      }
    }
  }

  /// Where a pixel looks, in the camera's axes.
  [[nodiscard]] static Vector3d ray(const Vector2d& p, double focal_px, bool mirrored) {
    return Vector3d(mirrored ? -p.x() : p.x(), p.y(), focal_px).normalized();
  }

  [[nodiscard]] bool has_likely_field(double focal_px) const {
    const double field_deg = 2 * std::atan(width_ / 2.0 / focal_px) / rad_per_deg;
    return field_deg > options_.field_least_deg && field_deg < options_.field_most_deg;
  }

  [[nodiscard]] std::optional<Attitude> try_match(const std::array<std::size_t, 4>& four,
                                                  const PlateSolver::Quad& quad, bool mirrored) {
    std::array<Vector3d, 4> sky;
    for (std::size_t k = 0; k < 4; ++k) sky[k] = solver_.directions_[quad.stars[k]];
    const Vector2d& a = places_[four[0]];
    const Vector2d& b = places_[four[1]];
    const double angle = 2 * std::asin((sky[0] - sky[1]).norm() / 2);
    double focal = (a - b).norm() / angle;
    if (!has_likely_field(focal)) return std::nullopt;
    for (int round = 0; round < 3; ++round) {
      const double seen = 2 * std::asin((ray(a, focal, mirrored) - ray(b, focal, mirrored)).norm() / 2);
      focal *= seen / angle;
    }
    Matrix3d products = Matrix3d::Zero();
    for (std::size_t k = 0; k < 4; ++k)
      products += sky[k] * ray(places_[four[k]], focal, mirrored).transpose();
    const Camera camera{rotation_between(products), focal, mirrored};
    const double tolerance = std::max(1.5, 0.004 * (a - b).norm()) / focal;
    for (std::size_t k = 0; k < 4; ++k) {
      if ((camera.to_sky * ray(places_[four[k]], focal, mirrored) - sky[k]).norm() > tolerance)
        return std::nullopt;
    }
    return judge(camera);
  }

  struct Pair {
    std::size_t place;
    std::size_t star;
  };

  [[nodiscard]] std::vector<Pair> pairs_of(const Camera& camera, std::size_t most, double reach) const {
    std::vector<Pair> pairs;
    for (std::size_t i = 0; i < std::min(most, places_.size()); ++i) {
      std::size_t nearest = 0;
      double least = 1e9;
      solver_.sky_.near(camera.to_sky * ray(places_[i], camera.focal_px, camera.mirrored),
                        reach / camera.focal_px, [&](std::size_t k, double square) {
                          if (square < least) least = square, nearest = k;
                        });
      if (least < 1e9) pairs.push_back({i, nearest});
    }
    return pairs;
  }

  /// Least squares of rotation and focal length. @return the rms of what is left, px per axis
  [[nodiscard]] double refine(Camera& camera, const std::vector<Pair>& pairs) const {
    for (int round = 0; round < 3; ++round) {
      Eigen::Matrix4d normal = Eigen::Matrix4d::Zero();
      Eigen::Vector4d right = Eigen::Vector4d::Zero();
      for (const Pair& pair : pairs) {
        const Vector3d v = camera.to_sky.transpose() * solver_.directions_[pair.star];
        const double f = camera.focal_px;
        const Vector2d& p = places_[pair.place];
        const double side = camera.mirrored ? -1 : 1;
        const double u = v.x() / v.z();
        const double w = v.y() / v.z();
        // By small turns around the camera's axes and by the focal length.
        const Eigen::Vector4d gx(f * u * w, -f * (1 + u * u), f * w, u);
        const Eigen::Vector4d gy(f * (1 + w * w), -f * u * w, -f * u, w);
        const double rx = side * p.x() - f * u;
        const double ry = p.y() - f * w;
        normal += gx * gx.transpose() + gy * gy.transpose();
        right += rx * gx + ry * gy;
      }
      const Eigen::Vector4d step = normal.ldlt().solve(right);
      if (!step.allFinite() || step.head<3>().norm() > 0.1) return 1e9;
      // When the camera turns by this, the stars turn the other way in its axes.
      const Vector3d turn = step.head<3>();
      const double size = turn.norm();
      if (size > 0) camera.to_sky = camera.to_sky * Eigen::AngleAxisd(size, turn / size).toRotationMatrix();
      camera.focal_px += step[3];
      if (size * camera.focal_px < 1e-4 && std::abs(step[3]) < 1e-4 * camera.focal_px) break;
    }
    double squares = 0;
    for (const Pair& pair : pairs) {
      const Vector3d v = camera.to_sky.transpose() * solver_.directions_[pair.star];
      const double side = camera.mirrored ? -1 : 1;
      squares += std::pow(camera.focal_px * v.x() / v.z() - side * places_[pair.place].x(), 2) +
                 std::pow(camera.focal_px * v.y() / v.z() - places_[pair.place].y(), 2);
    }
    return std::sqrt(squares / (2 * static_cast<double>(pairs.size())));
  }

  /// Takes an attitude only where chance does not explain how many stars agree.
  [[nodiscard]] std::optional<Attitude> judge(Camera camera) const {
    std::vector<Pair> pairs = pairs_of(camera, judged_most, reach_px);
    if (pairs.size() < agreeing_least) return std::nullopt;
    double rms = refine(camera, pairs);
    if (rms > reach_px || !has_likely_field(camera.focal_px)) return std::nullopt;
    double reach = std::clamp(4 * rms, 1.0, reach_px);
    pairs = pairs_of(camera, judged_most, reach);
    if (pairs.size() < agreeing_least || !is_beyond_chance(camera, pairs, reach)) return std::nullopt;
    // All stars for the best fit.
    for (int round = 0; round < 2; ++round) {
      pairs = pairs_of(camera, fitted_most, reach);
      rms = refine(camera, pairs);
      if (rms > reach) return std::nullopt;
      reach = std::clamp(4 * rms, 0.7, reach_px);
    }
    return attitude_of(camera, pairs.size(), rms);
  }

  [[nodiscard]] bool is_beyond_chance(const Camera& camera, const std::vector<Pair>& pairs,
                                      double reach) const {
    // Of the catalogue's stars around here, each takes its share of the frame.
    const Vector3d middle = camera.to_sky * Vector3d(0, 0, 1);
    const double half = std::atan(std::hypot(width_, height_) / 2.0 / camera.focal_px);
    double around = 0;
    std::size_t in_frame = 0;
    std::size_t brightest_seen = 0;
    std::vector<std::size_t> inside;
    solver_.sky_.near(middle, half, [&](std::size_t k, double) {
      ++around;
      const Vector3d v = camera.to_sky.transpose() * solver_.directions_[k];
      if (!(v.z() > 0) || std::abs(v.x() / v.z() * camera.focal_px) > width_ / 2.0 - 4 ||
          std::abs(v.y() / v.z() * camera.focal_px) > height_ / 2.0 - 4)
        return;
      ++in_frame;
      inside.push_back(k);
    });
    const double area = 2 * std::numbers::pi * (1 - std::cos(half));
    const double p =
        std::clamp(around / area * std::numbers::pi * std::pow(reach / camera.focal_px, 2), 1e-6, 0.5);
    const std::size_t n = std::min(judged_most, places_.size());
    // Four are the pattern's own, and four parameters are fitted to them.
    if (log_chance(n - 4, pairs.size() - 4, p) + std::log(std::max(1, trials_)) > std::log(chance_most))
      return false;
    // The brightest stars that have to be in the frame are there.
    std::sort(inside.begin(), inside.end());
    if (inside.size() > 12) inside.resize(12);
    for (const std::size_t k : inside) {
      const Vector3d v = camera.to_sky.transpose() * solver_.directions_[k];
      const Vector2d at(camera.focal_px * v.x() / v.z() * (camera.mirrored ? -1 : 1),
                        camera.focal_px * v.y() / v.z());
      brightest_seen += std::any_of(places_.begin(), places_.end(),
                                    [&](const Vector2d& q) { return (q - at).norm() < 3 * reach_px; });
    }
    return 2 * brightest_seen >= inside.size();
  }

  [[nodiscard]] Attitude attitude_of(const Camera& camera, std::size_t stars, double rms_px) const {
    const Vector3d middle = (camera.to_sky * Vector3d(0, 0, 1)).normalized();
    const Vector3d up = camera.to_sky * Vector3d(0, -1, 0);
    const Vector3d east = Vector3d(-middle.y(), middle.x(), 0).normalized();
    const Vector3d north = middle.cross(east);
    const auto turn = [](double rad) {
      const double deg = rad / rad_per_deg;
      return deg < 0 ? deg + 360 : deg;
    };
    const double scale = arcsec_per_rad / camera.focal_px;
    return {turn(std::atan2(middle.y(), middle.x())),
            std::asin(std::clamp(middle.z(), -1.0, 1.0)) / rad_per_deg,
            turn(std::atan2(up.dot(east), up.dot(north))),
            scale,
            camera.mirrored,
            static_cast<int>(stars),
            rms_px * scale};
  }

  const PlateSolver& solver_;
  const PlateOptions& options_;
  int width_;
  int height_;
  std::vector<Vector2d> places_;  ///< from the frame's middle, brightest first
  int trials_ = 0;
};

std::optional<Attitude> PlateSolver::solve(const std::vector<Star>& stars, int width, int height,
                                           const PlateOptions& options) const {
  return PlateSearch(*this, stars, width, height, options).run();
}

std::string PlateSolver::why_unsolved(const std::vector<Star>& stars, int width, int height,
                                      const PlateOptions& options, const PlateOptions& widest) const {
  const std::string bounds = fmt::format("a field of {:g} to {:g} degrees (min_field, max_field)",
                                         options.field_least_deg, options.field_most_deg);
  const auto beyond = solve(stars, width, height, widest);
  if (!beyond)
    return fmt::format("no solution: {} stars, no attitude with {} explains them", stars.size(), bounds);
  const double focal_px = arcsec_per_rad / beyond->scale_arcsec_px;
  const double field_deg = 2 * std::atan(width / 2.0 / focal_px) / rad_per_deg;
  const bool narrow = field_deg < options.field_most_deg;
  return fmt::format("no solution with {}: {} of {} stars fit a field of {:.2f} degrees, {} {}={:g}", bounds,
                     beyond->stars, stars.size(), field_deg, narrow ? "below" : "above",
                     narrow ? "min_field" : "max_field",
                     narrow ? options.field_least_deg : options.field_most_deg);
}

}  // namespace srfs::image
