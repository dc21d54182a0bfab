// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
// The vectors are those of NASA's CryptoLib, an independent implementation of CCSDS 355.1-B:
// test/unit/ut_ep_key_mgmt.c.
#include "wire/sdls_procedures.hpp"

#include <gtest/gtest.h>

#include <algorithm>

#include "lib/wire/test/link_vectors.hpp"
#include "wire/aes_gcm.hpp"

namespace srfs::wire {
namespace {

SdlsKey key_of(const char* hex) {
  return *SdlsKey::from_hex(hex);
}
const char* const master_0 = "000102030405060708090a0b0c0d0e0f000102030405060708090a0b0c0d0e0f";
const char* const key_132 = "0123456789abcdefabcdef01234567890123456789abcdefabcdef0123456789";

template <std::size_t octets>
std::array<std::uint8_t, octets> array_of(const char* hex) {
  std::array<std::uint8_t, octets> array{};
  const Octets read = octets_of(hex);
  std::copy(read.begin(), read.end(), array.begin());
  return array;
}

/// Tag 01, length 84, master key 0, IV, three keys (141, 140, 142) encrypted, MAC.
const char* const otar_pdu =
    "0100840000344892bbc54f5395297d4c37172f2a3c46f6a81c1349e9e26ac80985d8bbd55a5814c662e49fba52f99ba09558cd"
    "21cf268b8e50b2184137e80f76122034c580464e2f06d2659a50508bdfe9e9a55990ba4148af896d8a6eebe8b5d2258685d4ce"
    "217a20174fdd4f0efac62758c51b04e55710a47209c923b641d19a39001f9e9861";

TEST(Otar, BlocksOfAnotherImplementationAreOpened) {
  const Octets pdu = octets_of(otar_pdu);
  OctetReader in(pdu);
  EXPECT_EQ(in.u8(), 1) << "tag";
  const std::size_t length = in.u16();
  ASSERT_EQ(length, in.remaining()) << "octets";
  EXPECT_EQ(in.u16(), 0) << "master key";
  const OctetView iv = in.bytes(sdls_iv_octets);
  const OctetView blocks = in.bytes(3 * SealedKey::block_octets);

  const auto opened = aes_gcm_open(key_of(master_0), iv, {}, blocks, in.rest());

  ASSERT_TRUE(opened);
  std::vector<int> ids;
  for (std::size_t at = 0; at < opened->size(); at += SealedKey::block_octets)
    ids.push_back(OctetReader(OctetView(*opened).subspan(at)).u16());
  EXPECT_EQ(ids, (std::vector{141, 140, 142}));
  EXPECT_EQ(to_hex(OctetView(*opened).subspan(2, 4)), "2ceecd32");
}

TEST(Otar, AKeyIsOpenedAsItWasSealedAndWithNoOctetChanged) {
  const SdlsKey key = key_of(key_132);
  const Octets iv = octets_of("344892bbc54f5395297d4c37");
  const auto sealed = seal_key(key_of(master_0), iv, 200, key);
  ASSERT_TRUE(sealed);

  const auto opened = open_key(key_of(master_0), sealed->iv_block_mac);

  ASSERT_TRUE(opened);
  EXPECT_EQ(opened->id, 200);
  EXPECT_EQ(opened->key.octets(), key.octets());
  for (std::size_t i = 0; i < SealedKey::octets; ++i) {
    auto bad = sealed->iv_block_mac;
    bad.at(i) ^= 1;
    EXPECT_EQ(open_key(key_of(master_0), bad).error(), SdlsError::bad_mac) << i;
  }
  EXPECT_EQ(open_key(key_of(key_132), sealed->iv_block_mac).error(), SdlsError::bad_mac);
  EXPECT_EQ(open_key(key_of(master_0), OctetView(sealed->iv_block_mac).first(60)).error(),
            SdlsError::too_short);
}

/// Its IV is 1; here it never is, see answering_sender.
TEST(KeyVerification, TheAnswerOfAnotherImplementationIsRight) {
  const auto challenge = array_of<16>("71fc3ad5b1c36ad56bd5a5432315cdab");
  const Octets answer =
      octets_of("000000000000000000000001d8eaa795affaa0e951bb6cf0116192e16b1977d6723e92e01123ccef548e2885");
  EXPECT_TRUE(is_right_answer(key_of(key_132), challenge, answer));
  EXPECT_FALSE(is_right_answer(key_of(master_0), challenge, answer)) << "another key";
  EXPECT_FALSE(is_right_answer(key_of(key_132), {}, answer)) << "another challenge";
  EXPECT_FALSE(is_right_answer(key_of(key_132), challenge, OctetView(answer).first(43)));
}

TEST(KeyVerification, AnAnswerUsesNoVectorOfAFrameAndNoneTwice) {
  const auto challenge = array_of<16>("71fc3ad5b1c36ad56bd5a5432315cdab");
  const auto first = answer_challenge(key_of(key_132), 7, challenge);
  const auto second = answer_challenge(key_of(key_132), 8, challenge);
  ASSERT_TRUE(first && second);
  EXPECT_TRUE(is_right_answer(key_of(key_132), challenge, first->iv_answer_mac));
  EXPECT_EQ(to_hex(OctetView(first->iv_answer_mac).first(12)), "ffffffff0000000000000007");
  EXPECT_NE(first->iv_answer_mac, second->iv_answer_mac);
}

}  // namespace
}  // namespace srfs::wire
