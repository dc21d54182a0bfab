// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "image/clean_frame.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <optional>

#include <fmt/format.h>

#include "image/rows.hpp"

namespace srfs::image {
namespace {

/// Values that are finite, over the whole frame.
struct Range {
  float low = std::numeric_limits<float>::infinity();
  float high = -std::numeric_limits<float>::infinity();
  bool all_finite = true;
  /// Of so many rows each, at most `groups_most` of them: the highest value, infinity where one has none.
  int rows_of_group = 1;
  std::vector<float> highest;

  static constexpr int groups_most = 4096;
  [[nodiscard]] float span() const { return high >= low ? high - low : 0; }
  [[nodiscard]] float highest_near(int row) const {
    return highest[static_cast<std::size_t>(row / rows_of_group)];
  }
};

Range range_of(const Plane& pixels) {
  constexpr float infinite = std::numeric_limits<float>::infinity();
  Range range;
  range.rows_of_group = pixels.height() / Range::groups_most + 1;
  for (int y = 0; y < pixels.height(); ++y) {
    const Extent row = extent_of(pixels.row(y), pixels.width());
    if (row.low <= row.high) {
      range.low = std::min(range.low, row.low);
      range.high = std::max(range.high, row.high);
    }
    range.all_finite = range.all_finite && row.all_finite;
    if (y % range.rows_of_group == 0) range.highest.push_back(-infinite);
    range.highest.back() = std::max(range.highest.back(), row.all_finite ? row.high : infinite);
  }
  return range;
}

/// A pixel so near a plateau at the top belongs to it: response bends before it ends, and JPEG's plateaus are
/// uneven.
constexpr float plateau_share = 0.04F;

/// A plateau at the top: pixels of the highest value that touch, well above the sky.
bool has_plateau(const Plane& pixels, const Range& range) {
  const float below = std::nextafter(range.high, -std::numeric_limits<float>::infinity());
  std::vector<int> at;
  int pairs = 0;
  for (int y = 0; y < pixels.height(); ++y) {
    if (range.highest_near(y) < range.high) continue;
    find_above(pixels.row(y), below, pixels.width(), at);
    for (std::size_t i = 0; i + 1 < at.size(); ++i) {
      if (at[i + 1] == at[i] + 1 && ++pairs >= 3) return true;
    }
  }
  return false;
}

float median_node(const Surface& surface) {
  std::vector<float> nodes(surface.nodes().cells().begin(), surface.nodes().cells().end());
  return median_of(nodes);
}

/// How far a column or row is off its neighbours, in ADU: the middle of what its pieces say, so that a streak
/// along it, shorter than half of it, says nothing.
struct LineOffset {
  float value = 0;
  float error = std::numeric_limits<float>::infinity();
};

constexpr int pattern_least_px = 64;  ///< width and height of a frame whose pattern is looked for
constexpr int pieces = 8;             ///< of a column or row
/// Columns or rows on each side that an offset is measured against: the nearest tell a pattern from what the
/// sky's level left behind, many have little pattern on average.
constexpr int near_px = 8;
constexpr int around_px = 32;
constexpr float used_most = 3;  ///< pixels further from the sky do not count, in noise
/// What is left of large offsets, of which most pixels did not count, and of the neighbours' own.
constexpr int pattern_rounds = 3;

/// @param sums, counts  of each line's pixels within used_most, piece by piece, in noise
/// @param noise_adu  of the pieces
/// @param around  lines on each side
std::vector<LineOffset> line_offsets(const Plane& sums, const Plane& counts, const Plane& noise_adu,
                                     int around) {
  const int lines = sums.width();
  Plane offsets(lines, pieces);
  for (int k = 0; k < pieces; ++k) {
    float sum = 0;
    float n = 0;
    for (int i = 0; i < std::min(lines, around); ++i) sum += sums.at(i, k), n += counts.at(i, k);
    for (int i = 0; i < lines; ++i) {
      if (i + around < lines) sum += sums.at(i + around, k), n += counts.at(i + around, k);
      if (i > around) sum -= sums.at(i - around - 1, k), n -= counts.at(i - around - 1, k);
      const float others = std::max(1.0F, n - counts.at(i, k));
      const float off = sums.at(i, k) / std::max(1.0F, counts.at(i, k)) - (sum - sums.at(i, k)) / others;
      offsets.at(i, k) = off * noise_adu.at(i, k);
    }
  }
  std::vector<LineOffset> result(static_cast<std::size_t>(lines));
  std::vector<float> of_line(pieces);
  for (int i = 0; i < lines; ++i) {
    float n = 0;
    float noise = 0;
    for (int k = 0; k < pieces; ++k) {
      of_line[static_cast<std::size_t>(k)] = offsets.at(i, k);
      n += counts.at(i, k);
      noise += noise_adu.at(i, k) / pieces;
    }
    std::sort(of_line.begin(), of_line.end());
    LineOffset& line = result[static_cast<std::size_t>(i)];
    // The mean of the four in the middle scatters by 1.1 of what the mean of all does.
    line.value = (of_line[2] + of_line[3] + of_line[4] + of_line[5]) / 4;
    if (n > 30) line.error = 1.13F * noise / std::sqrt(n);
  }
  return result;
}

/// Whether most lines are off by more than the pixels' noise makes.
bool is_pattern(const std::vector<LineOffset>& lines) {
  std::vector<float> scaled;
  for (const LineOffset& l : lines) {
    if (std::isfinite(l.error)) scaled.push_back(std::abs(l.value) / l.error);
  }
  // 1 within a random error: 0.6745 is the median of a normal distribution's size.
  return scaled.size() > 16 && median_of(scaled) > 1.35F * 0.6745F;
}

/// What to take away from each line: of a pattern all that is known, else of those that stand out.
/// @return whether any
bool keep_significant(std::vector<LineOffset>& lines, bool pattern) {
  bool any = false;
  for (LineOffset& l : lines) {
    const bool alone = std::abs(l.value) > 6 * l.error;  // a defect column in a good sensor
    if (!((pattern || alone) && std::isfinite(l.error))) l.value = 0;
    any = any || l.value != 0;
  }
  return any;
}

/// Sums of the pixels near the sky, by pieces of columns and rows.
class PatternSums {
 public:
  PatternSums(int width, int height)
      : column_sums_(width, pieces),
        column_counts_(width, pieces),
        row_sums_(height, pieces),
        row_counts_(height, pieces) {}

