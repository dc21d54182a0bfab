// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <optional>

#include "base/octets.hpp"
#include "base/sha256.hpp"
#include "wire/cfdp_checksum.hpp"

namespace srfs::cfdp {

/// CFDP checksum and SHA-256 of a file, taken piece by piece in one reading.
class FileDigest {
 public:
  explicit FileDigest(wire::CfdpChecksum checksum) : checksum_(checksum) {}

  void update(OctetView data);
  [[nodiscard]] std::uint64_t octets() const { return octets_; }
  [[nodiscard]] std::uint32_t checksum() const { return checksum_.value(); }
  /// Of everything so far; nothing may follow.
  [[nodiscard]] Sha256::Digest finish() { return hash_.finish(); }

 private:
  wire::CfdpChecksum checksum_;
  Sha256 hash_;
  std::uint64_t octets_ = 0;
};

/// The SHA-256 of a file travels in its Metadata PDU as a message to user: "SRFS-SHA256" and 32 octets. An
/// implementation that does not know it passes it over.
[[nodiscard]] wire::CfdpTlv sha256_option(const Sha256::Digest& hash);
[[nodiscard]] std::optional<Sha256::Digest> sha256_of(const wire::CfdpMetadata& metadata);

}  // namespace srfs::cfdp
