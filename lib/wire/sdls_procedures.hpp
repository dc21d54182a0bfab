// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
// What the procedures of CCSDS 355.1-B (SDLS Extended Procedures) compute. Their PDUs are telecommands and
// reports of the mission dictionary (msgs/mission/keys.yaml), octet by octet.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

#include "base/octets.hpp"
#include "base/result.hpp"
#include "wire/sdls.hpp"

namespace srfs::wire {

/// Tag and length before the content of each PDU (355.1-B 5.2).
inline constexpr std::size_t procedure_header_octets = 3;

/// A key as it goes up by OTAR: its id and its octets, sealed under a key-encryption key.
struct SealedKey {
  static constexpr std::size_t block_octets = 2 + sdls_key_octets;
  static constexpr std::size_t octets = sdls_iv_octets + block_octets + sdls_mac_octets;
  std::array<std::uint8_t, octets> iv_block_mac{};  ///< as in the PDU, behind the id of the master key
};
struct UploadedKey {
  std::uint16_t id = 0;
  SdlsKey key;
};
/// @param iv  sdls_iv_octets, never used before with @p master. @return cipher_failed alone
[[nodiscard]] Result<SealedKey, SdlsError> seal_key(const SdlsKey& master, OctetView iv, std::uint16_t id,
                                                    const SdlsKey& key);
/// @param sealed  SealedKey::octets. @return too_short, bad_mac: not made with this master key, or altered
[[nodiscard]] Result<UploadedKey, SdlsError> open_key(const SdlsKey& master, OctetView sealed);

/// Key verification: who can seal a challenge has the key.
using Challenge = std::array<std::uint8_t, 16>;
struct ChallengeAnswer {
  static constexpr std::size_t octets = sdls_iv_octets + sizeof(Challenge) + sdls_mac_octets;
  std::array<std::uint8_t, octets> iv_answer_mac{};  ///< as in the PDU, behind the key id
};
/// @param serial  never used before with @p key. High 32 bits of the IV are ones, which no sender of frames
/// has: an IV of a frame is never met
[[nodiscard]] Result<ChallengeAnswer, SdlsError> answer_challenge(const SdlsKey& key, std::uint64_t serial,
                                                                  const Challenge& challenge);
/// High 32 bits of the IV of answers.
inline constexpr std::uint32_t answering_sender = 0xFFFFFFFF;
/// @param answer  ChallengeAnswer::octets
[[nodiscard]] bool is_right_answer(const SdlsKey& key, const Challenge& challenge, OctetView answer);

}  // namespace srfs::wire