  void add(int y, const float* row) {
    const int w = width();
    const int piece = y * pieces / height();
    for (int k = 0; k < pieces; ++k) {
      const int from = k * w / pieces;
      const Moments m = add_near_zero(row + from, used_most, column_sums_.row(piece) + from,
                                      column_counts_.row(piece) + from, (k + 1) * w / pieces - from);
      row_sums_.at(y, k) = m.sum;
      row_counts_.at(y, k) = m.n;
    }
  }
  /// @param noise_least  of the surface, which goes on below its nodes beyond the last ones
  [[nodiscard]] std::vector<LineOffset> of_columns(const Surface& noise_adu, float noise_least,
                                                   int around) const {
    Plane noise(width(), pieces);
    for (int k = 0; k < pieces; ++k) {
      for (int x = 0; x < width(); ++x)
        noise.at(x, k) = std::max(noise_adu.at(x, middle_of(k, height())), noise_least);
    }
    return line_offsets(column_sums_, column_counts_, noise, around);
  }
  [[nodiscard]] std::vector<LineOffset> of_rows(const Surface& noise_adu, float noise_least,
                                                int around) const {
    Plane noise(height(), pieces);
    for (int k = 0; k < pieces; ++k) {
      for (int y = 0; y < height(); ++y)
        noise.at(y, k) = std::max(noise_adu.at(middle_of(k, width()), y), noise_least);
    }
    return line_offsets(row_sums_, row_counts_, noise, around);
  }

 private:
  [[nodiscard]] int width() const { return column_sums_.width(); }
  [[nodiscard]] int height() const { return row_sums_.width(); }
  static double middle_of(int piece, int size) { return (piece + 0.5) * size / pieces; }

