// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>

#include "base/octets.hpp"
#include "base/result.hpp"
#include "wire/sdls.hpp"

namespace srfs::wire {

/// AES-256-GCM (NIST SP 800-38D) with an initialisation vector of 12 octets and a MAC of 16. The vector is
/// never used twice with one key.
/// @param cipher_text  as long as @p plain; may be where that is
/// @param mac          16 octets. @return false: the library refused to work
[[nodiscard]] bool aes_gcm_seal(const SdlsKey& key, OctetView iv, OctetView authenticated, OctetView plain,
                                std::uint8_t* cipher_text, std::uint8_t* mac);
/// The plain text; cipher_failed, or bad_mac: not made with this key, or altered.
[[nodiscard]] Result<Octets, SdlsError> aes_gcm_open(const SdlsKey& key, OctetView iv,
                                                     OctetView authenticated, OctetView cipher_text,
                                                     OctetView mac);

}  // namespace srfs::wire
