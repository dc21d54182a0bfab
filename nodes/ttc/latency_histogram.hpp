#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

#include "base/time.hpp"

namespace srfs {

/// Counts durations in fixed classes, so that a percentile costs no memory: upper bounds 0.5, 1, 2, 5, 10,
/// 20, 50, 100 ms and everything above.
class LatencyHistogram {
 public:
  static constexpr std::array<microseconds, 8> bounds = {
      microseconds(500),   microseconds(1000),  microseconds(2000),  microseconds(5000),
      microseconds(10000), microseconds(20000), microseconds(50000), microseconds(100000)};

  void add(nanoseconds latency) {
    std::size_t i = 0;
    while (i < bounds.size() && latency > bounds[i]) ++i;
    ++counts_[i];
    ++total_;
    if (latency > longest_) longest_ = latency;
  }
  [[nodiscard]] const std::array<std::uint64_t, bounds.size() + 1>& counts() const { return counts_; }
  [[nodiscard]] std::uint64_t total() const { return total_; }
  [[nodiscard]] nanoseconds longest() const { return longest_; }
  /// Upper bound of the class that holds the @p percent-th percentile; the longest seen for the last class; 0
  /// when empty.
  [[nodiscard]] nanoseconds percentile(unsigned percent) const {
    std::uint64_t wanted = (total_ * percent + 99) / 100;
    for (std::size_t i = 0; i < bounds.size(); ++i) {
      if (counts_[i] >= wanted) return total_ == 0 ? nanoseconds(0) : nanoseconds(bounds[i]);
      wanted -= counts_[i];
    }
    return longest_;
  }

 private:
  std::array<std::uint64_t, bounds.size() + 1> counts_{};
  std::uint64_t total_ = 0;
  nanoseconds longest_{0};
};

}  // namespace srfs
