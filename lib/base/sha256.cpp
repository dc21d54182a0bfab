// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "base/sha256.hpp"

// SHA256_Init() and what belongs to it work on a value, at a third of EVP's cost for a short message.
#define OPENSSL_SUPPRESS_DEPRECATED
#include <array>
#include <cstdlib>

#include <fmt/format.h>
#include <openssl/crypto.h>
#include <openssl/evp.h>
#include <openssl/hmac.h>
#include <openssl/sha.h>

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
  SHA256_CTX hash;
  Sha256::Digest digest{};
  SHA256_Init(&hash);
  SHA256_Update(&hash, data.data(), data.size());
  SHA256_Final(digest.data(), &hash);
  return digest;
}

Sha256::Digest hmac_sha256(OctetView key, OctetView data) {
  Sha256::Digest digest{};
  // Fails for lack of memory only.
  if (HMAC(EVP_sha256(), key.data(), static_cast<int>(key.size()), data.data(), data.size(), digest.data(),
           nullptr) == nullptr)
    std::abort();
  return digest;
}

struct HmacSha256::State {
  SHA256_CTX inner;
  SHA256_CTX outer;
};

HmacSha256::HmacSha256(OctetView key) {
  constexpr std::uint8_t inner_pad = 0x36;
  constexpr std::uint8_t outer_pad = 0x5c;
  std::array<std::uint8_t, SHA256_CBLOCK> block{};
  const Sha256::Digest hashed = key.size() > block.size() ? sha256_of(key) : Sha256::Digest{};
  const OctetView used = key.size() > block.size() ? OctetView(hashed) : key;
  const auto padded = [&](std::uint8_t pad) {
    SHA256_CTX hash;
    SHA256_Init(&hash);
    block.fill(pad);
    for (std::size_t i = 0; i < used.size(); ++i) block[i] = static_cast<std::uint8_t>(used[i] ^ pad);
    SHA256_Update(&hash, block.data(), block.size());
    return hash;
  };
  state_ = std::make_shared<const State>(State{padded(inner_pad), padded(outer_pad)});
}

Sha256::Digest HmacSha256::of(std::initializer_list<OctetView> parts) const {
  Sha256::Digest digest{};
  SHA256_CTX hash = state_->inner;
  for (const OctetView part : parts) SHA256_Update(&hash, part.data(), part.size());
  SHA256_Final(digest.data(), &hash);
  hash = state_->outer;
  SHA256_Update(&hash, digest.data(), digest.size());
  SHA256_Final(digest.data(), &hash);
  return digest;
}

bool equal_secrets(OctetView a, OctetView b) {
  return a.size() == b.size() && CRYPTO_memcmp(a.data(), b.data(), a.size()) == 0;
}

}  // namespace srfs
