// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <cmath>
#include <cstdint>
#include <random>
#include <vector>

#include <gtest/gtest.h>

#include "base/latency_histogram.hpp"

namespace srfs {
namespace {

TEST(LatencyHistogram, IsZeroWhenEmpty) {
  const LatencyHistogram histogram;
  EXPECT_EQ(histogram.count(), 0U);
  EXPECT_EQ(histogram.quantile(0.5), nanoseconds(0));
  EXPECT_EQ(histogram.max(), nanoseconds(0));
}

TEST(LatencyHistogram, NeverUnderstatesAQuantileAndOverstatesItByFifteenPercentAtMost) {
  std::mt19937_64 random(7);
  std::uniform_real_distribution<double> decade(3.0, 10.9);  // 1 us to 80 s
  LatencyHistogram histogram;
  std::vector<std::int64_t> all;
  for (int i = 0; i < 20000; ++i) {
    const auto ns = static_cast<std::int64_t>(std::pow(10.0, decade(random)));
    all.push_back(ns);
    histogram.add(nanoseconds(ns));
  }
  std::sort(all.begin(), all.end());

  for (const double share : {0.01, 0.1, 0.5, 0.9, 0.99, 0.999}) {
    const auto rank = static_cast<std::size_t>(share * static_cast<double>(all.size()) + 0.999999) - 1;
    const auto exact = static_cast<double>(all[rank]);
    const auto said = static_cast<double>(histogram.quantile(share).count());
    EXPECT_GE(said, exact) << share;
    EXPECT_LE(said, exact * 1.15) << share;
  }
  EXPECT_EQ(histogram.quantile(1.0).count(), all.back());
}

TEST(LatencyHistogram, NeverSaysMoreThanTheLongest) {
  LatencyHistogram histogram;
  for (int i = 0; i < 100; ++i) histogram.add(microseconds(1010));
  EXPECT_EQ(histogram.quantile(0.5), microseconds(1010)) << "its class ends at 1120 us";
}

TEST(LatencyHistogram, CountsInCoarserClassesExactlyWhereItsOwnEnd) {
  LatencyHistogram histogram;
  histogram.add(microseconds(500));
  histogram.add(microseconds(500) + nanoseconds(1));
  histogram.add(milliseconds(2));
  histogram.add(milliseconds(101));
  EXPECT_EQ(histogram.count_up_to(microseconds(500)), 1U);
  EXPECT_EQ(histogram.count_up_to(milliseconds(1)), 2U);
  EXPECT_EQ(histogram.count_up_to(milliseconds(2)), 3U);
  EXPECT_EQ(histogram.count_up_to(milliseconds(100)), 3U);
}

TEST(LatencyHistogram, TakesTheShortestAndTheLongest) {
  LatencyHistogram histogram;
  histogram.add(nanoseconds(-5));
  histogram.add(nanoseconds(0));
  histogram.add(std::chrono::hours(5));
  EXPECT_EQ(histogram.count(), 3U);
  EXPECT_EQ(histogram.count_up_to(microseconds(1)), 2U);
  EXPECT_EQ(histogram.count_up_to(seconds(100)), 2U);
  EXPECT_EQ(histogram.quantile(0.99), std::chrono::hours(5));
}

TEST(LatencyHistogram, StartsAgainWhenCleared) {
  LatencyHistogram histogram;
  histogram.add(milliseconds(3));
  histogram.clear();
  EXPECT_EQ(histogram.count(), 0U);
  EXPECT_EQ(histogram.max(), nanoseconds(0));
}

}  // namespace
}  // namespace srfs
