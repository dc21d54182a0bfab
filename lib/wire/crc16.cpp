// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "wire/crc16.hpp"

#include <array>

namespace srfs::wire {
namespace {

constexpr std::array<std::uint16_t, 256> make_table() {
  std::array<std::uint16_t, 256> table{};
  for (unsigned value = 0; value < 256; ++value) {
    unsigned crc = value << 8;
    for (int bit = 0; bit < 8; ++bit) crc = (crc & 0x8000U) != 0 ? crc << 1 ^ 0x1021U : crc << 1;
    table[value] = static_cast<std::uint16_t>(crc);
  }
  return table;
}

constexpr auto table = make_table();

}  // namespace

std::uint16_t crc16(OctetView data, std::uint16_t preset) {
  std::uint16_t crc = preset;
  for (const std::uint8_t octet : data) {
    crc = static_cast<std::uint16_t>(crc << 8 ^ table[(crc >> 8 ^ octet) & 0xFF]);
  }
  return crc;
}

}  // namespace srfs::wire
