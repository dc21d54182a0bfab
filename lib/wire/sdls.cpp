// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "wire/sdls.hpp"

#include <openssl/crypto.h>
#include <openssl/evp.h>

#include <algorithm>
#include <cassert>
#include <memory>

namespace srfs::wire {
namespace {

constexpr std::size_t aad_octets = 20;
using Aad = std::array<std::uint8_t, aad_octets>;
using Iv = std::array<std::uint8_t, sdls_iv_octets>;
using Cipher = std::unique_ptr<EVP_CIPHER_CTX, decltype(&EVP_CIPHER_CTX_free)>;

/// The algorithm, looked up once. No configuration file is read: a damaged openssl.cnf must not close the
/// uplink. Error texts are not loaded: they would be half a megabyte that is never read.
const EVP_CIPHER* aes_256_gcm() {
  static const EVP_CIPHER* const cipher = [] {
    OPENSSL_init_crypto(OPENSSL_INIT_NO_LOAD_CONFIG | OPENSSL_INIT_NO_LOAD_CRYPTO_STRINGS, nullptr);
    return EVP_CIPHER_fetch(nullptr, "AES-256-GCM", nullptr);
  }();
  return cipher;
}

Aad make_aad(const SdlsHeader& header, std::uint8_t segment_header, std::uint16_t spi) {
  Aad aad{};
  std::copy(header.octets().begin(), header.octets().end(), aad.begin());
  aad[5] = segment_header;
  aad[6] = static_cast<std::uint8_t>(spi >> 8);
  aad[7] = static_cast<std::uint8_t>(spi & 0xFF);
  return aad;
}

Iv make_iv(std::uint32_t sender, std::uint64_t counter) {
  Iv iv{};
  for (unsigned i = 0; i < 4; ++i) iv[i] = static_cast<std::uint8_t>(sender >> (8 * (3 - i)));
  for (unsigned i = 0; i < 8; ++i) iv[4 + i] = static_cast<std::uint8_t>(counter >> (8 * (7 - i)));
  return iv;
}

bool encrypt(const SdlsKey& key, const Iv& iv, const Aad& aad, OctetView packet, std::uint8_t* cipher_text,
             std::uint8_t* mac) {
  const Cipher cipher(EVP_CIPHER_CTX_new(), &EVP_CIPHER_CTX_free);
  int written = 0;
  // With GCM the final call writes no octet.
  return cipher && EVP_EncryptInit_ex(cipher.get(), aes_256_gcm(), nullptr, nullptr, nullptr) == 1 &&
         EVP_CIPHER_CTX_ctrl(cipher.get(), EVP_CTRL_GCM_SET_IVLEN, sdls_iv_octets, nullptr) == 1 &&
         EVP_EncryptInit_ex(cipher.get(), nullptr, nullptr, key.octets().data(), iv.data()) == 1 &&
         EVP_EncryptUpdate(cipher.get(), nullptr, &written, aad.data(), static_cast<int>(aad.size())) == 1 &&
         EVP_EncryptUpdate(cipher.get(), cipher_text, &written, packet.data(),
                           static_cast<int>(packet.size())) == 1 &&
         EVP_EncryptFinal_ex(cipher.get(), cipher_text + packet.size(), &written) == 1 &&
         EVP_CIPHER_CTX_ctrl(cipher.get(), EVP_CTRL_GCM_GET_TAG, sdls_mac_octets, mac) == 1;
}

Result<Octets, SdlsError> decrypt(const SdlsKey& key, const Iv& iv, const Aad& aad, OctetView cipher_text,
                                  OctetView mac) {
  const Cipher cipher(EVP_CIPHER_CTX_new(), &EVP_CIPHER_CTX_free);
  Octets packet(cipher_text.size());
  std::array<std::uint8_t, sdls_mac_octets> expected{};
  std::copy(mac.begin(), mac.end(), expected.begin());
  int written = 0;
  const bool ready =
      cipher && EVP_DecryptInit_ex(cipher.get(), aes_256_gcm(), nullptr, nullptr, nullptr) == 1 &&
      EVP_CIPHER_CTX_ctrl(cipher.get(), EVP_CTRL_GCM_SET_IVLEN, sdls_iv_octets, nullptr) == 1 &&
      EVP_DecryptInit_ex(cipher.get(), nullptr, nullptr, key.octets().data(), iv.data()) == 1 &&
      EVP_DecryptUpdate(cipher.get(), nullptr, &written, aad.data(), static_cast<int>(aad.size())) == 1 &&
      EVP_DecryptUpdate(cipher.get(), packet.data(), &written, cipher_text.data(),
                        static_cast<int>(cipher_text.size())) == 1 &&
      EVP_CIPHER_CTX_ctrl(cipher.get(), EVP_CTRL_GCM_SET_TAG, sdls_mac_octets, expected.data()) == 1;
  if (!ready) return Err(SdlsError::cipher_failed);
  std::array<std::uint8_t, 16> rest{};
  if (EVP_DecryptFinal_ex(cipher.get(), rest.data(), &written) != 1) {
    OPENSSL_cleanse(packet.data(), packet.size());
    return Err(SdlsError::bad_mac);
  }
  return packet;
}

}  // namespace

std::optional<SdlsKey> SdlsKey::from_hex(std::string_view text) {
  auto octets = srfs::from_hex(text);
  std::optional<SdlsKey> key;
  if (octets && octets->size() == sdls_key_octets) {
    std::array<std::uint8_t, sdls_key_octets> raw{};
    std::copy(octets->begin(), octets->end(), raw.begin());
    key.emplace(raw);
    OPENSSL_cleanse(raw.data(), raw.size());
  }
  if (octets) OPENSSL_cleanse(octets->data(), octets->size());
  return key;
}

SdlsKey::~SdlsKey() {
  OPENSSL_cleanse(key_.data(), key_.size());
}

SdlsKey::SdlsKey(SdlsKey&& other) noexcept : key_(other.key_) {
  OPENSSL_cleanse(other.key_.data(), other.key_.size());
}

SdlsKey& SdlsKey::operator=(SdlsKey&& other) noexcept {
  if (this != &other) {
    key_ = other.key_;
    OPENSSL_cleanse(other.key_.data(), other.key_.size());
  }
  return *this;
}

std::string_view to_string(SdlsError error) {
  switch (error) {
    case SdlsError::too_short:
      return "shorter than a secured frame";
    case SdlsError::too_long:
      return "packet too long for a secured frame";
    case SdlsError::wrong_spi:
      return "another security association";
    case SdlsError::bad_mac:
      return "authentication failed";
    case SdlsError::cipher_failed:
      return "cipher failed";
  }
  return "?";
}

Result<Octets, SdlsError> sdls_apply(const SdlsSeal& seal, const SdlsHeader& header_covered,
                                     std::uint8_t segment_header, OctetView packet) {
  if (packet.empty()) return Err(SdlsError::too_short);
  if (packet.size() > sdls_packet_octets_max) return Err(SdlsError::too_long);
  const Iv iv = make_iv(seal.sender, seal.counter);
  OctetWriter header;
  header.u8(segment_header);
  header.u16(seal.spi);
  header.bytes(iv);
  Octets data = header.take();
  const std::size_t clear = data.size();
  data.resize(clear + packet.size() + sdls_mac_octets);
  if (!encrypt(seal.key, iv, make_aad(header_covered, segment_header, seal.spi), packet, data.data() + clear,
               data.data() + clear + packet.size())) {
    return Err(SdlsError::cipher_failed);
  }
  return data;
}

Result<SdlsOpened, SdlsError> sdls_open(const SdlsKey& key, std::uint16_t spi, const SdlsHeader& header,
                                        OctetView data) {
  if (data.size() < 1 + sdls_overhead_octets + 1) return Err(SdlsError::too_short);
  OctetReader in(data);
  SdlsOpened opened;
  opened.segment_header = in.u8();
  opened.spi = in.u16();
  if (opened.spi != spi) return Err(SdlsError::wrong_spi);
  Iv iv{};
  const OctetView iv_octets = in.bytes(sdls_iv_octets);
  std::copy(iv_octets.begin(), iv_octets.end(), iv.begin());
  const OctetView cipher_text = in.bytes(in.remaining() - sdls_mac_octets);
  auto packet = decrypt(key, iv, make_aad(header, opened.segment_header, spi), cipher_text, in.rest());
  if (!packet) return Err(packet.error());
  OctetReader counter(iv);
  opened.sender = counter.u32();
  opened.counter = counter.u64();
  opened.packet = std::move(*packet);
  return opened;
}

std::optional<std::uint16_t> sdls_claimed_spi(OctetView data) {
  OctetReader in(data);
  in.u8();
  const std::uint16_t spi = in.u16();
  if (!in.ok()) return std::nullopt;
  return spi;
}

}  // namespace srfs::wire
