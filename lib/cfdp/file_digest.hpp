// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <optional>

#include "base/octets.hpp"
#include "wire/cfdp_checksum.hpp"

namespace srfs::cfdp {

using Sha256 = std::array<std::uint8_t, 32>;

/// CFDP checksum and SHA-256 of a file, taken piece by piece in one reading.
class FileDigest {
 public:
  explicit FileDigest(wire::CfdpChecksum checksum);
  ~FileDigest();
  FileDigest(FileDigest&&) noexcept;
  FileDigest& operator=(FileDigest&&) noexcept;
  FileDigest(const FileDigest&) = delete;
  FileDigest& operator=(const FileDigest&) = delete;

  void update(OctetView data);
  [[nodiscard]] std::uint64_t octets() const { return octets_; }
  [[nodiscard]] std::uint32_t checksum() const { return checksum_.value(); }
  /// Of everything so far; nothing may follow.
  [[nodiscard]] Sha256 finish();

 private:
  struct Hash;
  wire::CfdpChecksum checksum_;
  std::unique_ptr<Hash> hash_;
  std::uint64_t octets_ = 0;
};

/// The SHA-256 of a file travels in its Metadata PDU as a message to user: "SRFS-SHA256" and 32 octets. An
/// implementation that does not know it passes it over.
[[nodiscard]] wire::CfdpTlv sha256_option(const Sha256& hash);
[[nodiscard]] std::optional<Sha256> sha256_of(const wire::CfdpMetadata& metadata);

}  // namespace srfs::cfdp
