// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
// Reassembly of packets from frames with arbitrary counters and pointers.
#include <cstdlib>

#include "wire/tm_frame.hpp"

/// Cuts the input into frames: counter step, two octets of first header pointer, length, data field.
extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace srfs;
  using namespace srfs::wire;
  (void)decode_tm_frame(OctetView(data, size), 0xAB, tm_frame_octets_min);
  constexpr std::size_t longest_packet = 4096;
  TmPacketReassembly reassembly(longest_packet);
  OctetReader in(OctetView(data, size));
  std::uint8_t count = 0;
  while (in.remaining() > 0) {
    // Mostly the next frame, but sometimes a gap.
    const std::uint8_t step = in.u8();
    count = static_cast<std::uint8_t>(count + (step < 224 ? 1 : step));
    TmFrame frame{.vc_count = count, .first_header = static_cast<std::uint16_t>(in.u16() & 0x7FF)};
    const OctetView field = in.bytes(std::min<std::size_t>(in.u8(), in.remaining()));
    frame.data.assign(field.begin(), field.end());
    for (const Octets& packet : reassembly.push(frame)) {
      if (packet.size() > longest_packet || !decode_space_packet(packet)) std::abort();
    }
  }
  return 0;
}
