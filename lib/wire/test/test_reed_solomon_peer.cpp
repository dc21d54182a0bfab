// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <numeric>
#include <random>

extern "C" {
#include <fec.h>
}

#include "wire/reed_solomon.hpp"

// Debian's libfec (Phil Karn) is the reference in this field. Each side decodes the other side's output.

namespace srfs::wire {
namespace {

constexpr int rounds = 2000;

struct Word {
  Octets data;
  Octets coded;
  std::size_t fill;  ///< octets of virtual fill, which are not sent
};

Word random_word(std::mt19937& random) {
  Word word;
  word.fill = random() % 3 == 0 ? random() % rs_data_octets : 0;
  word.data.resize(rs_data_octets - word.fill);
  for (std::uint8_t& octet : word.data) octet = static_cast<std::uint8_t>(random());
  word.coded = rs_encode(word.data, 1);
  return word;
}

void damage(std::mt19937& random, Octets& word, std::size_t errors) {
  std::vector<std::size_t> places(word.size());
  std::iota(places.begin(), places.end(), std::size_t{0});
  std::shuffle(places.begin(), places.end(), random);
  for (std::size_t i = 0; i < errors; ++i) word[places[i]] ^= static_cast<std::uint8_t>(1 + random() % 255);
}

TEST(ReedSolomonBesideLibfec, TheParityIsTheSameAlsoWithVirtualFill) {
  std::mt19937 random(1);
  for (int round = 0; round < rounds; ++round) {
    Word word = random_word(random);
    std::array<std::uint8_t, rs_parity_octets> parity{};
    encode_rs_ccsds(word.data.data(), parity.data(), static_cast<int>(word.fill));
    ASSERT_TRUE(std::equal(parity.begin(), parity.end(), word.coded.end() - rs_parity_octets)) << round;
  }
}

TEST(ReedSolomonBesideLibfec, BothCorrectTheSameWordsAndGiveTheSameOnesUp) {
  std::mt19937 random(2);
  int given_up = 0;
  for (int round = 0; round < rounds; ++round) {
    Word word = random_word(random);
    Octets received = word.coded;
    const std::size_t errors = random() % (rs_correctable_octets + 4);
    damage(random, received, std::min(errors, received.size()));
    Octets theirs = received;
    const int corrected = decode_rs_ccsds(theirs.data(), nullptr, 0, static_cast<int>(word.fill));
    const auto ours = rs_decode(received, 1);
    ASSERT_EQ(ours.has_value(), corrected >= 0) << round << ": " << errors << " errors";
    if (!ours) {
      ++given_up;
      continue;
    }
    ASSERT_EQ(static_cast<int>(ours->corrected_octets), corrected) << round;
    ASSERT_EQ(ours->data, Octets(theirs.begin(), theirs.end() - rs_parity_octets)) << round;
    if (errors <= rs_correctable_octets) {
      ASSERT_EQ(ours->data, word.data) << round;
    }
  }
  EXPECT_GT(given_up, 0);
}

}  // namespace
}  // namespace srfs::wire
