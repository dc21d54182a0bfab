// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "wire/sdls_procedures.hpp"

#include <openssl/crypto.h>

#include <algorithm>
#include <cassert>

#include "wire/aes_gcm.hpp"

namespace srfs::wire {

Result<SealedKey, SdlsError> seal_key(const SdlsKey& master, OctetView iv, std::uint16_t id,
                                      const SdlsKey& key) {
  assert(iv.size() == sdls_iv_octets);
  std::array<std::uint8_t, SealedKey::block_octets> block{};
  block[0] = static_cast<std::uint8_t>(id >> 8);
  block[1] = static_cast<std::uint8_t>(id & 0xFF);
  std::copy(key.octets().begin(), key.octets().end(), block.begin() + 2);
  SealedKey sealed;
  std::copy(iv.begin(), iv.end(), sealed.iv_block_mac.begin());
  std::uint8_t* const cipher_text = sealed.iv_block_mac.data() + sdls_iv_octets;
  const bool done = aes_gcm_seal(master, iv, {}, block, cipher_text, cipher_text + block.size());
  OPENSSL_cleanse(block.data(), block.size());
  if (!done) return Err(SdlsError::cipher_failed);
  return sealed;
}

Result<UploadedKey, SdlsError> open_key(const SdlsKey& master, OctetView sealed) {
  if (sealed.size() != SealedKey::octets) return Err(SdlsError::too_short);
  auto block =
      aes_gcm_open(master, sealed.first(sdls_iv_octets), {},
                   sealed.subspan(sdls_iv_octets, SealedKey::block_octets), sealed.last(sdls_mac_octets));
  if (!block) return Err(block.error());
  std::array<std::uint8_t, sdls_key_octets> key{};
  std::copy(block->begin() + 2, block->end(), key.begin());
  UploadedKey uploaded{.id = OctetReader(*block).u16(), .key = SdlsKey(key)};
  OPENSSL_cleanse(key.data(), key.size());
  OPENSSL_cleanse(block->data(), block->size());
  return uploaded;
}

Result<ChallengeAnswer, SdlsError> answer_challenge(const SdlsKey& key, std::uint64_t serial,
                                                    const Challenge& challenge) {
  OctetWriter iv(sdls_iv_octets);
  iv.u32(answering_sender);
  iv.u64(serial);
  ChallengeAnswer answer;
  std::copy(iv.view().begin(), iv.view().end(), answer.iv_answer_mac.begin());
  std::uint8_t* const cipher_text = answer.iv_answer_mac.data() + sdls_iv_octets;
  if (!aes_gcm_seal(key, iv.view(), {}, challenge, cipher_text, cipher_text + challenge.size()))
    return Err(SdlsError::cipher_failed);
  return answer;
}

bool is_right_answer(const SdlsKey& key, const Challenge& challenge, OctetView answer) {
  if (answer.size() != ChallengeAnswer::octets) return false;
  const auto plain =
      aes_gcm_open(key, answer.first(sdls_iv_octets), {}, answer.subspan(sdls_iv_octets, challenge.size()),
                   answer.last(sdls_mac_octets));
  return plain && std::equal(plain->begin(), plain->end(), challenge.begin(), challenge.end());
}

}  // namespace srfs::wire
