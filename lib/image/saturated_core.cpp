// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "image/saturated_core.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <utility>

#include "image/clean_frame.hpp"

namespace srfs::image {
namespace {

/// Of each saturated pixel: how many steps to the edge of its patch, 255 at most.
using Depth = Grid<std::uint8_t>;

/// Most rows hold nothing.
bool has_any(const std::uint8_t* row, int width, std::uint8_t bits) {
  std::uint8_t any = 0;
  for (int x = 0; x < width; ++x) any |= row[x];
  return (any & bits) != 0;
}

/// The frame's edge counts as one of the patch. Empty: nothing is saturated.
Depth depth_of(const Grid<std::uint8_t>& flaws) {
  Depth depth;
  const auto at = [&](int x, int y) { return depth.contains(x, y) ? int{depth.at(x, y)} : 0; };
  for (int y = 0; y < flaws.height(); ++y) {
    const std::uint8_t* row = flaws.row(y);
    if (!has_any(row, flaws.width(), flaw_saturated)) continue;
    if (depth.empty()) depth = Depth(flaws.width(), flaws.height());
    for (int x = 0; x < flaws.width(); ++x) {
      if ((row[x] & flaw_saturated) == 0) continue;
      const int least = std::min({at(x - 1, y), at(x - 1, y - 1), at(x, y - 1), at(x + 1, y - 1)});
      depth.at(x, y) = static_cast<std::uint8_t>(std::min(255, least + 1));
    }
  }
  for (int y = depth.height() - 1; y >= 0; --y) {
    if (!has_any(depth.row(y), depth.width(), 0xFF)) continue;
    for (int x = depth.width() - 1; x >= 0; --x) {
      if (depth.at(x, y) == 0) continue;
      const int least = std::min({at(x + 1, y), at(x + 1, y + 1), at(x, y + 1), at(x - 1, y + 1)});
      depth.at(x, y) = static_cast<std::uint8_t>(std::min(int{depth.at(x, y)}, least + 1));
    }
  }
  return depth;
}

/// Pixels that touch, and the deepest of them.
struct SaturatedPatch {
  std::size_t part_of;  ///< itself, or a patch that it turned out to touch
  int deepest = 0;
  int pixels = 0;
  int left = 0, right = 0, top = 0, bottom = 0;  ///< of the deepest pixels, inclusive

  void add(const SaturatedPatch& more) {
    pixels += more.pixels;
    if (more.deepest < deepest) return;
    const bool same = more.deepest == deepest;
    deepest = more.deepest;
    left = same ? std::min(left, more.left) : more.left;
    right = same ? std::max(right, more.right) : more.right;
    top = same ? std::min(top, more.top) : more.top;
    bottom = same ? std::max(bottom, more.bottom) : more.bottom;
  }

  /// Half of the largest square inside; its corners are on the circle.
  [[nodiscard]] int radius() const {
    return static_cast<int>(std::ceil(std::numbers::sqrt2 * (deepest - 0.5)));
  }
  [[nodiscard]] bool is_round() const { return std::max(right - left, bottom - top) <= 3 + radius() / 2; }
};

struct Run {
  int from;
  int end;
  std::size_t patch;
};

/// Row by row: what runs of pixels touch runs of the row above belongs to their patch.
class PatchFinder {
 public:
  /// @return false: too many
  [[nodiscard]] bool add_row(const std::uint8_t* depth, int width, int y) {
    runs_.clear();
    if (!has_any(depth, width, 0xFF)) width = 0;
    std::size_t above = 0;
    for (int x = 0; x < width; ++x) {
      if (depth[x] == 0) continue;
      Run run{x, x, patches_.size()};
      while (run.end < width && depth[run.end] != 0) ++run.end;
      while (above < above_.size() && above_[above].end < run.from) ++above;
      for (std::size_t i = above; i < above_.size() && above_[i].from <= run.end; ++i) {
        const std::size_t patch = whole(above_[i].patch);
        run.patch = run.patch == patches_.size() ? patch : join(run.patch, patch);
      }
      if (run.patch == patches_.size()) {
        if (patches_.size() == patches_most) return false;
        patches_.push_back({run.patch});
      }
      for (; x < run.end; ++x) patches_[run.patch].add({run.patch, depth[x], 1, x, x, y, y});
      runs_.push_back(run);
    }
    std::swap(runs_, above_);
    return true;
  }

  [[nodiscard]] const std::vector<SaturatedPatch>& patches() const { return patches_; }

 private:
  static constexpr std::size_t patches_most = 1'000'000;

  [[nodiscard]] std::size_t whole(std::size_t patch) {
    while (patches_[patch].part_of != patch)
      patch = patches_[patch].part_of = patches_[patches_[patch].part_of].part_of;
    return patch;
  }

  std::size_t join(std::size_t one, std::size_t other) {
    if (one == other) return one;
    patches_[one].add(patches_[other]);
    patches_[other].part_of = one;
    return one;
  }

  std::vector<SaturatedPatch> patches_;
  std::vector<Run> runs_, above_;
};

}  // namespace

std::vector<SaturatedCore> find_saturated_cores(const Grid<std::uint8_t>& flaws) {
  std::vector<SaturatedCore> cores;
  const Depth depth = depth_of(flaws);
  PatchFinder found;
  for (int y = 0; y < depth.height(); ++y) {
    if (!found.add_row(depth.row(y), depth.width(), y)) return cores;
  }
  for (std::size_t i = 0; i < found.patches().size(); ++i) {
    const SaturatedPatch& patch = found.patches()[i];
    if (patch.part_of != i || patch.pixels < 2 || patch.radius() > saturated_radius_max || !patch.is_round())
      continue;
    cores.push_back({(patch.left + patch.right) / 2.0, (patch.top + patch.bottom) / 2.0, patch.radius()});
  }
  std::stable_sort(cores.begin(), cores.end(),
                   [](const SaturatedCore& a, const SaturatedCore& b) { return a.radius > b.radius; });
  if (cores.size() > saturated_most) cores.resize(saturated_most);
  return cores;
}

}  // namespace srfs::image
