// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <limits>

#include "base/time.hpp"

namespace srfs {

/// Durations counted in fixed classes, so that a quantile costs no memory: 656 octets, nothing is allocated,
/// nothing is dropped. The classes end at the preferred numbers of ISO 3, series R20 (1, 1.12, 1.25, 1.4, 1.6
/// ... 9): twenty a decade from 1 us to 100 s, each end at most 15 % above the one before. A duration belongs
/// to the first class whose end is not below it; the first class also holds everything shorter, the last one
/// everything longer than 100 s. Ends at 1, 2 and 5 of every decade make coarser classes exact
/// (count_up_to). A class that reaches 2^32 - 1 stays there; count() goes on.
class LatencyHistogram {
 public:
  static constexpr std::size_t classes = 8 * 20 + 2;

  void add(nanoseconds d) {
    std::uint32_t& c = counts_[class_of(d)];
    if (c != std::numeric_limits<std::uint32_t>::max()) ++c;
    ++count_;
    max_ = std::max(max_, d);
  }
  void clear() { *this = LatencyHistogram(); }

  [[nodiscard]] std::uint64_t count() const { return count_; }
  /// The longest, exactly.
  [[nodiscard]] nanoseconds max() const { return max_; }
  /// End of the class in which @p share (0..1) of all durations is reached, but at most max(); zero when
  /// empty. Never below the true quantile, at most 15 % above it.
  [[nodiscard]] nanoseconds quantile(double share) const {
    std::uint64_t total = 0;
    for (const std::uint32_t c : counts_) total += c;
    if (total == 0) return nanoseconds(0);
    const auto wanted =
        static_cast<std::uint64_t>(std::clamp(share, 0.0, 1.0) * static_cast<double>(total) + 0.999999);
    std::uint64_t seen = 0;
    for (std::size_t i = 0; i + 1 < classes; ++i) {
      seen += counts_[i];
      if (seen >= std::max<std::uint64_t>(wanted, 1)) return std::min(nanoseconds(ends[i]), max_);
    }
    return max_;
  }
  /// Durations that are not longer than @p bound; exact when a class ends there (1, 2 and 5 of each decade
  /// do), otherwise those of the classes that end below it.
  [[nodiscard]] std::uint64_t count_up_to(nanoseconds bound) const {
    std::uint64_t seen = 0;
    for (std::size_t i = 0; i + 1 < classes && nanoseconds(ends[i]) <= bound; ++i) seen += counts_[i];
    return seen;
  }

 private:
  /// Ends of all classes but the last, in ns.
  static constexpr std::array<std::int64_t, classes - 1> ends = [] {
    constexpr std::array<std::int64_t, 20> r20{100, 112, 125, 140, 160, 180, 200, 224, 250, 280,
                                               315, 355, 400, 450, 500, 560, 630, 710, 800, 900};
    std::array<std::int64_t, classes - 1> all{};
    std::int64_t decade = 10;  // times 100: 1 us
    for (std::size_t i = 0; i < all.size(); ++i) {
      all[i] = r20[i % 20] * decade;
      if (i % 20 == 19) decade *= 10;
    }
    return all;
  }();

  static std::size_t class_of(nanoseconds d) {
    return static_cast<std::size_t>(std::lower_bound(ends.begin(), ends.end(), d.count()) - ends.begin());
  }

  std::array<std::uint32_t, classes> counts_{};
  std::uint64_t count_ = 0;
  nanoseconds max_{0};
};

}  // namespace srfs
