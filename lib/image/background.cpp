// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "image/background.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <optional>

#include "image/rows.hpp"

namespace srfs::image {
namespace {

constexpr float unknown = std::numeric_limits<float>::quiet_NaN();
constexpr float clip_sigma = 2.5F;
constexpr int beyond = 2;  ///< nodes that a surface goes on for outside the frame
/// Spread of a normal distribution cut off at clip_sigma, inverted.
constexpr float clipped_spread = 1.0F / 0.95535F;
/// Level and spread of a cell start from so many of its pixels.
constexpr int sample_of_cell = 256;
constexpr std::size_t sample_least = 8;
/// About a step of quantised values, beside the noise that their rounding makes at least.
constexpr float wider_at_first = 2.5F;

struct CellStatistics {
  float level = unknown;
  float noise = unknown;
};

/// A row of cells, read pixel row by pixel row for all of them, as memory likes it.
struct Strip {
  int y0, y1;
  std::vector<int> x;  ///< where the cells begin, and where the last one ends
  [[nodiscard]] std::size_t cells() const { return x.size() - 1; }
};

/// One of a few pixels of each cell, spread over it so that rows, columns and Bayer patterns are seen whole.
void take_samples(const Plane& pixels, const Strip& strip, std::vector<std::vector<float>>& samples) {
  samples.resize(strip.cells());
  std::vector<int> steps(strip.cells());
  std::vector<int> upcoming(strip.cells());  // pixel of the cell, counted row by row
  for (std::size_t i = 0; i < strip.cells(); ++i) {
    samples[i].clear();
    const int size = (strip.x[i + 1] - strip.x[i]) * (strip.y1 - strip.y0);
    const int step = std::max(1, size / sample_of_cell);
    steps[i] = step + (step % 2 == 0 ? 1 : 0);  // an odd one visits all columns and rows
    upcoming[i] = step / 2;
  }
  for (int y = strip.y0; y < strip.y1; ++y) {
    const float* row = pixels.row(y);
    for (std::size_t i = 0; i < strip.cells(); ++i) {
      const int width = strip.x[i + 1] - strip.x[i];
      const int first = (y - strip.y0) * width;
      for (; upcoming[i] < first + width; upcoming[i] += steps[i]) {
        const float v = row[strip.x[i] + upcoming[i] - first];
        if (std::isfinite(v)) samples[i].push_back(v);
      }
    }
  }
}

/// Mean and spread of the values around the last ones, which stay where the squares are beyond what a float
/// holds.
CellStatistics next(const CellStatistics& last, const Moments& m, float noise_least) {
  if (m.n < static_cast<float>(sample_least)) return last;
  const float mean = m.sum / m.n;
  const float spread = std::sqrt(std::max(0.0F, m.squares / m.n - mean * mean));
  const CellStatistics is{last.level + mean, std::max(spread * clipped_spread, noise_least)};
  return std::isfinite(is.level) && std::isfinite(is.noise) ? is : last;
}

/// Level and spread of a sample: median and quartile first, whatever stands in the cell; then mean and spread
/// of what is near.
/// @return nothing of a cell without pixels
std::optional<CellStatistics> first_guess(std::vector<float>& sample, float noise_least) {
  if (sample.size() < sample_least) return std::nullopt;
  const auto middle = sample.begin() + static_cast<std::ptrdiff_t>(sample.size() / 2);
  std::nth_element(sample.begin(), middle, sample.end());
  const float median = *middle;
  const auto quarter = sample.begin() + static_cast<std::ptrdiff_t>(sample.size() / 4);
  std::nth_element(sample.begin(), quarter, middle);
  // The lower half has fewer stars in it. Of coarsely quantised values it may be zero wide, and a clip that
  // leaves one of two such values never lets the second in again: rather too wide at first.
  const float noise = (median - *quarter) * 1.4826F + wider_at_first * noise_least;
  CellStatistics guess{median, std::min(noise, std::numeric_limits<float>::max())};
  for (int round = 0; round < 3; ++round)
    guess = next(guess,
                 clipped_moments(sample.data(), static_cast<int>(sample.size()), guess.level,
                                 clip_sigma * guess.noise),
                 noise_least);
  return guess;
}

/// Whether a cell's values up to a limit change from one pixel to the next as noise does; light of whatever
/// stands in the sky is alike there.
bool is_noise(const Plane& pixels, const Strip& strip, std::size_t cell, float lowest, float most,
              float deviation) {
  constexpr double change_least = 0.4;  // of what independent values change by
  double squares = 0;
  double count = 0;
  for (int y = strip.y0; y < strip.y1; y += 2) {
    const float* row = pixels.row(y);
    for (int x = strip.x[cell]; x + 1 < strip.x[cell + 1]; ++x) {
      const auto counts = [&](float v) { return v >= lowest && v <= most; };
      if (!counts(row[x]) || !counts(row[x + 1])) continue;
      const double change = double(row[x + 1]) - double(row[x]);
      squares += change * change, ++count;
    }
  }
  return squares > change_least * 2 * count * double(deviation) * double(deviation);
}

/// Of a cell whose values are cut off.
struct CutCell {
  CellStatistics is;
  bool is_noise;
};

/// Of a sky whose dark side is cut off, at 0 of a picture mostly: many values are exactly the lowest of the
/// frame, and clipping by spread would go on narrowing what is left. The upper tail still has its width.
/// @return nothing where the sky is whole
std::optional<CutCell> of_cut_sky(const Plane& pixels, const Strip& strip, std::size_t cell,
                                  std::vector<float>& sample, float lowest, float noise_least) {
  constexpr double cut_least = 0.2;
  constexpr double faint_least = 0.1;
  constexpr float tail_share = 1;  ///< skewed light, summed, exceeds a limit more often than a Gaussian
  const auto n = static_cast<double>(sample.size());
  if (sample.size() < sample_least) return std::nullopt;
  if (static_cast<double>(std::count(sample.begin(), sample.end(), lowest)) < cut_least * n)
    return std::nullopt;
  std::sort(sample.begin(), sample.end());
  const auto at = [&](double share) { return sample[static_cast<std::size_t>(share * (n - 1))]; };
  if (sample.back() == lowest) return std::nullopt;  // no light at all
  // One and two spreads above the level.
  const float spread = std::max(at(0.977) - at(0.841), wider_at_first * noise_least);
  const float most = std::max(at(0.841) - spread, lowest) + 4 * spread;
  if (!std::isfinite(most) || !std::isfinite(most - lowest)) return std::nullopt;
  // Something dark beside a whole sky leaves a gap between their values.
  const auto lit = std::upper_bound(sample.begin(), sample.end(), lowest);
  const auto faint =
      std::upper_bound(lit, sample.end(), lowest + std::max(spread / 2, wider_at_first * noise_least));
  if (static_cast<double>(faint - lit) < faint_least * static_cast<double>(sample.end() - lit))
    return std::nullopt;
  double sum = 0, squares = 0, count = 0;
  for (const float v : sample) {
    if (v > most) break;
    const double d = double(v) - double(lowest);
    sum += d, squares += d * d, ++count;
  }
  const double mean = sum / count;
  const auto deviation = static_cast<float>(std::sqrt(std::max(0.0, squares / count - mean * mean)));
  const CellStatistics is{lowest + static_cast<float>(mean), std::max(deviation, tail_share * spread)};
  if (!std::isfinite(is.level) || !std::isfinite(is.noise)) return std::nullopt;
  return CutCell{is, is_noise(pixels, strip, cell, lowest, most, deviation)};
}

/// Of half of the rows even and odd ones: a sensor may read them differently.
constexpr std::array<int, 2> all_rows{1, 1};
constexpr std::array<int, 2> half_of_the_rows{3, 1};
/// A cell of fewer rows needs all of them.
constexpr int rows_least = 32;

/// Mean and spread of the pixels that are near, until they settle. Cells without a first value stay so.
/// @param enough  half of the rows will do
void settle(std::vector<CellStatistics>& cells, const Plane& pixels, const Grid<std::uint8_t>* masked,
            const Strip& strip, float noise_least, bool enough) {
  const auto& steps = enough && strip.y1 - strip.y0 >= rows_least ? half_of_the_rows : all_rows;
  std::vector<Moments> sums(cells.size());
  std::vector<bool> settled(cells.size());
  for (std::size_t i = 0; i < cells.size(); ++i) settled[i] = std::isnan(cells[i].level);
  for (int round = 0; round < 6; ++round) {
    std::fill(sums.begin(), sums.end(), Moments{0, 0, 0});
    std::size_t turn = 0;
    for (int y = strip.y0; y < strip.y1; y += steps[turn++ % 2]) {
      for (std::size_t i = 0; i < cells.size(); ++i) {
        if (settled[i]) continue;
        const int x = strip.x[i];
        const int width = strip.x[i + 1] - x;
        const float reach = clip_sigma * cells[i].noise;
        const Moments m =
            masked != nullptr
                ? clipped_moments(pixels.row(y) + x, masked->row(y) + x, width, cells[i].level, reach)
                : clipped_moments(pixels.row(y) + x, width, cells[i].level, reach);
        sums[i].n += m.n, sums[i].sum += m.sum, sums[i].squares += m.squares;
      }
    }
    bool all_settled = true;
    for (std::size_t i = 0; i < cells.size(); ++i) {
      if (settled[i]) continue;
      const CellStatistics before = cells[i];
      if (sums[i].n < static_cast<float>(sample_least)) {
        if (round == 0) cells[i] = {};
        settled[i] = true;
        continue;
      }
      cells[i] = next(before, sums[i], noise_least);
      // Where the clipping is off by a tenth, the spread is off by a hundredth.
      settled[i] = std::abs(cells[i].noise - before.noise) < 0.05F * cells[i].noise &&
                   std::abs(cells[i].level - before.level) < 0.1F * cells[i].noise;
      all_settled = all_settled && settled[i];
    }
    if (all_settled) return;
  }
}

/// Unknown nodes get the mean of the known ones next to them, ring by ring.
void fill_unknown(Plane& nodes) {
  for (int round = 0; round < nodes.width() + nodes.height(); ++round) {
    const Plane before = nodes;
    bool more = false;
    for (int y = 0; y < nodes.height(); ++y) {
      for (int x = 0; x < nodes.width(); ++x) {
        if (!std::isnan(before.at(x, y))) continue;
        double sum = 0;
        int n = 0;
        for (int j = y - 1; j <= y + 1; ++j) {
          for (int i = x - 1; i <= x + 1; ++i) {
            if (!before.contains(i, j) || std::isnan(before.at(i, j))) continue;
            sum += double(before.at(i, j));
            ++n;
          }
        }
        if (n > 0)
          nodes.at(x, y) = static_cast<float>(sum / n);
        else
          more = true;
      }
    }
    if (!more) return;
  }
  for (float& v : nodes.cells()) {
    if (std::isnan(v)) v = 0;
  }
}

/// Replaces nodes by the median of their neighbours: where a large star lifted them, not where the sky is
/// curved.
/// @param tolerance  of a node, beside the median; nullptr: none
void smooth(Plane& nodes, const Plane* tolerance) {
  const Plane before = nodes;
  std::vector<float> around;
  for (int y = 0; y < nodes.height(); ++y) {
    for (int x = 0; x < nodes.width(); ++x) {
      around.clear();
      // Point-symmetric neighbours, so that a slope stays a slope at the edge.
      for (int j = -1; j <= 1; ++j) {
        for (int i = -1; i <= 1; ++i) {
          if (before.contains(x + i, y + j) && before.contains(x - i, y - j))
            around.push_back(before.at(x + i, y + j));
        }
      }
      const float median = median_of(around);
      if (tolerance == nullptr || std::abs(before.at(x, y) - median) > tolerance->at(x, y))
        nodes.at(x, y) = median;
    }
  }
}

/// @param measure  (strip, one CellStatistics a cell, to be set)
/// @param correct  (level, noise) of all cells, before they are smoothed
template <class Measure, class Correct>
SkyLevel measure_strips(const Plane& pixels, float noise_least, Measure&& measure, Correct&& correct) {
  const int cell_px = sky_cell_px(pixels.width(), pixels.height());
  const int columns = (pixels.width() + cell_px - 1) / cell_px;
  const int rows = (pixels.height() + cell_px - 1) / cell_px;
  Plane level(columns, rows);
  Plane noise(columns, rows);
  Strip strip{};
  for (int i = 0; i <= columns; ++i) strip.x.push_back(std::min(pixels.width(), i * cell_px));
  std::vector<CellStatistics> cells;
  for (int j = 0; j < rows; ++j) {
    strip.y0 = j * cell_px;
    strip.y1 = std::min(pixels.height(), (j + 1) * cell_px);
    cells.assign(strip.cells(), CellStatistics{});
    measure(strip, cells);
    for (int i = 0; i < columns; ++i) {
      level.at(i, j) = cells[static_cast<std::size_t>(i)].level;
      noise.at(i, j) = cells[static_cast<std::size_t>(i)].noise;
    }
  }
  correct(level, noise);
  fill_unknown(level);
  fill_unknown(noise);
  smooth(noise, nullptr);
  smooth(level, &noise);
  for (float& v : noise.cells()) v = std::max(v, noise_least);
  return {Surface(std::move(level), cell_px), Surface(std::move(noise), cell_px)};
}

/// Catmull-Rom: exact for parabolas.
std::array<float, 4> cubic_weights(float t) {
  return {0.5F * t * (-1 + t * (2 - t)), 0.5F * (2 + t * t * (-5 + 3 * t)), 0.5F * t * (1 + t * (4 - 3 * t)),
          0.5F * t * t * (t - 1)};
}

struct Between {
  int first;
  float t;
};

Between between(float at, int cell_px) {
  const float u = (at + 0.5F) / static_cast<float>(cell_px) - 0.5F;
  const float floor = std::floor(u);
  return {static_cast<int>(floor), u - floor};
}

}  // namespace

float median_of(std::vector<float>& values) {
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

Middle middle_of(std::vector<float> values) {
  const float middle = median_of(values);
  for (float& v : values) v = std::abs(v - middle);
  return {double(middle), 1.4826 * double(median_of(values))};
}

int sky_cell_px(int width, int height) {
  return std::clamp(std::min(width, height) / 4, 16, 64);
}

/// Beyond the last centre the surface goes on as between the last two.
Surface::Surface(Plane nodes, int cell_px) : nodes_(std::move(nodes)), cell_px_(cell_px) {
  const int w = nodes_.width();
  const int h = nodes_.height();
  extended_ = Plane(w + 2 * beyond, h + 2 * beyond);
  const auto along = [](float last, float before, int steps) {
    return last + static_cast<float>(steps) * (last - before);
  };
  for (int j = 0; j < h; ++j) {
    float* row = extended_.row(j + beyond) + beyond;
    std::copy_n(nodes_.row(j), w, row);
    for (int k = 1; k <= beyond; ++k) {
      row[-k] = w > 1 ? along(row[0], row[1], k) : row[0];
      row[w - 1 + k] = w > 1 ? along(row[w - 1], row[w - 2], k) : row[0];
    }
  }
  for (int i = 0; i < extended_.width(); ++i) {
    const float first = extended_.at(i, beyond);
    const float last = extended_.at(i, beyond + h - 1);
    for (int k = 1; k <= beyond; ++k) {
      extended_.at(i, beyond - k) = h > 1 ? along(first, extended_.at(i, beyond + 1), k) : first;
      extended_.at(i, beyond + h - 1 + k) = h > 1 ? along(last, extended_.at(i, beyond + h - 2), k) : last;
    }
  }
}

Surface Surface::at_least(float value) const {
  Plane nodes = nodes_;
  for (float& v : nodes.cells()) v = std::max(v, value);
  return {std::move(nodes), cell_px_};
}

Surface Surface::times(const Surface& other) const {
  Plane nodes = nodes_;
  for (std::size_t i = 0; i < nodes.size(); ++i) nodes.cells()[i] *= other.nodes_.cells()[i];
  return {std::move(nodes), cell_px_};
}

void Surface::row(int y, std::vector<float>& out) const {
  const auto [j, ty] = between(static_cast<float>(y), cell_px_);
  const auto wy = cubic_weights(ty);
  // Nodes i - 1 .. i + 2 surround what lies between centres i and i + 1.
  std::vector<float> line(static_cast<std::size_t>(extended_.width()), 0.0F);
  for (int k = 0; k < 4; ++k) {
    const float* nodes = extended_.row(std::clamp(j - 1 + k + beyond, 0, extended_.height() - 1));
    for (std::size_t i = 0; i < line.size(); ++i) line[i] += wy[static_cast<std::size_t>(k)] * nodes[i];
  }
  // One cubic from centre to centre, as a polynomial.
  const int width = static_cast<int>(out.size());
  const float unit = 1.0F / static_cast<float>(cell_px_);
  for (int x = 0; x < width;) {
    const auto [i, start] = between(static_cast<float>(x), cell_px_);
    const float* p = line.data() + std::clamp(i - 1 + beyond, 0, extended_.width() - 4);
    const std::array<float, 4> cubic{p[1], 0.5F * (p[2] - p[0]), p[0] - 2.5F * p[1] + 2 * p[2] - 0.5F * p[3],
                                     0.5F * (p[3] - p[0]) + 1.5F * (p[1] - p[2])};
    const int end = std::min(width, x + std::max(1, static_cast<int>(std::ceil((1 - start) / unit - 1e-3F))));
    fill_cubic(cubic.data(), start, unit, out.data() + x, end - x);
    x = end;
  }
}

float Surface::at(double x, double y) const {
  const auto [i, tx] = between(static_cast<float>(x), cell_px_);
  const auto [j, ty] = between(static_cast<float>(y), cell_px_);
  const auto node = [&](int column, int row) {
    return extended_.at(std::clamp(column + beyond, 0, extended_.width() - 1),
                        std::clamp(row + beyond, 0, extended_.height() - 1));
  };
  const float top = node(i, j) * (1 - tx) + node(i + 1, j) * tx;
  const float bottom = node(i, j + 1) * (1 - tx) + node(i + 1, j + 1) * tx;
  return top * (1 - ty) + bottom * ty;
}

SkyLevel measure_sky(const Plane& pixels, float lowest, float noise_least) {
  std::vector<std::vector<float>> samples;
  std::vector<std::optional<CutCell>> cut;
  const auto measure = [&](const Strip& strip, std::vector<CellStatistics>& cells) {
    take_samples(pixels, strip, samples);
    for (std::size_t i = 0; i < cells.size(); ++i) {
      cells[i] = first_guess(samples[i], noise_least).value_or(CellStatistics{});
      cut.push_back(of_cut_sky(pixels, strip, i, samples[i], lowest, noise_least));
    }
    settle(cells, pixels, nullptr, strip, noise_least, true);
  };
  // Only where most of the frame is noise: of pictures that were made dark, what is left is light.
  const auto correct = [&](Plane& level, Plane& noise) {
    const auto noisy = std::count_if(cut.begin(), cut.end(), [](const auto& c) { return c && c->is_noise; });
    if (2 * noisy <= std::ssize(cut)) return;
    for (std::size_t i = 0; i < cut.size(); ++i) {
      if (cut[i]) level.cells()[i] = cut[i]->is.level, noise.cells()[i] = cut[i]->is.noise;
    }
  };
  return measure_strips(pixels, noise_least, measure, correct);
}

SkyLevel measure_flattened(const Plane& signal, const Grid<std::uint8_t>* masked) {
  constexpr float least = 0.05F;
  const bool filtered = masked == nullptr;  // every row is like the next
  const auto measure = [&](const Strip& strip, std::vector<CellStatistics>& cells) {
    std::fill(cells.begin(), cells.end(), CellStatistics{0, 1});
    settle(cells, signal, masked, strip, least, filtered);
  };
  return measure_strips(signal, least, measure, [](Plane&, Plane&) {});
}

}  // namespace srfs::image
