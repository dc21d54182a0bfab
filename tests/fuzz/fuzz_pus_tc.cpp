// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
// Telecommand packets: an accepted packet is encoded again into the same octets.
#include <cstdlib>

#include "wire/pus.hpp"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace srfs;
  using namespace srfs::wire;
  const OctetView octets(data, size);
  (void)peek_request_id(octets);
  const auto tc = parse_tc_packet(octets);
  if (tc) {
    const Octets again = make_tc_packet(*tc);
    if (!std::equal(again.begin(), again.end(), octets.begin(), octets.end())) std::abort();
  }
  (void)parse_tm_packet(octets);
  return 0;
}
