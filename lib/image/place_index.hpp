// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <vector>

namespace srfs::image {

/// Points by place: what lies near a point is found without looking at all of them.
class PlaceIndex {
 public:
  PlaceIndex() = default;

  /// @param points  with members x and y; copied, not kept
  template <class Points>
  explicit PlaceIndex(const Points& points) {
    if (points.empty()) return;
    double right = points[0].x;
    double bottom = points[0].y;
    left_ = right, top_ = bottom;
    for (const auto& p : points) {
      left_ = std::min(left_, double(p.x)), right = std::max(right, double(p.x));
      top_ = std::min(top_, double(p.y)), bottom = std::max(bottom, double(p.y));
    }
    // About two points a cell.
    const double area = std::max(1.0, (right - left_) * (bottom - top_));
    cell_ = std::max({1.0, std::sqrt(2 * area / static_cast<double>(points.size())), (right - left_) / 4000,
                      (bottom - top_) / 4000});
    columns_ = static_cast<int>((right - left_) / cell_) + 1;
    rows_ = static_cast<int>((bottom - top_) / cell_) + 1;
    first_.assign(static_cast<std::size_t>(columns_) * static_cast<std::size_t>(rows_) + 1, 0);
    std::vector<std::size_t> of;
    of.reserve(points.size());
    for (const auto& p : points) {
      of.push_back(cell(column(double(p.x)), row(double(p.y))));
      ++first_[of.back() + 1];
    }
    for (std::size_t i = 1; i < first_.size(); ++i) first_[i] += first_[i - 1];
    entries_.resize(points.size());
    std::vector<std::size_t> next(first_.begin(), first_.end() - 1);
    for (std::size_t i = 0; i < points.size(); ++i)
      entries_[next[of[i]]++] = {double(points[i].x), double(points[i].y), i};
  }

  /// Calls use(index) for the points in a rectangle, and for some beside it.
  template <class Use>
  void around(double left, double top, double right, double bottom, Use&& use) const {
    if (entries_.empty()) return;
    for (int j = std::max(0, row(top)); j <= std::min(rows_ - 1, row(bottom)); ++j) {
      for (int i = std::max(0, column(left)); i <= std::min(columns_ - 1, column(right)); ++i) {
        const std::size_t c = cell(i, j);
        for (std::size_t k = first_[c]; k < first_[c + 1]; ++k) use(entries_[k].index);
      }
    }
  }

  /// Calls use(index, distance) for the points at most @p reach away.
  template <class Use>
  void near(double x, double y, double reach, Use&& use) const {
    if (entries_.empty()) return;
    for (int j = std::max(0, row(y - reach)); j <= std::min(rows_ - 1, row(y + reach)); ++j) {
      for (int i = std::max(0, column(x - reach)); i <= std::min(columns_ - 1, column(x + reach)); ++i) {
        const std::size_t c = cell(i, j);
        for (std::size_t k = first_[c]; k < first_[c + 1]; ++k) {
          const double d = std::hypot(entries_[k].x - x, entries_[k].y - y);
          if (d <= reach) use(entries_[k].index, d);
        }
      }
    }
  }

 private:
  struct Entry {
    double x, y;
    std::size_t index;
  };
  [[nodiscard]] int column(double x) const {
    return static_cast<int>(std::clamp(std::floor((x - left_) / cell_), -1.0, 1e6));
  }
  [[nodiscard]] int row(double y) const {
    return static_cast<int>(std::clamp(std::floor((y - top_) / cell_), -1.0, 1e6));
  }
  [[nodiscard]] std::size_t cell(int i, int j) const {
    return static_cast<std::size_t>(std::min(j, rows_ - 1)) * static_cast<std::size_t>(columns_) +
           static_cast<std::size_t>(std::min(i, columns_ - 1));
  }

  double left_ = 0;
  double top_ = 0;
  double cell_ = 1;
  int columns_ = 0;
  int rows_ = 0;
  std::vector<std::size_t> first_;
  std::vector<Entry> entries_;
};

}  // namespace srfs::image
