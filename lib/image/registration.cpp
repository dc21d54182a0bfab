#include "image/registration.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>

#include <Eigen/Dense>

#include "image/place_index.hpp"

namespace srfs::image {
namespace {

constexpr std::size_t votes_of = 80;     ///< brightest stars that vote for a shift
constexpr std::size_t fitted_of = 2000;  ///< brightest stars that are fitted
constexpr std::size_t agreeing_least = 4;

// A projection has twice as many numbers to fit.
constexpr std::size_t projected_least_mixed = 16;  ///< while only the brightest are looked at
constexpr std::size_t projected_least = 24;        ///< stars
constexpr double projected_rms_most = 0.9;         ///< of that without
constexpr double projected_gain_least = 20;    ///< variance explained by each more number over what is left
constexpr double projected_share_least = 0.6;  ///< of the pairs, when those that are none were left out
constexpr double projected_w_most = 0.4;       ///< how far from 1 its denominator is within the frame

struct Pair {
  const Star* star;
  const Star* reference;
};

std::vector<Star> brightest(std::vector<Star> stars, std::size_t most) {
  std::sort(stars.begin(), stars.end(), [](const Star& a, const Star& b) { return a.flux > b.flux; });
  if (stars.size() > most) stars.resize(most);
  return stars;
}

/// The shift that most pairs of stars of similar brightness have in common, within @p bin_px; nothing where
/// that may be chance.
std::optional<FrameTransform> vote(const std::vector<Star>& stars, const std::vector<Star>& reference,
                                   int width, int height, double bin_px) {
  const int columns = static_cast<int>(width / bin_px) + 2;
  const int rows = static_cast<int>(height / bin_px) + 2;
  Grid<std::uint16_t> votes(columns, rows);
  double all = 0;
  for (const Star& s : stars) {
    for (const Star& r : reference) {
      if (r.flux > 2.5 * s.flux || s.flux > 2.5 * r.flux) continue;
      const double i = (r.x - s.x) / bin_px + columns / 2.0;
      const double j = (r.y - s.y) / bin_px + rows / 2.0;
      if (i < 0 || j < 0 || i >= columns || j >= rows) continue;
      ++votes.at(static_cast<int>(i), static_cast<int>(j));
      ++all;
    }
  }
  int most = 0;
  int best_i = 0;
  int best_j = 0;
  for (int j = 0; j + 1 < rows; ++j) {
    for (int i = 0; i + 1 < columns; ++i) {
      const int sum = votes.at(i, j) + votes.at(i + 1, j) + votes.at(i, j + 1) + votes.at(i + 1, j + 1);
      if (sum > most) most = sum, best_i = i, best_j = j;
    }
  }
  const double by_chance = 4 * all / (0.4 * columns * rows);  // most differences are near the middle
  if (most < static_cast<int>(agreeing_least) || most < by_chance + 5 * std::sqrt(by_chance))
    return std::nullopt;
  return FrameTransform{(best_i + 1 - columns / 2.0) * bin_px, (best_j + 1 - rows / 2.0) * bin_px, 1, 0};
}

/// Stars of one frame beside the nearest of the other, where that is the only one.
std::vector<Pair> pairs_within(const std::vector<Star>& stars, const std::vector<Star>& reference,
                               const PlaceIndex& index, const FrameTransform& transform, double reach) {
  std::vector<Pair> pairs;
  for (const Star& s : stars) {
    const auto [x, y] = transform(s.x, s.y);
    const Star* nearest = nullptr;
    int near = 0;
    index.near(x, y, reach, [&](std::size_t i, double) {
      nearest = &reference[i];
      ++near;
    });
    if (near == 1) pairs.push_back({&s, nearest});
  }
  return pairs;
}

/// Of a pair, by its fainter star's SNR up to 100.
double weight_of(const Pair& p) {
  return std::pow(std::clamp(std::min(p.star->snr, p.reference->snr), 1.0, 100.0), 2);
}

/// The same, but the brightest are a twentieth of a pixel off all the same: a few of them alone shall not
/// bend the whole frame.
double even_weight_of(const Pair& p) {
  return 1 / (0.0025 + 1 / weight_of(p));
}

/// Of the distances, per axis.
template <class Weight>
double rms_of(const std::vector<Pair>& pairs, const FrameTransform& transform, Weight weight) {
  double squares = 0;
  double weights = 0;
  for (const Pair& p : pairs) {
    const auto [x, y] = transform(p.star->x, p.star->y);
    squares += weight(p) * (std::pow(x - p.reference->x, 2) + std::pow(y - p.reference->y, 2)) / 2;
    weights += weight(p);
  }
  return std::sqrt(squares / weights);
}

/// Shift, turn and scale by least squares. @return the rms of what is left, per axis
template <class Weight>
double fit_similarity(const std::vector<Pair>& pairs, FrameTransform& transform, Weight weight) {
  Eigen::Matrix4d normal = Eigen::Matrix4d::Zero();
  Eigen::Vector4d right = Eigen::Vector4d::Zero();
  const auto add = [&](const Eigen::Vector4d& g, double value, double w) {
    normal.noalias() += w * g * g.transpose();
    right += w * value * g;
  };
  // Around the middle of the stars, for the numbers' sake.
  double mx = 0;
  double my = 0;
  for (const Pair& p : pairs) mx += p.star->x, my += p.star->y;
  mx /= static_cast<double>(pairs.size()), my /= static_cast<double>(pairs.size());
  for (const Pair& p : pairs) {
    const double x = p.star->x - mx;
    const double y = p.star->y - my;
    add({1, 0, x, -y}, p.reference->x, weight(p));
    add({0, 1, y, x}, p.reference->y, weight(p));
  }
  const Eigen::Vector4d t = normal.ldlt().solve(right);
  if (!t.allFinite()) return 1e9;
  transform = {t[0] - t[2] * mx + t[3] * my, t[1] - t[3] * mx - t[2] * my, t[2], t[3]};
  return rms_of(pairs, transform, weight);
}

/// A projection by least squares, from @p transform on. @return false where the stars do not determine one
bool fit_projection(const std::vector<Pair>& pairs, FrameTransform& transform, int width, int height) {
  // In units of about one, around the middle, for the numbers' sake.
  const double unit = std::max(width, height) / 2.0;
  const double mx = width / 2.0;
  const double my = height / 2.0;
  Eigen::Matrix3d to_pixels;
  to_pixels << unit, 0, mx, 0, unit, my, 0, 0, 1;
  Eigen::Matrix3d of;
  of << transform.a + transform.stretch, transform.shear - transform.b, transform.shift_x,
      transform.b + transform.shear, transform.a - transform.stretch, transform.shift_y, transform.tilt_x,
      transform.tilt_y, 1;
  of = (to_pixels.inverse() * of * to_pixels).eval();
  if (!(std::abs(of(2, 2)) > 1e-3)) return false;
  of /= of(2, 2);
  using Vector8 = Eigen::Matrix<double, 8, 1>;
  for (int round = 0; round < 4; ++round) {
    Eigen::Matrix<double, 8, 8> normal = Eigen::Matrix<double, 8, 8>::Zero();
    Vector8 right = Vector8::Zero();
    for (const Pair& p : pairs) {
      const Eigen::Vector3d from((p.star->x - mx) / unit, (p.star->y - my) / unit, 1);
      const Eigen::Vector3d to = of * from;
      const double w = to.z();
      if (!(w > 1 - projected_w_most)) return false;
      const double x = to.x() / w;
      const double y = to.y() / w;
      Vector8 dx;
      dx << from / w, Eigen::Vector3d::Zero(), -x * from.x() / w, -x * from.y() / w;
      Vector8 dy;
      dy << Eigen::Vector3d::Zero(), from / w, -y * from.x() / w, -y * from.y() / w;
      const double weight = even_weight_of(p);
      normal.noalias() += weight * (dx * dx.transpose() + dy * dy.transpose());
      right += weight * (dx * ((p.reference->x - mx) / unit - x) + dy * ((p.reference->y - my) / unit - y));
    }
    const Eigen::LDLT<Eigen::Matrix<double, 8, 8>> solver(normal);
    const auto& diagonal = solver.vectorD();
    if (!(diagonal.minCoeff() > 1e-6 * diagonal.maxCoeff())) return false;
    const Vector8 step = solver.solve(right);
    if (!step.allFinite()) return false;
    of.row(0) += step.segment<3>(0).transpose();
    of.row(1) += step.segment<3>(3).transpose();
    of(2, 0) += step[6];
    of(2, 1) += step[7];
  }
  for (const double x : {-mx, mx}) {
    for (const double y : {-my, my}) {
      const double w = 1 + (of(2, 0) * x + of(2, 1) * y) / unit;
      if (!(std::abs(w - 1) < projected_w_most)) return false;
    }
  }
  Eigen::Matrix3d in_pixels = to_pixels * of * to_pixels.inverse();
  in_pixels /= in_pixels(2, 2);
  if (!in_pixels.allFinite()) return false;
  transform.shift_x = in_pixels(0, 2);
  transform.shift_y = in_pixels(1, 2);
  transform.a = (in_pixels(0, 0) + in_pixels(1, 1)) / 2;
  transform.b = (in_pixels(1, 0) - in_pixels(0, 1)) / 2;
  transform.stretch = (in_pixels(0, 0) - in_pixels(1, 1)) / 2;
  transform.shear = (in_pixels(1, 0) + in_pixels(0, 1)) / 2;
  transform.tilt_x = in_pixels(2, 0);
  transform.tilt_y = in_pixels(2, 1);
  return true;
}

/// Leaves out the pairs that are far off for a transform, as measured by most of them.
void leave_out_others(std::vector<Pair>& pairs, const FrameTransform& transform) {
  std::vector<double> distances;
  for (const Pair& p : pairs) {
    const auto [x, y] = transform(p.star->x, p.star->y);
    distances.push_back(std::hypot(x - p.reference->x, y - p.reference->y));
  }
  std::vector<double> sorted = distances;
  std::nth_element(sorted.begin(), sorted.begin() + static_cast<std::ptrdiff_t>(sorted.size() / 2),
                   sorted.end());
  const double most = std::max(1.0, 3 * sorted[sorted.size() / 2]);
  std::size_t kept = 0;
  for (std::size_t i = 0; i < pairs.size(); ++i) {
    if (distances[i] <= most) pairs[kept++] = pairs[i];
  }
  pairs.resize(kept);
}

/// Shift, turn and scale, and a projection where the stars clearly tell one.
/// @param mixed pairs may be among them that are none
/// @return the rms of what is left, per axis
double fit(const std::vector<Pair>& pairs, int width, int height, bool mixed, FrameTransform& transform) {
  FrameTransform projected = transform;
  const double rms = fit_similarity(pairs, transform, weight_of);
  const std::size_t least = mixed ? projected_least_mixed : projected_least;
  if (pairs.size() < least) return rms;
  std::vector<Pair> kept = pairs;
  if (!projected.is_projection()) projected = transform;
  const int rounds = mixed ? 6 : 1;
  for (int round = 0; round < rounds; ++round) {
    if (kept.size() < least) return rms;
    if (!fit_projection(kept, projected, width, height)) return rms;
    if (round + 1 == rounds) break;
    kept = pairs;
    leave_out_others(kept, projected);
  }
  const auto n = static_cast<double>(kept.size());
  if (n < projected_share_least * static_cast<double>(pairs.size())) return rms;
  FrameTransform similar;
  const double without = fit_similarity(kept, similar, even_weight_of);
  const double with = rms_of(kept, projected, even_weight_of);
  const double gain = (std::pow(without / std::max(with, 1e-9), 2) - 1) * (2 * n - 8) / 4;
  if (with > projected_rms_most * without || gain < projected_gain_least) return rms;
  transform = projected;
  return with;
}

/// How much larger a small thing in the middle of the frame is.
double scale_of(const FrameTransform& transform, int width, int height) {
  const double x = width / 2.0;
  const double y = height / 2.0;
  const auto middle = transform(x, y);
  const auto right = transform(x + 1, y);
  const auto below = transform(x, y + 1);
  return std::sqrt(std::max(
      0.0, (right.x - middle.x) * (below.y - middle.y) - (right.y - middle.y) * (below.x - middle.x)));
}

}  // namespace

std::optional<Registration> register_stars(const std::vector<Star>& stars, const std::vector<Star>& reference,
                                           int width, int height) {
  const std::vector<Star> some = brightest(stars, votes_of);
  const std::vector<Star> some_of_reference = brightest(reference, votes_of);
  const std::vector<Star> many = brightest(stars, fitted_of);
  const std::vector<Star> many_of_reference = brightest(reference, fitted_of);
  const PlaceIndex few(some_of_reference);
  const PlaceIndex all(many_of_reference);
  std::optional<Registration> best;
  for (const double bin : {3.0, 10.0, 30.0}) {
    auto transform = vote(some, some_of_reference, width, height, bin);
    if (!transform) continue;
    // The brightest first, then all of them, ever closer.
    bool lost = false;
    for (double reach = 1.5 * bin; reach > 3 && !lost; reach /= 2) {
      const auto pairs = pairs_within(some, some_of_reference, few, *transform, reach);
      lost = pairs.size() < agreeing_least || fit(pairs, width, height, true, *transform) > reach;
    }
    if (lost) continue;
    double reach = 3;
    double by_chance = 0;  // pairs
    std::optional<Registration> found;
    bool grows = false;
    // A projection is found in a part of the frame first, and reaches farther each time.
    for (int round = 0; round < 4 || (round < 12 && grows); ++round) {
      const auto pairs = pairs_within(many, many_of_reference, all, *transform, reach);
      if (pairs.size() < agreeing_least) {
        found.reset();
        break;
      }
      const double rms = fit(pairs, width, height, false, *transform);
      grows = transform->is_projection() && (!found || static_cast<int>(pairs.size()) > found->stars);
      found = Registration{*transform, static_cast<int>(pairs.size()), rms};
      by_chance = static_cast<double>(many.size()) * static_cast<double>(many_of_reference.size()) *
                  std::numbers::pi * reach * reach / (static_cast<double>(width) * height);
      reach = std::clamp(4 * rms, 0.7, 3.0);
    }
    const double scale = found ? scale_of(found->to_reference, width, height) : 0;
    if (found && scale > 0.9 && scale < 1.1 && found->stars > by_chance + 5 * std::sqrt(by_chance) &&
        3 * static_cast<std::size_t>(found->stars) >= std::min(some.size(), some_of_reference.size()) &&
        (!best || found->stars > best->stars))
      best = found;
    // Else it may be a part of the frame only, of one that a wider vote has as a whole.
    if (best && 2 * static_cast<std::size_t>(best->stars) >= std::min(many.size(), many_of_reference.size()))
      break;
  }
  return best;
}

}  // namespace srfs::image
