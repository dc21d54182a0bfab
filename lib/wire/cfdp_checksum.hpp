// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <optional>

#include "base/octets.hpp"
#include "wire/cfdp_pdu.hpp"

namespace srfs::wire {

/// The checksum of a file, taken over its octets in order, piece by piece (CCSDS 727.0-B-5, 4.2 and SANA
/// registry).
class CfdpChecksum {
 public:
  /// @return nullopt for an identifier without codec here
  [[nodiscard]] static std::optional<CfdpChecksum> of_type(std::uint8_t type);
  explicit CfdpChecksum(CfdpChecksumType type) : type_(type) {}

  void update(OctetView data);
  [[nodiscard]] std::uint32_t value() const { return type_ == CfdpChecksumType::null ? 0 : value_; }

 private:
  CfdpChecksumType type_;
  std::uint32_t value_ = 0;
  std::uint64_t octets_ = 0;
};

}  // namespace srfs::wire
