// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "update/sha256.hpp"

#include <cstdlib>

#include <fmt/format.h>
#include <openssl/evp.h>

namespace srfs::update {
namespace {

EVP_MD_CTX* hash(void* context) {
  return static_cast<EVP_MD_CTX*>(context);
}

}  // namespace

Sha256::Sha256() : context_(EVP_MD_CTX_new()) {
  // Fails for lack of memory only.
  if (EVP_DigestInit_ex(hash(context_), EVP_sha256(), nullptr) != 1) std::abort();
}
Sha256::~Sha256() {
  EVP_MD_CTX_free(hash(context_));
}

void Sha256::update(OctetView data) {
  if (EVP_DigestUpdate(hash(context_), data.data(), data.size()) != 1) std::abort();
}

Sha256::Digest Sha256::finish() {
  Digest digest{};
  if (EVP_DigestFinal_ex(hash(context_), digest.data(), nullptr) != 1) std::abort();
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

}  // namespace srfs::update