  Plane column_sums_;
  Plane column_counts_;
  Plane row_sums_;
  Plane row_counts_;
};

/// Takes the sky away and makes the noise 1. @p out may be @p in. @param sums  get the pixels of the result
void to_noise(const Plane& in, const SkyLevel& sky, float noise_floor, Plane& out, PatternSums* sums) {
  std::vector<float> level(static_cast<std::size_t>(in.width()));
  std::vector<float> noise(level.size());
  for (int y = 0; y < in.height(); ++y) {
    sky.level.row(y, level);
    if (y % noise_rows == 0) sky.noise.row(std::min(in.height() - 1, y + noise_rows / 2), noise);
    normalise(in.row(y), level.data(), noise.data(), noise_floor, out.row(y), in.width());
    if (sums != nullptr) sums->add(y, out.row(y));
  }
}

/// The pattern was part of what the noise was measured from. Where there is none at all (black corners) it is
/// not made so by division.
/// @param noise_floor  ADU: rounding makes as much in a sky of few values, though most of them are equal
void normalise_again(float noise_floor, CleanFrame& frame) {
  constexpr float least_share = 0.7F;
  SkyLevel left = measure_flattened(frame.signal, &frame.flaws);
  const float least = std::max(least_share * median_node(left.noise),
                               std::min(1.0F, noise_floor / median_node(frame.noise_adu)));
  left.noise = left.noise.at_least(least);
  to_noise(frame.signal, left, least, frame.signal, nullptr);
  frame.noise_adu = frame.noise_adu.times(left.noise);
}

/// @param sums  of the frame as it is
/// @param noise_floor  of the frame, ADU
void remove_fixed_pattern(PatternSums sums, float noise_floor, CleanFrame& frame) {
  const int w = frame.signal.width();
  const int h = frame.signal.height();
  std::vector<LineOffset> columns = sums.of_columns(frame.noise_adu, noise_floor, near_px);
  std::vector<LineOffset> rows = sums.of_rows(frame.noise_adu, noise_floor, near_px);
  const bool of_columns = is_pattern(columns);
  const bool of_rows = is_pattern(rows);
  std::vector<float> offsets(static_cast<std::size_t>(w));
  std::vector<float> noise(offsets.size());
  // Where there is no light (black corners) there is no noise, and no pattern.
  const float noise_least = 0.5F * median_node(frame.noise_adu);
  for (int round = 0; round < pattern_rounds; ++round) {
    if (of_columns || round > 0)
      columns = sums.of_columns(frame.noise_adu, noise_floor, of_columns ? around_px : near_px);
    if (of_rows || round > 0)
      rows = sums.of_rows(frame.noise_adu, noise_floor, of_rows ? around_px : near_px);
    const bool by_column = keep_significant(columns, of_columns);
    const bool by_row = keep_significant(rows, of_rows);
    if (!by_column && !by_row) break;
    for (int y = 0; y < h; ++y) {
      if (y % noise_rows == 0) frame.noise_adu.row(std::min(h - 1, y + noise_rows / 2), noise);
      const float row = rows[static_cast<std::size_t>(y)].value;
      for (std::size_t x = 0; x < offsets.size(); ++x)
        offsets[x] = (row + columns[x].value) / std::max(noise[x], noise_least);
      subtract(frame.signal.row(y), offsets.data(), w);
    }
    if (round + 1 == pattern_rounds || !(of_columns || of_rows)) break;
    sums = PatternSums(w, h);
    for (int y = 0; y < h; ++y) sums.add(y, frame.signal.row(y));
  }
  if (of_columns || of_rows) normalise_again(noise_floor, frame);
}

/// Nothing in the sky is dark: cells with so many pixels this far below its level show the edge of a tree, of
/// a roof, of the lit part of the detector. The level is right on neither side of it.
constexpr float dark_limit = -3.5F;
constexpr double dark_most = 0.06;
/// So many rows and columns of a square that are dark throughout are dead ones.
constexpr int dead_lines_most = 2;

/// Whether a square shows an edge of something dark.
bool has_dark_edge(const Plane& signal, const Grid<std::uint8_t>& flaws, int x0, int y0, int x1, int y1) {
  std::array<int, no_sky_cell_px> of_row{};
  std::array<int, no_sky_cell_px> of_column{};
  const auto is_dark = [&](int x, int y) {
    return signal.at(x, y) < dark_limit && (flaws.at(x, y) & flaw_invalid) == 0;
  };
  for (int y = y0; y < y1; ++y) {
    for (int x = x0; x < x1; ++x) {
      const int dark = is_dark(x, y) ? 1 : 0;
      of_row[static_cast<std::size_t>(y - y0)] += dark;
      of_column[static_cast<std::size_t>(x - x0)] += dark;
    }
  }
  const auto dead_of = [](const auto& lines, int length) {
    const auto dead = std::count_if(lines.begin(), lines.end(), [&](int n) { return 10 * n >= 9 * length; });
    return dead <= dead_lines_most ? 9 * length : std::numeric_limits<int>::max();
  };
  const int dead_row = dead_of(of_row, x1 - x0);
  const int dead_column = dead_of(of_column, y1 - y0);
  int count = 0;
  for (int y = y0; y < y1; ++y) {
    if (10 * of_row[static_cast<std::size_t>(y - y0)] >= dead_row) continue;
    for (int x = x0; x < x1; ++x)
      count += is_dark(x, y) && 10 * of_column[static_cast<std::size_t>(x - x0)] < dead_column;
  }
  return count > dark_most * no_sky_cell_px * no_sky_cell_px;
}

/// Marks such squares. @return the share of the frame
double mark_what_is_no_sky(const Plane& signal, Grid<std::uint8_t>& flaws) {
  const int w = signal.width();
  const int h = signal.height();
  double hidden = 0;
  for (int y0 = 0; y0 < h; y0 += no_sky_cell_px) {
    const int y1 = std::min(h, y0 + no_sky_cell_px);
    for (int x0 = 0; x0 < w; x0 += no_sky_cell_px) {
      const int x1 = std::min(w, x0 + no_sky_cell_px);
      int dark = 0;
      for (int y = y0; y < y1; ++y) dark += count_below(signal.row(y) + x0, dark_limit, x1 - x0);
      if (dark <= dark_most * no_sky_cell_px * no_sky_cell_px) continue;  // of nearly all
      if (!has_dark_edge(signal, flaws, x0, y0, x1, y1)) continue;
      for (int y = y0; y < y1; ++y) {
        for (int x = x0; x < x1; ++x) flaws.at(x, y) |= flaw_no_sky, ++hidden;
      }
    }
  }
  return hidden / static_cast<double>(signal.size());
}

/// Finds pixels sharper than the optics allow. Of a Gaussian, the mean of two opposite neighbours is nowhere
/// less than exp(-d^2 / 2 sigma^2) of the pixel between them, in whatever direction, so neither of a star nor
/// of a streak.
class SpikeFinder {
 public:
  explicit SpikeFinder(const Psf& psf) {
    const auto& k = psf.shape();
    const double g = k.gamma;
    // The steepest fall over a pixel is along the shorter axis; a tenth is for what the model lacks.
    const double half_difference = std::hypot((k.a - k.c) / 2, k.b);
    const double steepest = (k.a + k.c) / 2 + half_difference;
    const double side = g < 1e-3 ? std::exp(-steepest) : std::pow(1 + g * steepest, -1 / g);
    ratio_ = static_cast<float>(1.1 / side);
    threshold_pair_ = 5 * std::sqrt(1 + ratio_ * ratio_ / 2);
    threshold_cross_ = 4.5F * std::sqrt(1 + ratio_ * ratio_ / 4);
  }

