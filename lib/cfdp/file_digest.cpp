// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "cfdp/file_digest.hpp"

#include <algorithm>
#include <string_view>

namespace srfs::cfdp {
namespace {

constexpr std::string_view label = "SRFS-SHA256";

}  // namespace

void FileDigest::update(OctetView data) {
  checksum_.update(data);
  hash_.update(data);
  octets_ += data.size();
}

wire::CfdpTlv sha256_option(const Sha256::Digest& hash) {
  wire::CfdpTlv option{.type = wire::CfdpTlv::message_to_user, .value = Octets(label.begin(), label.end())};
  option.value.insert(option.value.end(), hash.begin(), hash.end());
  return option;
}

std::optional<Sha256::Digest> sha256_of(const wire::CfdpMetadata& metadata) {
  for (const wire::CfdpTlv& option : metadata.options) {
    if (option.type != wire::CfdpTlv::message_to_user) continue;
    if (option.value.size() != label.size() + Sha256::Digest{}.size()) continue;
    if (!std::equal(label.begin(), label.end(), option.value.begin())) continue;
    Sha256::Digest hash{};
    std::copy(option.value.begin() + label.size(), option.value.end(), hash.begin());
    return hash;
  }
  return std::nullopt;
}

}  // namespace srfs::cfdp
