// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include <set>

#include <gtest/gtest.h>

#include "base/octets.hpp"
#include "base/random_octets.hpp"

namespace srfs {
namespace {

TEST(RandomOctets, FillAllOfABufferHoweverLong) {
  Octets octets(100'000);
  ASSERT_TRUE(fill_random(octets));
  EXPECT_TRUE(fill_random({}));

  // Of 256 random octets some 162 are different; what was not filled is zero.
  for (std::size_t begin = 0; begin + 256 <= octets.size(); begin += 256) {
    const std::set<std::uint8_t> values(octets.begin() + static_cast<std::ptrdiff_t>(begin),
                                        octets.begin() + static_cast<std::ptrdiff_t>(begin + 256));
    EXPECT_GT(values.size(), 100U) << begin;
  }
}

TEST(RandomOctets, AreOthersEachTime) {
  Octets first(32);
  Octets second(32);
  ASSERT_TRUE(fill_random(first) && fill_random(second));
  EXPECT_NE(first, second);
}

}  // namespace
}  // namespace srfs
