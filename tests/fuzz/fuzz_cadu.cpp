// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
// The downlink as received from the line: synchroniser, Reed-Solomon, frame, packets.
#include <cstdlib>

#include "wire/cadu.hpp"
#include "wire/tm_frame.hpp"

/// The first octet selects the settings and the size of the pieces; the octets of the line follow.
extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace srfs;
  using namespace srfs::wire;
  if (size == 0) return 0;
  const bool coded = (data[0] & 1) != 0;
  const CaduFormat format{.frame_octets = 40,
                          .reed_solomon = coded,
                          .interleave = (data[0] & 2) != 0 ? 2U : 1U,
                          .randomize = (data[0] & 4) != 0};
  CaduSynchroniser synchroniser(format);
  TmFrameDecoder decoder(0xAB, format.frame_octets);
  TmPacketReassembly reassembly;
  const auto use = [&](const Octets& octets) {
    const auto frame = decoder.decode(octets);
    if (frame) (void)reassembly.push(*frame);
  };
  const std::size_t piece = 1 + (data[0] >> 3) * std::size_t{7};
  for (OctetView line(data + 1, size - 1); !line.empty();) {
    const OctetView part = line.first(std::min(piece, line.size()));
    for (const auto& found : synchroniser.push(part)) use(found.frame);
    line = line.subspan(part.size());
  }

  // After any input, at least the second of two good CADUs must be found once both have arrived.
  TmFrameBuilder builder({.spacecraft_id = 0xAB, .frame_octets = format.frame_octets});
  std::size_t found_good = 0;
  for (int i = 0; i < 2; ++i) {
    const Octets good = builder.build(0, 0);
    for (const auto& found : synchroniser.push(encode_cadu(good, format)))
      found_good += found.frame == good ? 1 : 0;
  }
  if (found_good == 0) std::abort();
  return 0;
}
