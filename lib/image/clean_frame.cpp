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

/// Mean of what lies within three noises, and of how many pixels.
struct LineMean {
  double sum = 0;
  int n = 0;
  [[nodiscard]] float mean() const { return n > 0 ? static_cast<float>(sum / n) : 0; }
};

/// Offsets that columns or rows have beside their neighbours: fixed pattern, not sky. Taken away only where
/// it is more than the pixels' noise makes.
bool remove_line_offsets(std::vector<LineMean>& lines) {
  std::vector<float> offsets;
  offsets.reserve(lines.size());
  std::vector<float> scaled;
  for (std::size_t i = 0; i < lines.size(); ++i) {
    std::vector<float> around;
    for (std::size_t k = i >= 8 ? i - 8 : 0; k <= std::min(lines.size() - 1, i + 8); ++k)
      around.push_back(lines[k].mean());
    offsets.push_back(lines[i].mean() - median_of(around));
    if (lines[i].n > 30)
      scaled.push_back(std::abs(offsets.back()) * std::sqrt(static_cast<float>(lines[i].n)));
  }
  // 1 within a random error: 0.6745 is the median of a normal distribution's size.
  const bool pattern = scaled.size() > 16 && median_of(scaled) > 1.35F * 0.6745F;
  for (std::size_t i = 0; i < lines.size(); ++i) {
    const float error = 1 / std::sqrt(static_cast<float>(std::max(1, lines[i].n)));
    const bool alone = std::abs(offsets[i]) > 6 * error;  // a defect column in a good sensor
    lines[i].sum = (pattern || alone) && lines[i].n > 30 ? double(offsets[i]) : 0.0;
    lines[i].n = 1;
  }
  return std::any_of(lines.begin(), lines.end(), [](const LineMean& l) { return l.sum != 0; });
}

void remove_fixed_pattern(Plane& signal) {
  if (signal.width() < 64 || signal.height() < 64) return;
  std::vector<LineMean> columns(static_cast<std::size_t>(signal.width()));
  std::vector<LineMean> rows(static_cast<std::size_t>(signal.height()));
  std::vector<float> column_sum(columns.size(), 0.0F);
  std::vector<float> column_n(columns.size(), 0.0F);
  for (int y = 0; y < signal.height(); ++y) {
    const float* row = signal.row(y);
    float row_sum = 0;
    float row_n = 0;
    for (std::size_t x = 0; x < columns.size(); ++x) {
      const float v = row[x];
      const float used = std::abs(v) < 3.0F ? 1.0F : 0.0F;  // NaN: 0
      const float value = used > 0 ? v : 0.0F;
      column_sum[x] += value;
      column_n[x] += used;
      row_sum += value;
      row_n += used;
    }
    rows[static_cast<std::size_t>(y)] = {double(row_sum), static_cast<int>(row_n)};
  }
  for (std::size_t x = 0; x < columns.size(); ++x)
    columns[x] = {double(column_sum[x]), static_cast<int>(column_n[x])};
  const bool by_column = remove_line_offsets(columns);
  const bool by_row = remove_line_offsets(rows);
  if (!by_column && !by_row) return;
  for (int y = 0; y < signal.height(); ++y) {
    float* row = signal.row(y);
    const float offset = static_cast<float>(rows[static_cast<std::size_t>(y)].sum);
    for (std::size_t x = 0; x < columns.size(); ++x) row[x] -= offset + static_cast<float>(columns[x].sum);
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