  /// Three times, since a neighbour in a track hides it the first time. @return what it replaced
  [[nodiscard]] std::vector<Spike> replace(Plane& signal, Grid<std::uint8_t>& flaws) const {
    std::vector<Place> bright = bright_places(signal);
    std::vector<Spike> found;
    for (int round = 0; round < 3; ++round) {
      std::vector<Place> spikes;
      for (const Place& p : bright) {
        if (flaws.at(p.x, p.y) == 0 && is_spike(signal, p)) spikes.push_back(p);
      }
      for (const Place& p : spikes) {
        flaws.at(p.x, p.y) |= flaw_spike;
        found.push_back({p.x, p.y, signal.at(p.x, p.y)});
      }
      for (const Place& p : spikes) signal.at(p.x, p.y) = mean_around(signal, flaws, p.x, p.y);
      if (spikes.empty()) break;
    }
    return found;
  }

 private:
  struct Place {
    int x, y;
  };

  [[nodiscard]] std::vector<Place> bright_places(const Plane& signal) const {
    std::vector<Place> places;
    std::vector<int> at;
    for (int y = 0; y < signal.height(); ++y) {
      find_above(signal.row(y), std::min(threshold_pair_, threshold_cross_), signal.width(), at);
      for (const int x : at) places.push_back({x, y});
    }
    return places;
  }

