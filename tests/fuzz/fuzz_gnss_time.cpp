// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
// The GNSS receiver's line: NMEA and UBX in any mixture.
#include <cstdlib>

#include "wire/gnss_time.hpp"
#include "wire/nmea.hpp"
#include "wire/ubx.hpp"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace srfs;
  using namespace srfs::wire;
  const OctetView input(data, size);
  (void)parse_nmea(std::string_view(reinterpret_cast<const char*>(data), size));
  (void)parse_nav_timeutc(input);

  // Any division of the octets into reads gives the same times.
  GnssTimeStream stream;
  const auto at_once = stream.push(input);
  GnssTimeStream octet_by_octet;
  std::vector<GnssTime> one_by_one;
  for (std::size_t i = 0; i < size; ++i) {
    for (const GnssTime& time : octet_by_octet.push(input.subspan(i, 1))) one_by_one.push_back(time);
  }
  if (at_once != one_by_one) std::abort();
  const UtcTime not_before(seconds(1'767'225'600));
  for (const GnssTime& time : at_once) {
    if (!time.utc) continue;
    const auto resolved = in_era_of(*time.utc, not_before);
    if (resolved && (*resolved < not_before || *resolved - not_before >= std::chrono::hours(1024 * 7 * 24)))
      std::abort();
  }

  // After any input, once an announced frame has ended, the next sentence must be read.
  (void)stream.push(Octets(ubx_payload_octets_max + ubx_overhead_octets, '\n'));
  const std::string_view good = "$GPZDA,080000,21,11,2026,00,00*45\r\n";
  if (stream.push(OctetView(reinterpret_cast<const std::uint8_t*>(good.data()), good.size())).empty())
    std::abort();
  return 0;
}
