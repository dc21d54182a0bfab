// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "image/calibration.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

#include <fmt/format.h>

#include "image/background.hpp"

namespace srfs::image {
namespace {

constexpr float nothing = std::numeric_limits<float>::quiet_NaN();
/// A pixel is a defect where its dark is so many times as far from its neighbours' as a pixel's values are
/// from each other: its own noise is then several times theirs. Or where it responds to light by less or more
/// than these shares of what its neighbours do.
constexpr float defect_limit = 10;
constexpr float response_least = 0.5F;
constexpr float response_most = 1.5F;
/// Of the middle's light: what gets less says nothing, as in the corners that the optics leave dark.
constexpr float light_least = 0.05F;
/// Of the level: what adding up frames rounds.
constexpr float rounding = 1e-5F;
constexpr double same_exposure = 0.02;
constexpr double same_gain = 1e-3;
constexpr double same_temperature_k = 5;
/// So many pairs of the highest value are saturated, and what is so near to it.
constexpr int saturated_pairs = 3;
constexpr float saturated_share = 0.04F;

bool is_same_exposure(const std::optional<double>& a, const std::optional<double>& b) {
  if (!a || !b) return !a && !b;
  return std::abs(*a - *b) <= same_exposure * std::max(*a, *b);
}

/// Unknown ones are taken for near.
bool are_near(const std::optional<double>& a, const std::optional<double>& b, double tolerance) {
  return !a || !b || std::abs(*a - *b) <= tolerance;
}

float median_pixel(const Plane& pixels) {
  std::vector<float> some;
  const std::size_t step = std::max<std::size_t>(1, pixels.size() / 100'000);
  for (std::size_t i = 0; i < pixels.size(); i += step) {
    if (std::isfinite(pixels.cells()[i])) some.push_back(pixels.cells()[i]);
  }
  return some.empty() ? 0 : median_of(some);
}

/// As clean_frame sees it in a frame that was not calibrated: touching pixels of the highest value, and what
/// is within a small share of them. Where most pixels have the highest value, that: no light is without
/// noise.
std::optional<float> saturation_of(const Frame& frame) {
  if (frame.saturation_adu) return frame.saturation_adu;
  const Plane& in = frame.pixels;
  float highest = -std::numeric_limits<float>::infinity();
  for (const float v : in.cells()) highest = std::isfinite(v) ? std::max(highest, v) : highest;
  const float above_sky = highest - median_pixel(in);
  if (!(highest > 0)) return std::nullopt;
  int pairs = 0;
  for (int y = 0; y < in.height(); ++y) {
    for (int x = 1; x < in.width(); ++x) pairs += in.at(x - 1, y) == highest && in.at(x, y) == highest;
  }
  return pairs >= saturated_pairs ? std::optional(highest - saturated_share * above_sky) : std::nullopt;
}

bool is_stronger(const Defect& a, const Defect& b) {
  const double one = std::abs(a.level_adu);
  const double other = std::abs(b.level_adu);
  return one != other ? one > other : (a.y != b.y ? a.y < b.y : a.x < b.x);
}

/// Keeps the strongest.
void shorten(std::vector<Defect>& defects, std::size_t most) {
  if (defects.size() <= most) return;
  std::nth_element(defects.begin(), defects.begin() + static_cast<std::ptrdiff_t>(most), defects.end(),
                   is_stronger);
  defects.resize(most);
}

}  // namespace

const char* to_text(MasterKind kind) {
  return kind == MasterKind::dark ? "dark" : "flat";
}

DetectorSetting setting_of(const Frame& frame) {
  return {frame.pixels.width(), frame.pixels.height(), frame.exposure_s, frame.gain, frame.temperature_k};
}

std::string to_text(const DetectorSetting& setting) {
  std::string text = fmt::format("{} x {} px", setting.width, setting.height);
  if (setting.exposure_s) text += fmt::format(", {:.6g} s", *setting.exposure_s);
  if (setting.gain) text += fmt::format(", gain {:.4g}", *setting.gain);
  if (setting.temperature_k) text += fmt::format(", {:.0f} K", *setting.temperature_k);
  return text;
}

bool fits(MasterKind kind, const DetectorSetting& master, const DetectorSetting& frame) {
  if (master.width != frame.width || master.height != frame.height) return false;
  return kind == MasterKind::flat ||
         (is_same_exposure(master.exposure_s, frame.exposure_s) &&
          are_near(master.gain, frame.gain, same_gain) &&
          are_near(master.temperature_k, frame.temperature_k, same_temperature_k));
}

Result<void, Refusal> MasterMaker::add(const Frame& frame) {
  const Plane& in = frame.pixels;
  const DetectorSetting setting = setting_of(frame);
  if (frames_ >= frames_most)
    return Err(Refusal{fmt::format("more than {} frames in a master", frames_most)});
  if (frames_ > 0 && !fits(kind_, setting_, setting))
    return Err(Refusal{fmt::format("{} after frames of {}", to_text(setting), to_text(setting_))});
  const bool is_flat = kind_ == MasterKind::flat;
  const float middle = median_pixel(in);
  // A dark's own highest value says nothing: a quiet detector gives most pixels the same one.
  const auto saturation = is_flat ? saturation_of(frame) : frame.saturation_adu;
  if (std::none_of(in.cells().begin(), in.cells().end(), [](float v) { return std::isfinite(v); }))
    return Err(Refusal{fmt::format("no pixel has a value in a frame of a {}", to_text(kind_))});
  if (is_flat && !(middle > 0)) return Err(Refusal{"no light in a frame of a flat"});
  if (saturation && middle >= *saturation)
    return Err(
        Refusal{fmt::format("too much light in a frame of a {}: most of it is saturated", to_text(kind_))});
  if (frames_ == 0) {
    sum_ = Plane(in.width(), in.height());
    lowest_ = Plane(in.width(), in.height(), std::numeric_limits<float>::infinity());
    highest_ = Plane(in.width(), in.height(), -std::numeric_limits<float>::infinity());
    step_ = 0;
    setting_ = setting;
  }
  for (std::size_t i = 0; i < in.size(); ++i) {
    float v = in.cells()[i];
    if (is_flat) v = saturation && v >= *saturation ? nothing : v / middle;
    sum_.cells()[i] += v;
    lowest_.cells()[i] = std::min(lowest_.cells()[i], v);
    highest_.cells()[i] = std::max(highest_.cells()[i], v);
  }
  step_ = std::max(step_, frame.step);
  ++frames_;
  return {};
}

float MasterMaker::average() {
  std::vector<float> ranges;
  for (std::size_t i = 0; i < sum_.size(); ++i) {
    const float low = lowest_.cells()[i];
    const float high = highest_.cells()[i];
    sum_.cells()[i] = (sum_.cells()[i] - low - high) / static_cast<float>(frames_ - 2);
    if (i % 7 == 0 && std::isfinite(sum_.cells()[i])) ranges.push_back(high - low);
  }
  lowest_ = highest_ = {};
  return ranges.empty() ? 0 : median_of(ranges);
}

bool MasterMaker::is_defect(float value, float around, float limit) const {
  if (kind_ == MasterKind::dark) return std::abs(value - around) > limit;
  return around >= light_least && (value < response_least * around || value > response_most * around);
}

void MasterMaker::find_defects(float limit, Made& made) const {
  Plane& level = made.master.level;
  for (int y = 0; y < level.height(); ++y) {
    for (int x = 0; x < level.width(); ++x) {
      const float v = sum_.at(x, y);
      const auto around = middle_around(sum_, x, y);
      // Without a value in the frames (a flat's: the dark's defects) a pixel has none here, and is no news.
      if (!around || !std::isfinite(v)) {
        level.at(x, y) = nothing;
        continue;
      }
      if (kind_ == MasterKind::flat && v < light_least) level.at(x, y) = nothing;
      if (!is_defect(v, *around, limit)) continue;
      level.at(x, y) = nothing;
      ++made.master.defects;
      const float off = v - *around;
      made.defects.push_back({x, y, off > 0 ? Defect::Kind::hot : Defect::Kind::dark, double(off), frames_});
      if (made.defects.size() >= 2 * defects_listed_most) shorten(made.defects, defects_listed_most);
    }
  }
  shorten(made.defects, defects_listed_most);
  std::sort(made.defects.begin(), made.defects.end(), is_stronger);
}

Result<MasterMaker::Made, Refusal> MasterMaker::made() {
  if (frames_ < frames_least)
    return Err(Refusal{fmt::format("a master needs {} frames, not {}", frames_least, frames_)});
  // What varies by less than a step does not show its noise: most values are equal, and a mean between two of
  // them is no defect.
  const float range = std::max({average(), step_, rounding * std::abs(median_pixel(sum_))});
  Made made;
  made.master = {kind_, sum_, frames_, 0, setting_};
  find_defects(defect_limit * range, made);
  const auto& levels = made.master.level.cells();
  if (std::none_of(levels.begin(), levels.end(), [](float v) { return std::isfinite(v); }))
    return Err(Refusal{"no pixel has a value in all frames"});
  const double share = made.master.defects / static_cast<double>(sum_.size());
  if (share > defects_share_most) {
    return Err(Refusal{
        fmt::format("{:.1f} % of the pixels would be defects, more than {:.0f} %: {}", 100 * share,
                    100 * defects_share_most,
                    kind_ == MasterKind::dark ? "was there light on the detector?" : "was the light even?")});
  }
  return made;
}

Result<MasterMaker::Made, Refusal> MasterMaker::finish() {
  auto result = made();
  lowest_ = highest_ = sum_ = {};
  frames_ = 0;
  return result;
}

void calibrate(const Master* dark, const Master* flat, Frame& frame) {
  if (dark == nullptr && flat == nullptr) return;
  const auto saturation = saturation_of(frame);
  auto& cells = frame.pixels.cells();
  std::vector<std::size_t> saturated;
  float highest = 0;
  for (std::size_t i = 0; i < cells.size(); ++i) {
    const bool is_saturated = saturation && cells[i] >= *saturation;
    if (dark != nullptr) cells[i] -= dark->level.cells()[i];
    if (flat != nullptr) cells[i] /= flat->level.cells()[i];
    if (!std::isfinite(cells[i])) continue;
    if (is_saturated)
      saturated.push_back(i);
    else
      highest = std::max(highest, cells[i]);
  }
  if (!saturation) return;
  // Above everything else, wherever dark and response have moved it.
  frame.saturation_adu = std::max(*saturation, highest + 1);
  for (const std::size_t i : saturated) cells[i] = *frame.saturation_adu;
}

}  // namespace srfs::image