  [[nodiscard]] bool is_spike(const Plane& signal, const Place& p) const {
    const int w = signal.width();
    const int h = signal.height();
    const float* row = signal.row(p.y);
    const float above = signal.at(p.x, p.y > 0 ? p.y - 1 : std::min(1, h - 1));
    const float below = signal.at(p.x, p.y + 1 < h ? p.y + 1 : std::max(0, h - 2));
    const float left = row[p.x > 0 ? p.x - 1 : std::min(1, w - 1)];
    const float right = row[p.x + 1 < w ? p.x + 1 : std::max(0, w - 2)];
    const float horizontal = std::max(0.0F, (left + right) / 2);
    const float vertical = std::max(0.0F, (above + below) / 2);
    const float v = row[p.x];
    const float shot = 1 + 0.02F * v;  // bright pixels scatter more
    return v - ratio_ * std::min(horizontal, vertical) > threshold_pair_ * shot ||
           v - ratio_ * (horizontal + vertical) / 2 > threshold_cross_ * shot;
  }

  static float mean_around(const Plane& signal, const Grid<std::uint8_t>& flaws, int x, int y) {
    float sum = 0;
    int n = 0;
    for (int j = y - 1; j <= y + 1; ++j) {
      for (int i = x - 1; i <= x + 1; ++i) {
        if (!signal.contains(i, j) || flaws.at(i, j) != 0) continue;
        sum += signal.at(i, j);
        ++n;
      }
    }
    return n > 0 ? sum / static_cast<float>(n) : 0;
  }

