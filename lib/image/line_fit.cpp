// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "image/line_fit.hpp"

#include <bit>
#include <cstring>

#include <Eigen/Dense>

namespace srfs::image {
namespace {

using Vector6 = Eigen::Matrix<double, 6, 1>;
using Matrix6 = Eigen::Matrix<double, 6, 6>;

/// How far behind its ends a line is searched for its rest: at least, and as a share of its length.
constexpr double beyond_least_px = 60;
constexpr double beyond_share = 1.2;
/// What counts of a bin's light along a line above the mean, in errors: the rest may be a star.
constexpr double bin_clip = 1;
/// Spread of the places an end may have, from which on all of them count instead of the best one.
constexpr double open_end_px = 1.2;
/// Ends found in whole steps may be off by so much of a line that is just long enough.
constexpr double ends_share = 0.8;

/// Ends and direction as the fit changes them.
void move(Line& line, const LineShape& from, const Vector6& step) {
  const double x = double(from.x) - step[2] * double(from.uy);
  const double y = double(from.y) + step[2] * double(from.ux);
  const double turn = std::clamp(step[3], -0.5, 0.5);
  const double ux = double(from.ux) * std::cos(turn) - double(from.uy) * std::sin(turn);
  const double uy = double(from.uy) * std::cos(turn) + double(from.ux) * std::sin(turn);
  const double t1 = double(from.from) + step[0];
  const double t2 = double(from.to) + step[1];
  line.x1 = x + t1 * ux, line.y1 = y + t1 * uy;
  line.x2 = x + t2 * ux, line.y2 = y + t2 * uy;
  line.height += step[4];
}

}  // namespace

double Line::length() const {
  return std::hypot(x2 - x1, y2 - y1);
}

LineFitter::LineFitter(const Plane& light, const Grid<std::uint8_t>& mask, const Psf& psf, LineNoise noise)
    : light_(light), mask_(mask), shape_(psf.shape()), sigma_(double(psf.sigma_px())), noise_(noise) {
  // Summed along a line, a profile with wings (1 + gamma q)^(-1/gamma) is (1 + gamma q)^(1/2 - 1/gamma).
  const double g = shape_.gamma;
  if (g > 1e-3) sigma_ *= std::sqrt((std::pow(2.0, 1 / (1 / g - 0.5)) - 1) / (std::pow(2.0, g) - 1));
  blur_ = std::max(1.6, 1.8 / sigma_);
}

LineShape LineFitter::shape_of(const Line& l) const {
  const double length = std::max(1e-3, l.length());
  const double ux = (l.x2 - l.x1) / length;
  const double uy = (l.y2 - l.y1) / length;
  // Width of an elliptic star in a direction, beside that of a round one of the same area.
  const auto& k = shape_;
  const double root = std::sqrt(k.a * k.c - k.b * k.b);
  const auto width = [&](double x, double y) {
    return std::sqrt((k.c * x * x - 2 * k.b * x * y + k.a * y * y) / root);
  };
  return {static_cast<float>((l.x1 + l.x2) / 2),
          static_cast<float>((l.y1 + l.y2) / 2),
          static_cast<float>(ux),
          static_cast<float>(uy),
          static_cast<float>(-length / 2),
          static_cast<float>(length / 2),
          static_cast<float>(sigma_ * width(ux, uy)),
          static_cast<float>(sigma_ * width(-uy, ux) * l.scale),
          static_cast<float>(l.height)};
}

double LineFitter::reach_px(const Line& line) const {
  return 3 * sigma_ * std::max(1.0, line.scale) + 1;
}

const LinePixels& LineFitter::collect(const Line& line, double reach, double beyond) {
  constexpr int lanes = 8;
  const std::size_t frame = light_.size();
  std::size_t n = 0;
  for_rows_along(line, light_.width(), light_.height(), reach, beyond, [&](int y, int first, int last) {
    const std::size_t most = n + static_cast<std::size_t>(last - first + lanes);
    if (pixels_.light.size() < most) {
      for (std::vector<float>* values : {&pixels_.x, &pixels_.y, &pixels_.light}) values->resize(2 * most);
    }
    const float* const light = light_.row(y);
    const std::uint8_t* const mask = mask_.row(y);
    const auto behind = frame - static_cast<std::size_t>(light - light_.cells().data());
    for (int x = first; x <= last; x += lanes) {
      float* const to_x = pixels_.x.data() + n;
      float* const to_y = pixels_.y.data() + n;
      float* const to = pixels_.light.data() + n;
      const int count = std::min(lanes, last - x + 1);
      std::uint64_t hidden = ~std::uint64_t{0};
      if (static_cast<std::size_t>(x) + lanes <= behind) {
        std::memcpy(&hidden, mask + x, sizeof hidden);
        const int beside = 8 * (lanes - count);
        hidden = std::endian::native == std::endian::little ? hidden << beside : hidden >> beside;
      }
      if (hidden == 0) {  // what is copied too much is overwritten
        for (int i = 0; i < lanes; ++i) {
          to_x[i] = static_cast<float>(x + i);
          to_y[i] = static_cast<float>(y);
          to[i] = light[x + i];
        }
        n += static_cast<std::size_t>(count);
        continue;
      }
      for (int i = x; i < x + count; ++i) {
        pixels_.x[n] = static_cast<float>(i);
        pixels_.y[n] = static_cast<float>(y);
        pixels_.light[n] = light[i];
        n += mask[i] == 0;
      }
    }
  });
  for (std::vector<float>* values : {&pixels_.x, &pixels_.y, &pixels_.light}) values->resize(n);
  return pixels_;
}

std::optional<double> LineFitter::fit(Line& line, double blur, bool with_ends, int rounds) {
  double energy = 0;
  double moved_since = 1e9;  // since the pixels were collected
  for (int round = 0; round < rounds; ++round) {
    if (moved_since > 1) {
      collect(line, blur * reach_px(line), blur * reach_px(line));
      moved_since = 0;
    }
    LineShape shape = shape_of(line);
    shape.sigma_across *= static_cast<float>(blur);
    const LineSums sums = line_sums(shape, pixels_, noise_, with_ends);
    energy = sums.energy;
    if (!(energy > 0)) return std::nullopt;
    Matrix6 normal;
    Vector6 right;
    for (int a = 0; a < 6; ++a) {
      right[a] = sums.right[static_cast<std::size_t>(a)];
      for (int b = a; b < 6; ++b)
        normal(a, b) = normal(b, a) = sums.normal[static_cast<std::size_t>(a)][static_cast<std::size_t>(b)];
    }
    // The width is the frame's but for good reason.
    const double stiff = 4 * std::max(1.0, line.height * line.height) / (sigma_ * sigma_);
    normal(5, 5) += blur > 1 ? 1e9 : stiff;
    right[5] += blur > 1 ? 0 : stiff * sigma_ * (1 - line.scale);
    if (!with_ends) normal(0, 0) += 1e9, normal(1, 1) += 1e9;
    normal.diagonal() *= 1.001;
    Vector6 step = normal.ldlt().solve(right);
    if (!step.allFinite()) return std::nullopt;
    const double half = line.length() / 2;
    const double across = std::abs(step[2]) + std::abs(step[3]) * half;
    const double along = std::max(std::abs(step[0]), std::abs(step[1]));
    const double part =
        std::min({1.0, 1.5 * blur * sigma_ / std::max(1e-9, across), 4 * sigma_ / std::max(1e-9, along)});
    step *= part;
    if (step[1] - step[0] < -0.8 * line.length()) return std::nullopt;  // the ends meet
    move(line, shape, step);
    line.scale = std::clamp(line.scale + step[5] / sigma_, 0.3, 3.0);
    if (!(line.height > 0)) return std::nullopt;
    moved_since += part * (across + along);
    if (across < 0.01 && along < 0.05 && part == 1) break;
  }
  return line.height * std::sqrt(energy);
}

/// The light along the line in steps of a pixel.
const LineFitter::Steps& LineFitter::steps_along(const Line& line) {
  const double length = line.length();
  steps_.before = std::max(beyond_least_px, beyond_share * length);
  const auto bins = static_cast<std::size_t>(length + 2 * steps_.before) + 2;
  steps_.light.assign(bins, 0.0);
  steps_.energy.assign(bins, 0.0);
  collect(line, 2.2 * sigma_, steps_.before);
  LineShape shape = shape_of(line);
  shape.sigma_across = static_cast<float>(sigma_ * line.scale);
  line_places(shape, pixels_, along_, profile_);
  const auto first = static_cast<float>(length / 2 + steps_.before + 0.5);
  const auto last = static_cast<float>(bins - 1);
  for (std::size_t i = 0; i < along_.size(); ++i) {
    const auto bin = static_cast<std::size_t>(std::clamp(along_[i] + first, 0.0F, last));
    steps_.light[bin] += double(profile_[i] * pixels_.light[i]);
    steps_.energy[bin] += double(profile_[i] * profile_[i]);
  }
  return steps_;
}

/// What a step speaks for a line of this height here: by how much chi squared is less with it.
double LineFitter::gain_of(const Steps& steps, std::size_t i, double height) {
  const double most = height * steps.energy[i] + bin_clip * std::sqrt(steps.energy[i]);
  return height * (2 * std::min(steps.light[i], most) - height * steps.energy[i]);
}

/// The piece that a line of this height explains best.
void LineFitter::find_ends(Line& line) {
  const double length = line.length();
  const Steps& steps = steps_along(line);
  const auto& [light, energy, beyond] = steps;
  const std::size_t bins = light.size();
  double height = line.height;
  double from = beyond;
  double to = beyond + length;
  for (int round = 0; round < 4; ++round) {
    // The piece of the largest sum (Kadane), of what each bin speaks for a line here.
    double sum = 0, best = 0;
    std::size_t start = 0, best_from = 0, best_to = 0;
    for (std::size_t i = 0; i < bins; ++i) {
      if (sum <= 0) sum = 0, start = i;
      sum += gain_of(steps, i, height);
      if (sum > best) best = sum, best_from = start, best_to = i;
    }
    if (best <= 0 || static_cast<double>(best_to) < from || static_cast<double>(best_from) > to) return;
    from = static_cast<double>(best_from) - 0.5;
    to = static_cast<double>(best_to) + 0.5;
    double all = 0, weight = 0;
    for (std::size_t i = best_from; i <= best_to; ++i) {
      all += std::min(light[i], height * energy[i] + bin_clip * std::sqrt(energy[i]));
      weight += energy[i];
    }
    if (!(weight > 0) || !(all > 0)) return;
    const double before = height;
    height = all / weight;
    if (std::abs(height - before) < 0.02 * before) break;
  }
  const double ux = (line.x2 - line.x1) / std::max(1e-3, length);
  const double uy = (line.y2 - line.y1) / std::max(1e-3, length);
  const double x = line.x1;
  const double y = line.y1;
  line.x1 = x + (from - beyond) * ux, line.y1 = y + (from - beyond) * uy;
  line.x2 = x + (to - beyond) * ux, line.y2 = y + (to - beyond) * uy;
  line.height = height;
}

void LineFitter::weigh_ends(Line& line, double noise) {
  const double length = line.length();
  const Steps& steps = steps_along(line);
  // Of an end in the middle of step i: all steps between it and the middle of the line are lit.
  const auto middle = static_cast<std::ptrdiff_t>(steps.before + length / 2 + 0.5);
  const auto bins = static_cast<std::ptrdiff_t>(steps.light.size());
  const auto mean_end = [&](std::ptrdiff_t step, double is) {
    double gain = 0;
    double most = 0;
    std::vector<double> gains;
    for (std::ptrdiff_t i = middle; i >= 0 && i < bins; i += step) {
      gain += gain_of(steps, static_cast<std::size_t>(i), line.height) / (noise * noise);
      gains.push_back(gain);
      most = std::max(most, gain);
    }
    double all = 0, mean = 0, squares = 0;
    for (std::size_t k = 0; k < gains.size(); ++k) {
      const double weight = std::exp((gains[k] - most) / 2);
      const double place = static_cast<double>(k) + 0.5;
      all += weight, mean += weight * place, squares += weight * place * place;
    }
    if (!(all > 0)) return is;
    mean /= all;
    const double spread = std::sqrt(std::max(0.0, squares / all - mean * mean));
    return spread > open_end_px
               ? static_cast<double>(middle) + static_cast<double>(step) * mean - steps.before
               : is;
  };
  const double from = mean_end(-1, 0);
  const double to = mean_end(1, length);
  if (to - from < 0.5 * length) return;
  const double ux = (line.x2 - line.x1) / std::max(1e-3, length);
  const double uy = (line.y2 - line.y1) / std::max(1e-3, length);
  line.x2 = line.x1 + to * ux, line.y2 = line.y1 + to * uy;
  line.x1 += from * ux, line.y1 += from * uy;
}

std::vector<double> LineFitter::heights_beside(const Line& line) {
  std::vector<double> heights;
  const double length = std::max(1e-3, line.length());
  const double step = 3.2 * sigma_ * std::max(1.0, line.scale) + 1;
  std::vector<float> of_line;
  for (const int k : {-4, -3, -2, 2, 3, 4}) {
    Line beside = line;
    const double dx = -(line.y2 - line.y1) / length * step * k / 1.6;
    const double dy = (line.x2 - line.x1) / length * step * k / 1.6;
    beside.x1 += dx, beside.x2 += dx, beside.y1 += dy, beside.y2 += dy;
    collect(beside, reach_px(line), 0);
    line_heights(shape_of(beside), pixels_, of_line);
    double product = 0;
    double energy = 0;
    for (std::size_t i = 0; i < of_line.size(); ++i) {
      product += double(of_line[i]) * double(pixels_.light[i]);
      energy += double(of_line[i]) * double(of_line[i]);
    }
    // At least half of it.
    if (energy > 0.5 * 1.77 * sigma_ * length) heights.push_back(product / energy);
  }
  return heights;
}

double LineFitter::nearby_significance(const Line& line) {
  constexpr float clip = 4;  // what is brighter may be one star
  collect(line, blur_ * reach_px(line), blur_ * reach_px(line));
  LineShape shape = shape_of(line);
  shape.sigma_across *= static_cast<float>(blur_);
  line_heights(shape, pixels_, profile_);
  float product = 0;
  float energy = 0;
  for (std::size_t i = 0; i < profile_.size(); ++i) {
    product += profile_[i] * std::clamp(pixels_.light[i], -clip, clip);
    energy += profile_[i] * profile_[i];
  }
  return energy > 0 ? double(product / std::sqrt(energy)) : 0;
}

std::optional<double> LineFitter::settle(Line& line, double least, double shortest) {
  if (!fit(line, blur_, false, 4)) return std::nullopt;
  const auto piece = fit(line, 1, false, 3);
  if (!piece || *piece < 0.45 * least) return std::nullopt;
  double length = 0;
  for (int round = 0; round < 3; ++round) {
    find_ends(line);
    if (line.length() < 2) return std::nullopt;
    const auto whole = fit(line, 1, false, 3);
    if (!whole || *whole < 0.8 * least) return std::nullopt;
    if (std::abs(line.length() - length) < 2) break;
    length = line.length();
  }
  if (line.length() < ends_share * shortest) return std::nullopt;
  return fit(line);
}

}  // namespace srfs::image
