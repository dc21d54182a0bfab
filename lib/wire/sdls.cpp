// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "wire/sdls.hpp"

#include <openssl/crypto.h>

#include <algorithm>

#include "wire/aes_gcm.hpp"

namespace srfs::wire {
namespace {

constexpr std::size_t aad_octets = 20;
using Aad = std::array<std::uint8_t, aad_octets>;
using Iv = std::array<std::uint8_t, sdls_iv_octets>;
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
  if (!aes_gcm_seal(seal.key, iv, make_aad(header_covered, segment_header, seal.spi), packet,
                    data.data() + clear, data.data() + clear + packet.size())) {
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
  auto packet = aes_gcm_open(key, iv, make_aad(header, opened.segment_header, spi), cipher_text, in.rest());
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
