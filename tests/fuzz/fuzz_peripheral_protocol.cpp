// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
// Messages from a hostile or broken peripheral. An accepted message must equal the output of encode(). Tests
// the input unchanged, and with a corrected CRC to reach the decoding of the bodies.

#include <algorithm>
#include <cstdint>
#include <cstdlib>

#include "base/octets.hpp"
#include "wire/crc16.hpp"
#include "wire/peripheral_protocol.hpp"

namespace {

void require(bool condition) {
  if (!condition) std::abort();
}

void decode_both_ways(srfs::OctetView message) {
  if (const auto request = srfs::wire::decode_request(message)) {
    require(std::ranges::equal(srfs::wire::encode(*request), message));
  }
  if (const auto response = srfs::wire::decode_response(message)) {
    require(std::ranges::equal(srfs::wire::encode(*response), message));
  }
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* input, std::size_t size) {
  const srfs::OctetView message(input, size);
  decode_both_ways(message);
  srfs::OctetWriter writer;
  writer.bytes(message);
  writer.u16(srfs::wire::crc16(message));
  decode_both_ways(writer.view());
  return 0;
}
