#pragma once

#include <algorithm>
#include <array>
#include <bit>
#include <cstdint>

#include "base/time.hpp"

namespace srfs {

/// Durations in a fixed number of buckets: below 16 us exact to the microsecond, above with 1/16 resolution
/// up to an hour. Constant memory (2 KiB), nothing is dropped: what lies beyond counts in the last bucket.
class LatencyHistogram {
 public:
  void add(nanoseconds d) {
    const std::int64_t us = d.count() <= 0 ? 0 : d.count() / 1000;
    ++buckets_[bucket_of(static_cast<std::uint64_t>(us))];
    ++count_;
    if (d > max_) max_ = d;
  }
  void clear() { *this = LatencyHistogram(); }

  [[nodiscard]] std::uint64_t count() const { return count_; }
  [[nodiscard]] nanoseconds max() const { return max_; }
  /// Upper edge of the bucket in which the given share (0..1) is reached, at most max(); zero when empty.
  [[nodiscard]] nanoseconds quantile(double share) const {
    if (count_ == 0) return nanoseconds(0);
    const auto wanted = static_cast<std::uint64_t>(share * static_cast<double>(count_) + 0.999999);
    std::uint64_t seen = 0;
    for (std::size_t b = 0; b < buckets_.size(); ++b) {
      seen += buckets_[b];
      if (seen >= wanted) return std::min<nanoseconds>(microseconds(upper_edge_us(b)), max_);
    }
    return max_;
  }

 private:
  static constexpr std::size_t per_octave = 16;
  static constexpr std::size_t octaves = 28;

  static std::size_t bucket_of(std::uint64_t us) {
    if (us < per_octave) return static_cast<std::size_t>(us);
    const auto octave = static_cast<std::size_t>(std::bit_width(us)) - 5;  // us / 2^octave lies in 16..31
    const std::size_t bucket =
        per_octave * (octave + 1) + static_cast<std::size_t>((us >> octave) - per_octave);
    return std::min(bucket, per_octave * (octaves + 1) - 1);
  }
  static std::int64_t upper_edge_us(std::size_t bucket) {
    if (bucket < per_octave) return static_cast<std::int64_t>(bucket) + 1;
    const std::size_t octave = bucket / per_octave - 1;
    return static_cast<std::int64_t>(per_octave + bucket % per_octave + 1) << octave;
  }

  std::array<std::uint32_t, per_octave*(octaves + 1)> buckets_{};
  std::uint64_t count_ = 0;
  nanoseconds max_{0};
};

}  // namespace srfs
