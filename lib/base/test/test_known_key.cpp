// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include <array>
#include <numeric>
#include <random>

#include <gtest/gtest.h>

#include "base/known_key.hpp"

namespace srfs {
namespace {

std::string why(const std::string& hex) {
  return std::string(why_known(*from_hex(hex)).value_or(""));
}

std::string repeated(const std::string& hex, int times) {
  std::string all;
  for (int i = 0; i < times; ++i) all += hex;
  return all;
}

TEST(KnownKey, IsZeroAPatternOrPublished) {
  EXPECT_EQ(why(repeated("00", 32)), "it is zero");
  for (const int first : {0, 0x20, 0xF0}) {
    Octets counting(32);
    std::iota(counting.begin(), counting.end(), static_cast<std::uint8_t>(first));
    EXPECT_EQ(why_known(counting), "its octets form a sequence, as in published test vectors") << first;
    std::reverse(counting.begin(), counting.end());
    EXPECT_TRUE(why_known(counting)) << first;
  }
  EXPECT_EQ(why(repeated("ff", 32)), "its octets form a sequence, as in published test vectors");
  EXPECT_EQ(why(repeated("deadbeef", 8)), "it has only a few different octets");
  EXPECT_EQ(why("01020304" + repeated("00", 28)), "it has only a few different octets");
  EXPECT_EQ(why(repeated("feffe9928665731c6d6a8f9467308308", 2)),
            "its halves are the same, as in published test vectors")
      << "AES-GCM, test case 13";
  EXPECT_EQ(why("603deb1015ca71be2b73aef0857d77811f352c073b6108d72d9810a30914dff4"),
            "it appears in a published test vector");
  EXPECT_EQ(why("d75a980182b10ab7d54bfed3c964073a0ee172f3daa62325af021a68f707511a"),
            "it appears in a published test vector");
}

TEST(KnownKey, IsNoRandomOne) {
  std::mt19937 random(20261124);  // NOLINT(cert-msc32-c,cert-msc51-cpp): the same each time
  for (int i = 0; i < 100'000; ++i) {
    std::array<std::uint8_t, 32> key{};
    for (std::uint8_t& octet : key) octet = static_cast<std::uint8_t>(random());
    ASSERT_FALSE(why_known(key)) << to_hex(key);
  }
}

}  // namespace
}  // namespace srfs
