#include "image/line_search.hpp"

#include <algorithm>
#include <cmath>

namespace srfs::image {
namespace {

constexpr int shortest = 8;
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
        for (int y = 0; y < inside; ++y) to[y] = static_cast<std::int16_t>(first[y] + second[y]);
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

}  // namespace

std::vector<LineHit> search_lines(const Plane& significance, double correlation_cells, double least,
                                  float clip) {
  std::vector<LineHit> hits;
  const int w = significance.width();
  const int h = significance.height();
  const auto quantised = [&](int x, int y) {
    return static_cast<std::int16_t>(scale *
                                     std::clamp(significance.at(x, y), clip_low, std::min(clip, clip_most)));
  };
  for (const bool steep : {false, true}) {
    const int along = steep ? h : w;
    const int across = steep ? w : h;
    const Octant octant(along, across);
    for (const bool falling : {false, true}) {
      Cells cells(static_cast<std::size_t>(octant.along()) * static_cast<std::size_t>(across));
      // Row by row in the frame, for the cache; the transposed write is the smaller evil.
      for (int y = 0; y < h; ++y) {
        for (int x = 0; x < w; ++x) {
          const int a = steep ? y : x;
          const int c = steep ? x : y;
          cells[static_cast<std::size_t>(a) * static_cast<std::size_t>(across) +
                static_cast<std::size_t>(falling ? across - 1 - c : c)] = quantised(x, y);
        }
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
