// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
// The uplink as received from the line: CLTU decoder, transfer frame, segment or control command, security.
#include <cstdlib>

#include "wire/cltu.hpp"
#include "wire/farm1.hpp"
#include "wire/sdls.hpp"

namespace {

using namespace srfs;
using namespace srfs::wire;

void use(const Octets& octets, FarmState& farm) {
  if (octets.size() > tc_frame_octets_max) std::abort();
  const auto frame = decode_tc_frame(octets, 0xAB);
  if (!frame) return;
  if (encode_tc_frame(*frame) != octets) std::abort();
  farm = farm_receive(farm, *frame, farm.vr % 3 != 0).state;
  if (!decode_clcw(encode_clcw(make_clcw(farm, frame->vc)))) std::abort();
  static const SdlsKey key(std::array<std::uint8_t, sdls_key_octets>{1});
  (void)sdls_open(key, 4, frame->vc, frame->data);
  const SdlsHeader whole(encode_tc_header(frame->type, 0xAB, frame->vc, frame->sequence, frame->data.size()));
  if (sdls_open(key, 4, whole, frame->data)) std::abort();  // nobody has this key
  (void)segment_payload(frame->data);
}

}  // namespace

/// The first octet selects the settings and the size of the pieces; the octets of the line follow.
extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  if (size == 0) return 0;
  CltuDecoder decoder({.randomized = (data[0] & 1) != 0, .correct_single_bits = (data[0] & 2) != 0});
  const std::size_t piece = 1 + (data[0] >> 2) * std::size_t{7};
  FarmState farm;
  MonotonicTime now;
  for (OctetView line(data + 1, size - 1); !line.empty();) {
    const OctetView part = line.first(std::min(piece, line.size()));
    for (const Octets& frame : decoder.push(part, now)) use(frame, farm);
    line = line.subspan(part.size());
    now += milliseconds(1);
  }
  for (const Octets& frame : decoder.on_idle(now + seconds(1))) use(frame, farm);
  if (decoder.in_cltu()) std::abort();

  // After any input, the next good CLTU must decode.
  const Octets good = encode_tc_frame({.spacecraft_id = 0xAB, .vc = 1, .data = {0xC0, 1, 2, 3}});
  Octets line = encode_cltu(good, (data[0] & 1) != 0);
  if ((data[0] & 2) != 0) line[0] ^= static_cast<std::uint8_t>(1U << (data[0] >> 2) % 8);
  auto frames = decoder.push(line, now + seconds(2));
  for (Octets& late : decoder.on_idle(now + seconds(4))) frames.push_back(std::move(late));
  if (frames.empty() || frames.back() != good) std::abort();
  return 0;
}
