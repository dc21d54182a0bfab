// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "update/deflate.hpp"

#include <random>

#include <gtest/gtest.h>

namespace srfs::update {
namespace {

Octets octets(std::string_view text) {
  return {text.begin(), text.end()};
}

TEST(Deflate, GivesBackWhatWentIn) {
  std::mt19937 random(1);
  for (const std::size_t size : {0U, 1U, 2U, 100U, 32'768U, 32'769U, 300'000U}) {
    Octets noise(size);
    for (std::uint8_t& octet : noise) octet = static_cast<std::uint8_t>(random());
    EXPECT_EQ(expand(shrink(noise), size), noise) << size;
    const Octets same(size, 'x');
    EXPECT_EQ(expand(shrink(same), size), same) << size;
    EXPECT_EQ(shrink(noise), shrink(noise));
  }
}

TEST(Deflate, ReadsAStreamOfTheStandard) {
  // RFC 1951, 3.2.4: one stored block that is also the last: 01, length 3, its complement, "abc".
  EXPECT_EQ(expand(Octets{0x01, 0x03, 0x00, 0xFC, 0xFF, 'a', 'b', 'c'}, 3), octets("abc"));
}

TEST(Deflate, RefusesAStreamThatIsNotExactlyAsLongAsExpected) {
  const Octets stream = shrink(octets("0123456789"));
  EXPECT_EQ(expand(stream, 9).error(), DeflateError::too_long);
  EXPECT_EQ(expand(stream, 0).error(), DeflateError::too_long);
  EXPECT_EQ(expand(stream, 11).error(), DeflateError::too_short);
  EXPECT_EQ(expand(shrink(Octets(50U << 20)), 100).error(), DeflateError::too_long);
}

TEST(Deflate, RefusesWhatIsNoStreamOrCutOffOrFollowedByMore) {
  const Octets stream = shrink(octets("int main() { return 0; }  // int main() { return 1; }"));
  for (std::size_t size = 0; size < stream.size(); ++size) {
    const OctetView part(stream.data(), size);
    EXPECT_EQ(expand(part, 53).error(), DeflateError::damaged) << size;
  }
  EXPECT_EQ(expand(Octets{0x07}, 1).error(), DeflateError::damaged) << "a block of the reserved type";
  Octets more = stream;
  more.push_back(0);
  EXPECT_EQ(expand(more, 53).error(), DeflateError::trailing);
}

}  // namespace
}  // namespace srfs::update
