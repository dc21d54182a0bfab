// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "cfdp/file_digest.hpp"

#include <algorithm>
#include <cstdlib>
#include <string_view>

#include <openssl/evp.h>

namespace srfs::cfdp {
namespace {

constexpr std::string_view label = "SRFS-SHA256";

}  // namespace

struct FileDigest::Hash {
  EVP_MD_CTX* context = EVP_MD_CTX_new();
  Hash() = default;
  Hash(const Hash&) = delete;
  Hash& operator=(const Hash&) = delete;
  ~Hash() { EVP_MD_CTX_free(context); }
};

FileDigest::FileDigest(wire::CfdpChecksum checksum) : checksum_(checksum), hash_(std::make_unique<Hash>()) {
  // Fails for lack of memory only.
  if (EVP_DigestInit_ex(hash_->context, EVP_sha256(), nullptr) != 1) std::abort();
}
FileDigest::~FileDigest() = default;
FileDigest::FileDigest(FileDigest&&) noexcept = default;
FileDigest& FileDigest::operator=(FileDigest&&) noexcept = default;

void FileDigest::update(OctetView data) {
  checksum_.update(data);
  if (EVP_DigestUpdate(hash_->context, data.data(), data.size()) != 1) std::abort();
  octets_ += data.size();
}

Sha256 FileDigest::finish() {
  Sha256 hash{};
  if (EVP_DigestFinal_ex(hash_->context, hash.data(), nullptr) != 1) std::abort();
  return hash;
}

wire::CfdpTlv sha256_option(const Sha256& hash) {
  wire::CfdpTlv option{.type = wire::CfdpTlv::message_to_user, .value = Octets(label.begin(), label.end())};
  option.value.insert(option.value.end(), hash.begin(), hash.end());
  return option;
}

std::optional<Sha256> sha256_of(const wire::CfdpMetadata& metadata) {
  for (const wire::CfdpTlv& option : metadata.options) {
    if (option.type != wire::CfdpTlv::message_to_user) continue;
    if (option.value.size() != label.size() + Sha256{}.size()) continue;
    if (!std::equal(label.begin(), label.end(), option.value.begin())) continue;
    Sha256 hash{};
    std::copy(option.value.begin() + label.size(), option.value.end(), hash.begin());
    return hash;
  }
  return std::nullopt;
}

}  // namespace srfs::cfdp
