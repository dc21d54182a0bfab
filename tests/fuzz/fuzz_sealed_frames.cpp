// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
// Sealed TM frames of a stranger: right to the last octet but for the MAC, and genuine ones that were
// altered.
#include <algorithm>
#include <array>
#include <cstdlib>

#include "wire/crc16.hpp"
#include "wire/tm_frame.hpp"

namespace {

using namespace srfs;
using namespace srfs::wire;

constexpr std::uint16_t spacecraft = 0xAB;
constexpr std::uint16_t spi = 16;
constexpr std::size_t frame_octets = 80;

TmAuthenticator& authenticator() {
  static TmAuthenticator made =
      std::move(*TmAuthenticator::create(SdlsKey(std::array<std::uint8_t, sdls_key_octets>{7})));
  return made;
}

void set_fecf(Octets& octets) {
  const std::size_t at = octets.size() - tm_fecf_octets;
  const std::uint16_t crc = crc16(OctetView(octets).first(at));
  octets[at] = static_cast<std::uint8_t>(crc >> 8);
  octets[at + 1] = static_cast<std::uint8_t>(crc & 0xFF);
}

/// @return whether it was taken for authentic
bool take(const Octets& octets, TmPacketReassembly& shown) {
  auto frame = decode_tm_frame(octets, spacecraft, octets.size());
  if (!frame) return false;
  TmFrame stripped = *frame;
  if (tm_sdls_strip(stripped)) (void)shown.push(stripped);
  return tm_sdls_open(octets, *frame, spi, authenticator()).has_value();
}

}  // namespace

/// Frames one after the other; the first octet of each says whether its octets are a frame or altered bits.
extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  TmPacketReassembly shown;
  TmFrameBuilder builder({.spacecraft_id = spacecraft, .frame_octets = frame_octets},
                         TmSeal{.spi = spi,
                                .authenticator = TmAuthenticator::create(
                                    SdlsKey(std::array<std::uint8_t, sdls_key_octets>{7}))});
  std::uint64_t number = 0;
  OctetReader in(OctetView(data, size));
  while (in.remaining() > 0) {
    const bool altered = in.u8() % 2 == 0;
    const Octets genuine = builder.build(0, 0x01040006, ++number);
    Octets octets = altered ? genuine : Octets(frame_octets, 0);
    const OctetView some = in.bytes(std::min(frame_octets, in.remaining()));
    for (std::size_t i = 0; i < some.size(); ++i) octets[i] ^= some[i];
    set_fecf(octets);
    if (take(octets, shown) && octets != genuine) std::abort();
  }
  if (!take(builder.build_idle(0, ++number), shown)) std::abort();
  return 0;
}
