// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "wire/tm_sdls.hpp"

#include <openssl/core_names.h>
#include <openssl/crypto.h>
#include <openssl/evp.h>
#include <openssl/params.h>

#include <algorithm>
#include <cassert>

#include "wire/crc16.hpp"
#include "wire/tm_frame.hpp"

namespace srfs::wire {
namespace {

/// The algorithm, looked up once, without a configuration file (sdls.cpp says why).
EVP_MAC* cmac() {
  static EVP_MAC* const algorithm = [] {
    OPENSSL_init_crypto(OPENSSL_INIT_NO_LOAD_CONFIG | OPENSSL_INIT_NO_LOAD_CRYPTO_STRINGS, nullptr);
    return EVP_MAC_fetch(nullptr, "CMAC", nullptr);
  }();
  return algorithm;
}

EVP_MAC_CTX* as_context(void* context) {
  return static_cast<EVP_MAC_CTX*>(context);
}

/// What the MAC covers before the operational control field: all in front of the MAC.
OctetView covered_octets(OctetView frame) {
  return frame.first(frame.size() - tm_fecf_octets - tm_ocf_octets - tm_sdls_mac_octets);
}

}  // namespace

std::string_view to_string(TmSdlsError error) {
  switch (error) {
    case TmSdlsError::too_short:
      return "no room for security fields";
    case TmSdlsError::wrong_spi:
      return "another security association";
    case TmSdlsError::bad_mac:
      return "authentication failed";
    case TmSdlsError::bad_header_pointer:
      return "first header pointer outside the data";
    case TmSdlsError::cipher_failed:
      return "cipher failed";
  }
  return "?";
}

void TmAuthenticator::End::operator()(void* context) const {
  EVP_MAC_CTX_free(as_context(context));
}

std::optional<TmAuthenticator> TmAuthenticator::create(SdlsKey key) {
  if (cmac() == nullptr) return std::nullopt;
  TmAuthenticator authenticator(std::move(key), EVP_MAC_CTX_new(cmac()));
  if (!authenticator.context_ || !authenticator.mac({}, {})) return std::nullopt;
  return authenticator;
}

std::optional<TmMac> TmAuthenticator::mac(OctetView first, OctetView second) {
  EVP_MAC_CTX* const context = as_context(context_.get());
  std::array<char, 12> cipher{"AES-256-CBC"};
  const std::array<OSSL_PARAM, 2> params{
      OSSL_PARAM_construct_utf8_string(OSSL_MAC_PARAM_CIPHER, cipher.data(), 0), OSSL_PARAM_construct_end()};
  TmMac mac{};
  std::size_t written = 0;
  // With its key each time: not every OpenSSL 3.0 begins anew without one.
  const bool done = EVP_MAC_init(context, key_.octets().data(), key_.octets().size(), params.data()) == 1 &&
                    EVP_MAC_update(context, first.data(), first.size()) == 1 &&
                    EVP_MAC_update(context, second.data(), second.size()) == 1 &&
                    EVP_MAC_final(context, mac.data(), &written, mac.size()) == 1 && written == mac.size();
  return done ? std::optional(mac) : std::nullopt;
}

Octets encode_tm_frame(const TmFrame& frame, TmSeal& seal, std::uint64_t number) {
  assert(number <= tm_sdls_number_max);
  OctetWriter data(tm_frame_octets_max);
  data.u16(seal.spi);
  data.put(number, tm_sdls_number_octets);
  data.bytes(frame.data);
  data.bytes(TmMac{});
  TmFrame whole = frame;
  whole.data = data.take();
  Octets octets = encode_tm_frame(whole);
  const std::size_t at_mac = covered_octets(octets).size();
  const std::size_t at_fecf = octets.size() - tm_fecf_octets;
  const auto mac = seal.authenticator ? seal.authenticator->mac(
                                            covered_octets(octets),
                                            OctetView(octets).subspan(at_fecf - tm_ocf_octets, tm_ocf_octets))
                                      : std::nullopt;
  if (!mac) return octets;
  std::copy(mac->begin(), mac->end(), octets.begin() + static_cast<std::ptrdiff_t>(at_mac));
  const std::uint16_t fecf = crc16(OctetView(octets).first(at_fecf));
  octets[at_fecf] = static_cast<std::uint8_t>(fecf >> 8);
  octets[at_fecf + 1] = static_cast<std::uint8_t>(fecf & 0xFF);
  return octets;
}

Result<std::uint64_t, TmSdlsError> tm_sdls_open(OctetView octets, TmFrame& frame, std::uint16_t spi,
                                                TmAuthenticator& authenticator) {
  using Error = TmSdlsError;
  if (frame.data.size() <= tm_sdls_overhead_octets) return Err(Error::too_short);
  OctetReader in(frame.data);
  if (in.u16() != spi) return Err(Error::wrong_spi);
  const std::uint64_t number = std::uint64_t{in.u16()} << 32;
  const std::uint64_t low = in.u32();
  const OctetView ocf = octets.last(tm_ocf_octets + tm_fecf_octets).first(tm_ocf_octets);
  const auto expected = authenticator.mac(covered_octets(octets), ocf);
  if (!expected) return Err(Error::cipher_failed);
  const OctetView found = OctetView(frame.data).last(tm_sdls_mac_octets);
  if (CRYPTO_memcmp(expected->data(), found.data(), expected->size()) != 0) return Err(Error::bad_mac);
  if (!tm_sdls_strip(frame)) return Err(Error::bad_header_pointer);
  return number | low;
}

bool tm_sdls_strip(TmFrame& frame) {
  if (frame.data.size() <= tm_sdls_overhead_octets) return false;
  const OctetView data =
      OctetView(frame.data).subspan(tm_sdls_header_octets, frame.data.size() - tm_sdls_overhead_octets);
  if (frame.first_header < only_idle_data && frame.first_header >= data.size()) return false;
  frame.data = Octets(data.begin(), data.end());
  return true;
}

}  // namespace srfs::wire
