// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "base/sha256.hpp"

#include <cstdlib>

#include <fmt/format.h>
#include <openssl/evp.h>

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

}  // namespace srfs
