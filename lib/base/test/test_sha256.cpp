// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "base/sha256.hpp"

#include <gtest/gtest.h>

namespace srfs {
namespace {

TEST(Sha256, IsThatOfTheStandardsExample) {
  const std::string abc = "abc";
  EXPECT_EQ(to_digits(sha256_of({reinterpret_cast<const std::uint8_t*>(abc.data()), abc.size()})),
            "ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad");  // FIPS 180-2, B.1
}

OctetView octets_of(const std::string& text) {
  return {reinterpret_cast<const std::uint8_t*>(text.data()), text.size()};
}

TEST(HmacSha256, IsThatOfTheStandardsExamples) {
  const std::string jefe = "Jefe";
  EXPECT_EQ(
      to_digits(HmacSha256(octets_of(jefe)).of({octets_of("what do ya want "), octets_of("for nothing?")})),
      "5bdcc146bf60754e6a042426089575c75a003f089d2739839dec58b964ec3843");  // RFC 4231, 4.3
}

TEST(HmacSha256, IsThatOfOneCallWhateverTheLengths) {
  for (const std::size_t key : {1U, 32U, 63U, 64U, 65U, 200U}) {
    for (const std::size_t size : {0U, 1U, 55U, 56U, 64U, 1000U}) {
      const std::string secret(key, 'k');
      const std::string text(size, 't');
      const HmacSha256 mac(octets_of(secret));
      for (int twice = 0; twice < 2; ++twice)
        EXPECT_EQ(mac.of({octets_of(text)}), hmac_sha256(octets_of(secret), octets_of(text)))
            << key << ' ' << size;
    }
  }
}

}  // namespace
}  // namespace srfs