  float ratio_;
  float threshold_pair_;
  float threshold_cross_;
};

void mark_flaws(const Plane& in, const Range& range, float saturation, Grid<std::uint8_t>& flaws,
                FrameFindings& findings) {
  if (range.all_finite && range.high < saturation) return;
  for (int y = 0; y < in.height(); ++y) {
    if (range.highest_near(y) < saturation) continue;
    for (int x = 0; x < in.width(); ++x) {
      const float v = in.at(x, y);
      if (!std::isfinite(v)) {
        flaws.at(x, y) |= flaw_invalid;
        ++findings.invalid;
      } else if (v >= saturation) {
        flaws.at(x, y) |= flaw_saturated;
        ++findings.saturated;
      }
    }
  }
}

/// Darker pixels within saturated ones, and hardly darker ones at their edge, as JPEG makes them: they say as
/// little of the star.
void fill_saturated(const Plane& in, const Range& range, float saturation, float sky,
                    Grid<std::uint8_t>& flaws) {
  constexpr int around_least = 5;  // of eight: no straight edge has as many
  constexpr int within_least = 6;
  const float bright = saturation - 3 * plateau_share * std::max(0.0F, saturation - sky);
  const auto is_saturated = [&](int x, int y) { return (flaws.at(x, y) & flaw_saturated) != 0; };
  const auto judge = [&](int x, int y) {
    if (x < 1 || y < 1 || x + 1 >= flaws.width() || y + 1 >= flaws.height() || flaws.at(x, y) != 0) return;
    int around = 0;
    for (int j = -1; j <= 1; ++j)
      for (int i = -1; i <= 1; ++i) around += is_saturated(x + i, y + j);
    if (around >= (in.at(x, y) >= bright ? around_least : within_least)) flaws.at(x, y) |= flaw_saturated;
  };
  for (int y = 0; y < flaws.height(); ++y) {
    if (range.highest_near(y) < saturation) continue;
    for (int x = 0; x < flaws.width(); ++x) {
      if (!is_saturated(x, y)) continue;
      for (int j = -1; j <= 1; ++j)
        for (int i = -1; i <= 1; ++i) judge(x + i, y + j);
    }
  }
}

void add_notes(const Plane& in, const Range& range, FrameFindings& findings) {
  const auto all = static_cast<double>(in.size());
  if (findings.invalid > 0)
    findings.notes.push_back(fmt::format("{} pixels without a value", findings.invalid));
  if (findings.invalid == static_cast<int>(in.size()))
    findings.notes.emplace_back("no pixel has a value");
  else if (range.span() == 0)
    findings.notes.push_back(fmt::format("every pixel is {}: nothing can be found", range.high));
  if (findings.saturated > 0.01 * all)
    findings.notes.push_back(
        fmt::format("{:.0f} % of the pixels are saturated", 100 * findings.saturated / all));
}

/// Narrower than this no lens makes a star.
constexpr double narrowest_fwhm_px = 1.1;
/// A lens sharper than its pixels makes no brighter points wider than this.
constexpr double sharp_most_px = 1.6;
/// What is sharper than this share of the width of a few bright points is none.
constexpr double spike_share = 0.64;
/// For a few bright points of about the usual width, the usual one will do.
constexpr double usual_least_px = 1.9;
constexpr double usual_most_px = 3.3;

/// The frame's star shape: as given, as its stars show it, or as wide as its bright points.
/// @return what is sharper than any star's
Psf settle_psf(const CleanOptions& options, CleanFrame& frame, FrameFindings& findings) {
  if (options.fwhm_px > 0) {
    frame.psf = Psf::round_gaussian(options.fwhm_px);
    frame.psf_measured = true;
    findings.fwhm_px = options.fwhm_px;
    return frame.psf;
  }
  auto psf = measure_psf(frame.signal, frame.flaws, frame.no_sky > 0);
  const auto width = psf ? std::nullopt : width_of_brightest(frame.signal, frame.flaws, frame.no_sky > 0);
  if (!psf && (!width || *width < sharp_most_px)) {
    psf = measure_psf(frame.signal, frame.flaws, frame.no_sky > 0, Optics::sharper_than_pixels);
    frame.psf_unsure = psf.has_value();
  }
  if (psf) {
    frame.psf = *std::move(psf);
    frame.psf_measured = true;
    findings.fwhm_px = frame.psf.fwhm_px();
    return frame.psf;
  }
  if (width && (*width < usual_least_px || *width > usual_most_px)) frame.psf = Psf::round_gaussian(*width);
  findings.notes.push_back(fmt::format(
      "too few bright stars to measure their width; {:.1f} px taken{}; the parameter fwhm sets it",
      frame.psf.fwhm_px(), width ? fmt::format(" (brightest points: {:.1f} px)", *width) : ""));
  return Psf::round_gaussian(std::max(narrowest_fwhm_px, spike_share * frame.psf.fwhm_px()));
}

}  // namespace

CleanFrame clean_frame(const Frame& frame, FrameFindings& findings, const CleanOptions& options) {
  const Plane& in = frame.pixels;
  const Range range = range_of(in);
  // Equally spaced values have at least the noise of their rounding, equal ones that of their float
  // representation.
  const float largest = range.low <= range.high ? std::max(std::abs(range.low), std::abs(range.high)) : 0;
  const float noise_least =
      std::max({0.4F * frame.step, 3e-6F * largest, std::numeric_limits<float>::min() * 1e6F});
  const SkyLevel sky = measure_sky(in, range.low, noise_least);
  findings.background = double(median_node(sky.level));
  const auto sky_adu = static_cast<float>(findings.background);
  float saturation = std::numeric_limits<float>::infinity();
  if (frame.saturation_adu)
    saturation = *frame.saturation_adu;
  else if (range.span() > 0 && has_plateau(in, range))
    saturation = range.high - plateau_share * std::max(0.0F, range.high - sky_adu);
  CleanFrame out;
  out.flaws = Grid<std::uint8_t>(in.width(), in.height());
  mark_flaws(in, range, saturation, out.flaws, findings);
  if (findings.saturated > 0) fill_saturated(in, range, saturation, sky_adu, out.flaws);

  const float noise_floor = std::max(noise_least, 0.2F * median_node(sky.noise));
  std::optional<PatternSums> pattern;
  if (in.width() >= pattern_least_px && in.height() >= pattern_least_px)
    pattern.emplace(in.width(), in.height());
  out.signal = Plane::unset(in.width(), in.height());
  to_noise(in, sky, noise_floor, out.signal, pattern ? &*pattern : nullptr);
  out.noise_adu = sky.noise.at_least(noise_floor);
  if (pattern) remove_fixed_pattern(*std::move(pattern), noise_floor, out);
  findings.noise = double(median_node(out.noise_adu));

  out.no_sky = mark_what_is_no_sky(out.signal, out.flaws);
  if (out.no_sky > 0)
    findings.notes.push_back(fmt::format("{:.0f} % of the frame is not searched: dark edges without sky",
                                         std::ceil(100 * out.no_sky)));

  out.spikes = SpikeFinder(settle_psf(options, out, findings)).replace(out.signal, out.flaws);
  findings.spikes = static_cast<int>(out.spikes.size());
  add_notes(in, range, findings);
  return out;
}

}  // namespace srfs::image
