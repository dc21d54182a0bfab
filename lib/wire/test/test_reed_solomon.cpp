// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include <algorithm>
#include <numeric>
#include <random>

#include "wire/reed_solomon.hpp"

namespace srfs::wire {
namespace {

Octets noise(std::mt19937& random, std::size_t octets) {
  Octets data(octets);
  for (std::uint8_t& octet : data) octet = static_cast<std::uint8_t>(random());
  return data;
}

/// Corrupts @p errors octets of codeword @p codeword.
void damage(std::mt19937& random, Octets& block, unsigned interleave, unsigned codeword, std::size_t errors) {
  std::vector<std::size_t> places(block.size() / interleave);
  std::iota(places.begin(), places.end(), 0U);
  std::shuffle(places.begin(), places.end(), random);
  for (std::size_t i = 0; i < errors; ++i) {
    block[places[i] * interleave + codeword] ^= static_cast<std::uint8_t>(1 + random() % 255);
  }
}

TEST(ReedSolomon, CorrectsUpToSixteenOctetsInEveryCodeword) {
  std::mt19937 random(3);
  for (unsigned interleave = 1; interleave <= rs_interleave_max; ++interleave) {
    for (unsigned errors = 0; errors <= rs_correctable_octets; ++errors) {
      const Octets data = noise(random, rs_data_octets * interleave);
      Octets block = rs_encode(data, interleave);
      for (unsigned codeword = 0; codeword < interleave; ++codeword)
        damage(random, block, interleave, codeword, errors);
      const auto decoded = rs_decode(block, interleave);
      ASSERT_TRUE(decoded) << interleave << ' ' << errors;
      ASSERT_EQ(decoded->data, data);
      ASSERT_EQ(decoded->corrected_octets, errors * interleave);
    }
  }
}

TEST(ReedSolomon, ReportsMoreThanSixteenErrorsInAnyCodeword) {
  std::mt19937 random(4);
  for (int round = 0; round < 300; ++round) {
    const auto interleave = static_cast<unsigned>(1 + random() % 5);
    Octets block = rs_encode(noise(random, rs_data_octets * interleave), interleave);
    damage(random, block, interleave, static_cast<unsigned>(random() % interleave), 17 + random() % 200);
    ASSERT_FALSE(rs_decode(block, interleave)) << round;
  }
}

TEST(ReedSolomon, CorrectsABurstOfSixteenTimesTheDepth) {
  std::mt19937 random(5);
  const Octets data = noise(random, 1115);
  Octets block = rs_encode(data, 5);
  for (std::size_t i = 300; i < 380; ++i) block[i] ^= 0xFF;
  EXPECT_EQ(rs_decode(block, 5)->data, data);
}

TEST(ReedSolomon, ShortenedCodewordsWork) {
  std::mt19937 random(6);
  for (const std::size_t octets : {1U, 2U, 50U, 222U}) {
    const Octets data = noise(random, octets * 2);
    Octets block = rs_encode(data, 2);
    damage(random, block, 2, 0, 16);
    damage(random, block, 2, 1, 7);
    const auto decoded = rs_decode(block, 2);
    ASSERT_TRUE(decoded) << octets;
    EXPECT_EQ(decoded->data, data);
    EXPECT_EQ(decoded->corrected_octets, 23U);
  }
}

TEST(ReedSolomon, SizesThatCannotBeCodedAreKnown) {
  EXPECT_TRUE(rs_fits(1115, 5));
  EXPECT_FALSE(rs_fits(1115, 4));
  EXPECT_FALSE(rs_fits(224, 1));
  EXPECT_FALSE(rs_fits(0, 1));
  EXPECT_FALSE(rs_fits(223, 9));
}

}  // namespace
}  // namespace srfs::wire
