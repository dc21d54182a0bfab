#include "image/clean_frame.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include <fmt/format.h>

namespace srfs::image {
namespace {

constexpr float nan_f = std::numeric_limits<float>::quiet_NaN();

struct Range {
  float low = std::numeric_limits<float>::infinity();
  float high = -std::numeric_limits<float>::infinity();
  std::size_t at_high = 0;
};

Range range_of(const Plane& pixels) {
  Range range;
  for (const float v : pixels.cells()) {
    if (!std::isfinite(v)) continue;
    range.low = std::min(range.low, v);
    if (v > range.high) range.high = v, range.at_high = 0;
    if (v == range.high) ++range.at_high;
  }
  return range;
}

/// A plateau at the top: pixels of the highest value that touch, well above the sky.
bool has_plateau(const Plane& pixels, float high) {
  int pairs = 0;
  for (int y = 0; y < pixels.height(); ++y) {
    const float* row = pixels.row(y);
    for (int x = 0; x + 1 < pixels.width(); ++x) {
      if (row[x] == high && row[x + 1] == high && ++pairs >= 3) return true;
    }
  }
  return false;
}

/// How far a column or row is off its neighbours, in noise: the middle of what its pieces say, so that a
/// streak along it, shorter than half of it, says nothing.
struct LineOffset {
  float value = 0;
  float error = 0;
};

constexpr int pieces = 8;       ///< of a column or row
constexpr int around_px = 8;    ///< columns or rows on each side that an offset is measured against
constexpr float used_most = 3;  ///< pixels further from the sky do not count, in noise

/// @param sums, counts  of each line's pixels within used_most, piece by piece
std::vector<LineOffset> line_offsets(const Plane& sums, const Plane& counts) {
  const int lines = sums.width();
  Plane offsets(lines, pieces);
  for (int k = 0; k < pieces; ++k) {
    float sum = 0;
    float n = 0;
    for (int i = 0; i < std::min(lines, around_px); ++i) sum += sums.at(i, k), n += counts.at(i, k);
    for (int i = 0; i < lines; ++i) {
      if (i + around_px < lines) sum += sums.at(i + around_px, k), n += counts.at(i + around_px, k);
      if (i > around_px) sum -= sums.at(i - around_px - 1, k), n -= counts.at(i - around_px - 1, k);
      const float others = std::max(1.0F, n - counts.at(i, k));
      offsets.at(i, k) = sums.at(i, k) / std::max(1.0F, counts.at(i, k)) - (sum - sums.at(i, k)) / others;
    }
  }
  std::vector<LineOffset> result(static_cast<std::size_t>(lines));
  std::vector<float> of_line(pieces);
  for (int i = 0; i < lines; ++i) {
    float n = 0;
    for (int k = 0; k < pieces; ++k)
      of_line[static_cast<std::size_t>(k)] = offsets.at(i, k), n += counts.at(i, k);
    std::sort(of_line.begin(), of_line.end());
    // The mean of the four in the middle scatters by 1.1 of what the mean of all does.
    const float middle = (of_line[2] + of_line[3] + of_line[4] + of_line[5]) / 4;
    result[static_cast<std::size_t>(i)] = {middle, n > 30 ? 1.13F / std::sqrt(n) : 1e9F};
  }
  return result;
}

/// What to take away from each line: only where it is more than the pixels' noise makes. @return whether any
bool keep_significant(std::vector<LineOffset>& lines) {
  std::vector<float> scaled;
  for (const LineOffset& l : lines) {
    if (l.error < 1) scaled.push_back(std::abs(l.value) / l.error);
  }
  // 1 within a random error: 0.6745 is the median of a normal distribution's size.
  const bool pattern = scaled.size() > 16 && median_of(scaled) > 1.35F * 0.6745F;
  bool any = false;
  for (LineOffset& l : lines) {
    const bool alone = std::abs(l.value) > 6 * l.error;  // a defect column in a good sensor
    if (!((pattern || alone) && l.error < 1)) l.value = 0;
    any = any || l.value != 0;
  }
  return any;
}

void remove_fixed_pattern(Plane& signal) {
  const int w = signal.width();
  const int h = signal.height();
  if (w < 64 || h < 64) return;
  Plane column_sums(w, pieces);
  Plane column_counts(w, pieces);
  Plane row_sums(h, pieces);
  Plane row_counts(h, pieces);
  for (int y = 0; y < h; ++y) {
    const float* row = signal.row(y);
    float* sums = column_sums.row(y * pieces / h);
    float* counts = column_counts.row(y * pieces / h);
    for (int k = 0; k < pieces; ++k) {
      float row_sum = 0;
      float row_n = 0;
      for (int x = k * w / pieces; x < (k + 1) * w / pieces; ++x) {
        const float used = std::abs(row[x]) < used_most ? 1.0F : 0.0F;
        const float value = used > 0 ? row[x] : 0.0F;
        sums[x] += value;
        counts[x] += used;
        row_sum += value;
        row_n += used;
      }
      row_sums.at(y, k) = row_sum;
      row_counts.at(y, k) = row_n;
    }
  }
  std::vector<LineOffset> columns = line_offsets(column_sums, column_counts);
  std::vector<LineOffset> rows = line_offsets(row_sums, row_counts);
  const bool by_column = keep_significant(columns);
  const bool by_row = keep_significant(rows);
  if (!by_column && !by_row) return;
  for (int y = 0; y < h; ++y) {
    float* row = signal.row(y);
    const float offset = rows[static_cast<std::size_t>(y)].value;
    for (int x = 0; x < w; ++x) row[x] -= offset + columns[static_cast<std::size_t>(x)].value;
  }
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

  /// Twice, since a neighbour in a track hides it the first time. @return how many
  int replace(Plane& signal, Grid<std::uint8_t>& flaws) const {
    int found = 0;
    for (int round = 0; round < 3; ++round) {
      const std::vector<std::pair<int, int>> spikes = find(signal, flaws);
      for (const auto& [x, y] : spikes) flaws.at(x, y) |= flaw_spike;
      for (const auto& [x, y] : spikes) signal.at(x, y) = mean_around(signal, flaws, x, y);
      found += static_cast<int>(spikes.size());
      if (spikes.empty()) break;
    }
    return found;
  }

 private:
  [[nodiscard]] std::vector<std::pair<int, int>> find(const Plane& signal,
                                                      const Grid<std::uint8_t>& flaws) const {
    std::vector<std::pair<int, int>> spikes;
    const float least = std::min(threshold_pair_, threshold_cross_);
    const int w = signal.width();
    const int h = signal.height();
    for (int y = 0; y < h; ++y) {
      const float* row = signal.row(y);
      const float* above = signal.row(y > 0 ? y - 1 : std::min(1, h - 1));
      const float* below = signal.row(y + 1 < h ? y + 1 : std::max(0, h - 2));
      for (int x = 0; x < w; ++x) {
        const float v = row[x];
        if (v < least || flaws.at(x, y) != 0) continue;
        const float left = row[x > 0 ? x - 1 : std::min(1, w - 1)];
        const float right = row[x + 1 < w ? x + 1 : std::max(0, w - 2)];
        const float horizontal = std::max(0.0F, (left + right) / 2);
        const float vertical = std::max(0.0F, (above[x] + below[x]) / 2);
        const float shot = 1 + 0.02F * v;  // bright pixels scatter more
        if (v - ratio_ * std::min(horizontal, vertical) > threshold_pair_ * shot ||
            v - ratio_ * (horizontal + vertical) / 2 > threshold_cross_ * shot)
          spikes.emplace_back(x, y);
      }
    }
    return spikes;
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

float median_node(const Surface& surface) {
  std::vector<float> nodes = surface.nodes().cells();
  return median_of(nodes);
}

}  // namespace

CleanFrame clean_frame(const Frame& frame, FrameFindings& findings) {
  const Plane& in = frame.pixels;
  CleanFrame out;
  out.signal = in;
  out.flaws = Grid<std::uint8_t>(in.width(), in.height());
  const Range range = range_of(in);
  const float span = range.high >= range.low ? range.high - range.low : 0;
  float saturation = std::numeric_limits<float>::infinity();
  if (frame.saturation_adu)
    saturation = *frame.saturation_adu;
  else if (span > 0 && has_plateau(in, range.high))
    saturation = range.high;

  for (std::size_t i = 0; i < in.size(); ++i) {
    const float v = in.cells()[i];
    if (!std::isfinite(v)) {
      out.signal.cells()[i] = nan_f;
      out.flaws.cells()[i] |= flaw_invalid;
      ++findings.invalid;
    } else if (v >= saturation) {
      out.flaws.cells()[i] |= flaw_saturated;
      ++findings.saturated;
    }
  }
  // Equally spaced values have at least the noise of their rounding.
  // Equal values have the noise of their float representation.
  const float noise_least = std::max({0.4F * frame.step,
                                      span >= 0 && range.high >= range.low
                                          ? 3e-6F * std::max(std::abs(range.low), std::abs(range.high))
                                          : 0.0F,
                                      std::numeric_limits<float>::min() * 1e6F});
  SkyLevel sky = measure_sky(out.signal, sky_cell_px(in.width(), in.height()), noise_least);
  std::vector<float> level(static_cast<std::size_t>(in.width()));
  std::vector<float> noise(static_cast<std::size_t>(in.width()));
  const float noise_floor = std::max(noise_least, 0.2F * median_node(sky.noise));
  for (int y = 0; y < in.height(); ++y) {
    sky.level.row(y, level);
    sky.noise.row(y, noise);
    float* row = out.signal.row(y);
    for (std::size_t x = 0; x < level.size(); ++x) {
      const float v = (row[x] - level[x]) / std::max(noise[x], noise_floor);
      row[x] = v == v ? v : 0;  // NaN is sky
    }
  }
  remove_fixed_pattern(out.signal);
  findings.background = double(median_node(sky.level));
  findings.noise = double(median_node(sky.noise));
  for (float& v : sky.noise.nodes().cells()) v = std::max(v, noise_floor);
  out.noise_adu = std::move(sky.noise);

  if (auto psf = measure_psf(out.signal, out.flaws)) {
    out.psf = *std::move(psf);
    out.psf_measured = true;
    findings.fwhm_px = out.psf.fwhm_px();
  }
  findings.spikes =
      SpikeFinder(out.psf_measured ? out.psf : Psf::round_gaussian(1.6)).replace(out.signal, out.flaws);

  const auto all = static_cast<double>(in.size());
  if (findings.invalid > 0)
    findings.notes.push_back(fmt::format("{} pixels without a value", findings.invalid));
  if (findings.invalid == static_cast<int>(in.size()))
    findings.notes.emplace_back("no pixel has a value");
  else if (span == 0)
    findings.notes.push_back(fmt::format("every pixel is {}: nothing can be found", range.high));
  if (findings.saturated > 0.01 * all)
    findings.notes.push_back(
        fmt::format("{:.0f} % of the pixels are saturated", 100 * findings.saturated / all));
  if (!out.psf_measured)
    findings.notes.emplace_back("too few bright stars to measure their width; 2.5 px assumed");
  return out;
}

}  // namespace srfs::image
