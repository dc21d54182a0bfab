// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include <type_traits>

#include "lib/wire/test/link_vectors.hpp"
#include "wire/sdls.hpp"

namespace srfs::wire {
namespace {

const SdlsKey& key() {
  static const SdlsKey the_key(std::array<std::uint8_t, sdls_key_octets>{1, 2, 3, 4});
  return the_key;
}
Octets secured(std::uint64_t counter = 1) {
  return sdls_apply({.key = key(), .spi = 4, .counter = counter}, 1, 0xC0, octets_of("0102030405")).value();
}

TEST(Sdls, AnyChangedBitIsRefused) {
  const Octets good = secured();
  ASSERT_TRUE(sdls_open(key(), 4, 1, good));
  for (std::size_t bit = 0; bit < good.size() * 8; ++bit) {
    Octets bad = good;
    bad[bit / 8] ^= static_cast<std::uint8_t>(0x80 >> bit % 8);
    EXPECT_FALSE(sdls_open(key(), 4, 1, bad)) << bit;
  }
}

TEST(Sdls, AFrameIsBoundToItsVirtualChannelKeyAndAssociation) {
  const Octets good = secured();
  EXPECT_EQ(sdls_open(key(), 4, 2, good).error(), SdlsError::bad_mac);
  EXPECT_EQ(sdls_open(key(), 5, 1, good).error(), SdlsError::wrong_spi);
  const SdlsKey other(std::array<std::uint8_t, sdls_key_octets>{9});
  EXPECT_EQ(sdls_open(other, 4, 1, good).error(), SdlsError::bad_mac);
  EXPECT_EQ(sdls_claimed_spi(good), 4);
  EXPECT_EQ(sdls_claimed_spi(octets_of("c000")), std::nullopt);
}

TEST(Sdls, RefusesWhatIsTooShortOrTooLong) {
  EXPECT_EQ(sdls_open(key(), 4, 1, Octets(1 + sdls_overhead_octets)).error(), SdlsError::too_short);
  EXPECT_EQ(sdls_apply({.key = key()}, 0, 0xC0, {}).error(), SdlsError::too_short);
  EXPECT_EQ(sdls_apply({.key = key()}, 0, 0xC0, Octets(sdls_packet_octets_max + 1)).error(),
            SdlsError::too_long);
}

TEST(Sdls, CountersKeepAll64Bits) {
  const std::uint64_t counter = 0xFEDCBA9876543210U;
  EXPECT_EQ(sdls_open(key(), 4, 1, secured(counter))->counter, counter);
}

TEST(Sdls, AnyHigherCounterIsFreshAndNoOther) {
  EXPECT_TRUE(is_fresh(std::nullopt, 0));
  EXPECT_TRUE(is_fresh(5, 6));
  EXPECT_TRUE(is_fresh(5, ~std::uint64_t{0}));
  EXPECT_FALSE(is_fresh(5, 5));
  EXPECT_FALSE(is_fresh(5, 4));
}

TEST(SdlsKey, IsReadFromHexMovedAndNeverCopied) {
  static_assert(!std::is_copy_constructible_v<SdlsKey> && !std::is_copy_assignable_v<SdlsKey>);
  auto read = SdlsKey::from_hex(std::string(62, '0') + "2A");
  ASSERT_TRUE(read);
  EXPECT_EQ(read->octets()[31], 0x2A);
  const SdlsKey moved = std::move(*read);
  EXPECT_EQ(moved.octets()[31], 0x2A);
  EXPECT_EQ(read->octets()[31], 0) << "a moved key is wiped";
  EXPECT_FALSE(SdlsKey::from_hex(std::string(62, '0')));
  EXPECT_FALSE(SdlsKey::from_hex(std::string(63, '0') + "\n"));
}

}  // namespace
}  // namespace srfs::wire
