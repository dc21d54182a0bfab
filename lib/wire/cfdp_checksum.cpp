// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "wire/cfdp_checksum.hpp"

#include <array>

namespace srfs::wire {
namespace {

using Table = std::array<std::uint32_t, 256>;

constexpr Table make_table(std::uint32_t reflected_polynomial) {
  Table table{};
  for (std::uint32_t i = 0; i < table.size(); ++i) {
    std::uint32_t r = i;
    for (int bit = 0; bit < 8; ++bit) r = (r & 1U) != 0 ? r >> 1 ^ reflected_polynomial : r >> 1;
    table[i] = r;
  }
  return table;
}

constexpr Table crc32_table = make_table(0xEDB8'8320U);
constexpr Table crc32c_table = make_table(0x82F6'3B78U);

std::uint32_t crc(const Table& table, std::uint32_t before, OctetView data) {
  std::uint32_t r = ~before;
  for (const std::uint8_t octet : data) r = r >> 8 ^ table[(r ^ octet) & 0xFF];
  return ~r;
}

}  // namespace

std::optional<CfdpChecksum> CfdpChecksum::of_type(std::uint8_t type) {
  switch (static_cast<CfdpChecksumType>(type)) {
    case CfdpChecksumType::modular:
    case CfdpChecksumType::crc32c:
    case CfdpChecksumType::crc32:
    case CfdpChecksumType::null:
      return CfdpChecksum(static_cast<CfdpChecksumType>(type));
  }
  return std::nullopt;
}

void CfdpChecksum::update(OctetView data) {
  switch (type_) {
    case CfdpChecksumType::modular:
      // The sum of the words that stand at multiples of four, the last one filled with zeros.
      for (const std::uint8_t octet : data) {
        value_ += static_cast<std::uint32_t>(octet) << (24 - 8 * (octets_ % 4));
        ++octets_;
      }
      break;
    case CfdpChecksumType::crc32c:
      value_ = crc(crc32c_table, value_, data);
      break;
    case CfdpChecksumType::crc32:
      value_ = crc(crc32_table, value_, data);
      break;
    case CfdpChecksumType::null:
      break;
  }
}

}  // namespace srfs::wire
