// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "wire/aes_gcm.hpp"

#include <openssl/crypto.h>
#include <openssl/evp.h>

#include <algorithm>
#include <array>
#include <cassert>
#include <memory>

namespace srfs::wire {
namespace {

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

}  // namespace

bool aes_gcm_seal(const SdlsKey& key, OctetView iv, OctetView authenticated, OctetView plain,
                  std::uint8_t* cipher_text, std::uint8_t* mac) {
  assert(iv.size() == sdls_iv_octets);
  const Cipher cipher(EVP_CIPHER_CTX_new(), &EVP_CIPHER_CTX_free);
  int written = 0;
  // With GCM the final call writes no octet.
  return cipher && EVP_EncryptInit_ex(cipher.get(), aes_256_gcm(), nullptr, nullptr, nullptr) == 1 &&
         EVP_CIPHER_CTX_ctrl(cipher.get(), EVP_CTRL_GCM_SET_IVLEN, sdls_iv_octets, nullptr) == 1 &&
         EVP_EncryptInit_ex(cipher.get(), nullptr, nullptr, key.octets().data(), iv.data()) == 1 &&
         (authenticated.empty() || EVP_EncryptUpdate(cipher.get(), nullptr, &written, authenticated.data(),
                                                     static_cast<int>(authenticated.size())) == 1) &&
         EVP_EncryptUpdate(cipher.get(), cipher_text, &written, plain.data(),
                           static_cast<int>(plain.size())) == 1 &&
         EVP_EncryptFinal_ex(cipher.get(), cipher_text + plain.size(), &written) == 1 &&
         EVP_CIPHER_CTX_ctrl(cipher.get(), EVP_CTRL_GCM_GET_TAG, sdls_mac_octets, mac) == 1;
}

Result<Octets, SdlsError> aes_gcm_open(const SdlsKey& key, OctetView iv, OctetView authenticated,
                                       OctetView cipher_text, OctetView mac) {
  assert(iv.size() == sdls_iv_octets && mac.size() == sdls_mac_octets);
  const Cipher cipher(EVP_CIPHER_CTX_new(), &EVP_CIPHER_CTX_free);
  Octets plain(cipher_text.size());
  std::array<std::uint8_t, sdls_mac_octets> expected{};
  std::copy(mac.begin(), mac.end(), expected.begin());
  int written = 0;
  const bool ready =
      cipher && EVP_DecryptInit_ex(cipher.get(), aes_256_gcm(), nullptr, nullptr, nullptr) == 1 &&
      EVP_CIPHER_CTX_ctrl(cipher.get(), EVP_CTRL_GCM_SET_IVLEN, sdls_iv_octets, nullptr) == 1 &&
      EVP_DecryptInit_ex(cipher.get(), nullptr, nullptr, key.octets().data(), iv.data()) == 1 &&
      (authenticated.empty() || EVP_DecryptUpdate(cipher.get(), nullptr, &written, authenticated.data(),
                                                  static_cast<int>(authenticated.size())) == 1) &&
      EVP_DecryptUpdate(cipher.get(), plain.data(), &written, cipher_text.data(),
                        static_cast<int>(cipher_text.size())) == 1 &&
      EVP_CIPHER_CTX_ctrl(cipher.get(), EVP_CTRL_GCM_SET_TAG, sdls_mac_octets, expected.data()) == 1;
  if (!ready) return Err(SdlsError::cipher_failed);
  std::array<std::uint8_t, 16> rest{};
  if (EVP_DecryptFinal_ex(cipher.get(), rest.data(), &written) != 1) {
    OPENSSL_cleanse(plain.data(), plain.size());
    return Err(SdlsError::bad_mac);
  }
  return plain;
}

}  // namespace srfs::wire
