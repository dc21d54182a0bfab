// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "base/sha256.hpp"

#include <cstdlib>

#include <fmt/format.h>
#include <openssl/crypto.h>
#include <openssl/evp.h>
#include <openssl/hmac.h>

namespace srfs {

struct Sha256::Context {
  EVP_MD_CTX* hash = EVP_MD_CTX_new();
  Context() = default;
  Context(const Context&) = delete;
  Context& operator=(const Context&) = delete;
  ~Context() { EVP_MD_CTX_free(hash); }
};

Sha256::Sha256() : context_(std::make_unique<Context>()) {
  // Fails for lack of memory only.
  if (EVP_DigestInit_ex(context_->hash, EVP_sha256(), nullptr) != 1) std::abort();
}
Sha256::~Sha256() = default;
Sha256::Sha256(Sha256&&) noexcept = default;
Sha256& Sha256::operator=(Sha256&&) noexcept = default;

void Sha256::update(OctetView data) {
  if (EVP_DigestUpdate(context_->hash, data.data(), data.size()) != 1) std::abort();
}

Sha256::Digest Sha256::finish() {
  Digest digest{};
  if (EVP_DigestFinal_ex(context_->hash, digest.data(), nullptr) != 1) std::abort();
  return digest;
}

std::string to_digits(const Sha256::Digest& digest) {
  std::string digits;
  for (const std::uint8_t octet : digest) digits += fmt::format("{:02x}", octet);
  return digits;
}

Sha256::Digest sha256_of(OctetView data) {
  Sha256 sha;
  sha.update(data);
  return sha.finish();
}

Sha256::Digest hmac_sha256(OctetView key, OctetView data) {
  Sha256::Digest digest{};
  // Fails for lack of memory only.
  if (HMAC(EVP_sha256(), key.data(), static_cast<int>(key.size()), data.data(), data.size(), digest.data(),
           nullptr) == nullptr)
    std::abort();
  return digest;
}

bool equal_secrets(OctetView a, OctetView b) {
  return a.size() == b.size() && CRYPTO_memcmp(a.data(), b.data(), a.size()) == 0;
}

}  // namespace srfs
