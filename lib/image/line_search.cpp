// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "image/line_search.hpp"

#include <algorithm>
#include <cmath>

#include "image/rows.hpp"

namespace srfs::image {
namespace {

constexpr int shortest = 4;
constexpr int longest = 128;
constexpr float scale = 24;  // of the int16 sums: 128 cells of at most 8 stay below 32768
constexpr float clip_low = -4;
constexpr float clip_most = 8;
constexpr int block = 16;  // cells across, of which the best piece is kept

/// Cells with the direction across the lines contiguous: [position along][position across].
using Cells = std::vector<std::int16_t>;

/// One octant pair: lines that move 0 to 1 cell across for each cell along.
class Octant {
 public:
  Octant(int along, int across) : along_((along + longest - 1) / longest * longest), across_(across) {}

  /// @param use  called with (first along, first across, length, slope, sum in noise)
  template <class Use>
  void search(Cells cells, double correlation, double least, Use&& use) const {
    Cells next(cells.size());
    for (int length = 1; length < longest; length *= 2) {
      join(cells, next, length);
      cells.swap(next);
      if (2 * length >= shortest) report(cells, 2 * length, correlation, least, use);
    }
  }

  [[nodiscard]] int along() const { return along_; }

 private:
  [[nodiscard]] std::size_t line(int strip, int slope, int length) const {
    return static_cast<std::size_t>(strip * length + slope) * static_cast<std::size_t>(across_);
  }

  /// Two pieces of half the length make one; its second half starts where the first ended, or one further.
  void join(const Cells& in, Cells& out, int length) const {
    const int strips = along_ / (2 * length);
    for (int k = 0; k < strips; ++k) {
      for (int slope = 0; slope < 2 * length; ++slope) {
        const int shift = (slope + 1) / 2;
        const std::int16_t* first = in.data() + line(2 * k, slope / 2, length);
        const std::int16_t* second = in.data() + line(2 * k + 1, slope / 2, length) + shift;
        std::int16_t* to = out.data() + line(k, slope, 2 * length);
        const int inside = std::max(0, across_ - shift);
        add_sums(first, second, to, inside);
        for (int y = inside; y < across_; ++y) to[y] = first[y];
      }
    }
  }

  /// Spread of a sum over cells that the filter has made alike.
  static double spread(int length, int slope, double correlation) {
    const double step = std::hypot(1.0, static_cast<double>(slope) / length);
    double variance = length;
    for (int d = 1; d < length && d * step < 6 * correlation; ++d) {
      const double u = d * step / (2 * correlation);
      variance += 2 * (length - d) * std::exp(-u * u);
    }
    return std::sqrt(variance);
  }

  template <class Use>
  void report(const Cells& sums, int length, double correlation, double least, Use&& use) const {
    struct Best {
      float value = 0;
      int slope = 0;
      int from = 0;
    };
    std::vector<Best> best(static_cast<std::size_t>(across_ / block + 1));
    std::vector<float> unit(static_cast<std::size_t>(length));
    for (int slope = 0; slope < length; ++slope)
      unit[static_cast<std::size_t>(slope)] =
          static_cast<float>(1 / (double(scale) * spread(length, slope, correlation)));
    for (int k = 0; k < along_ / length; ++k) {
      std::fill(best.begin(), best.end(), Best{});
      for (int slope = 0; slope < length; ++slope) {
        const std::int16_t* row = sums.data() + line(k, slope, length);
        const float u = unit[static_cast<std::size_t>(slope)];
        const auto limit = static_cast<std::int16_t>(std::min(32767.0, least / double(u)));
        if (highest_of(row, across_) <= limit) continue;
        for (int y0 = 0; y0 < across_; y0 += block) {
          const int y1 = std::min(across_, y0 + block);
          std::int16_t highest = row[y0];
          for (int y = y0 + 1; y < y1; ++y) highest = std::max(highest, row[y]);
          if (highest <= limit) continue;
          Best& b = best[static_cast<std::size_t>(y0 / block)];
          const float value = u * static_cast<float>(highest);
          if (value <= b.value) continue;
          b = {value, slope, static_cast<int>(std::max_element(row + y0, row + y1) - row)};
        }
      }
      for (const Best& b : best) {
        if (b.value > 0) use(k * length, b.from, length, b.slope, double(b.value));
      }
    }
  }

  int along_;
  int across_;
};

Cells quantised(const Plane& significance, float clip) {
  const float highest = std::min(clip, clip_most);
  Cells cells(significance.size());
  const float* from = significance.cells().data();
  for (std::size_t i = 0; i < cells.size(); ++i) {
    const float v = from[i] < highest ? from[i] : highest;
    cells[i] = static_cast<std::int16_t>(scale * (v > clip_low ? v : clip_low));
  }
  return cells;
}

/// Square by square, for the cache.
Cells transposed(const Cells& cells, int width, int height) {
  constexpr int side = 32;
  Cells out(cells.size());
  for (int y0 = 0; y0 < height; y0 += side) {
    for (int x0 = 0; x0 < width; x0 += side) {
      for (int x = x0; x < std::min(width, x0 + side); ++x) {
        for (int y = y0; y < std::min(height, y0 + side); ++y)
          out[static_cast<std::size_t>(x) * static_cast<std::size_t>(height) + static_cast<std::size_t>(y)] =
              cells[static_cast<std::size_t>(y) * static_cast<std::size_t>(width) +
                    static_cast<std::size_t>(x)];
      }
    }
  }
  return out;
}

}  // namespace

std::vector<LineHit> search_lines(const Plane& significance, double correlation_cells, double least,
                                  float clip) {
  std::vector<LineHit> hits;
  const int w = significance.width();
  const int h = significance.height();
  const Cells upright = quantised(significance, clip);
  const Cells turned = transposed(upright, w, h);
  for (const bool steep : {false, true}) {
    const int along = steep ? h : w;
    const int across = steep ? w : h;
    const Octant octant(along, across);
    for (const bool falling : {false, true}) {
      const Cells& from_cells = steep ? upright : turned;
      Cells cells(static_cast<std::size_t>(octant.along()) * static_cast<std::size_t>(across));
      for (int a = 0; a < along; ++a) {
        const auto at = static_cast<std::ptrdiff_t>(a) * across;
        const auto begin_at = from_cells.begin() + at;
        if (falling)
          std::reverse_copy(begin_at, begin_at + across, cells.begin() + at);
        else
          std::copy(begin_at, begin_at + across, cells.begin() + at);
      }
      octant.search(std::move(cells), correlation_cells, least,
                    [&](int from, int begin, int length, int slope, double value) {
                      double c1 = begin;
                      double c2 = begin + slope;
                      if (falling) c1 = across - 1 - c1, c2 = across - 1 - c2;
                      const double a1 = from;
                      const double a2 = from + length - 1;
                      if (steep)
                        hits.push_back({c1, a1, c2, a2, value});
                      else
                        hits.push_back({a1, c1, a2, c2, value});
                    });
    }
  }
  std::sort(hits.begin(), hits.end(),
            [](const LineHit& a, const LineHit& b) { return a.significance > b.significance; });
  return hits;
}

}  // namespace srfs::image
