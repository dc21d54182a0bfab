// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
// The file of SDLS counters and FARM-1 states: a copy with a correct checksum over arbitrary content, and the
// raw octets of the file. Checks that the file stays the same when it is read and written again, and that the
// uplink works with the result.

#include <cstdlib>

#include "base/crc32c.hpp"
#include "nodes/ttc/link/link_state.hpp"
#include "nodes/ttc/link/uplink_chain.hpp"
#include "wire/tc_uplink.hpp"

namespace {

using namespace srfs;

void require(bool condition) {
  if (!condition) std::abort();
}

wire::SdlsKey key(std::uint8_t octet) {
  return wire::SdlsKey({octet});
}

void use(const LinkState& stored, bool strict) {
  const auto again = decode_link_state(encode_link_state(stored));
  require(again && *again == stored);

  UplinkConfig config;
  config.spacecraft_id = 0xAB;
  config.strict = strict;
  UplinkChannel channel{.vc = 0, .associations = {}};
  channel.associations.push_back({.spi = 1, .key = key(1), .for_ad = true, .for_bd = true});
  config.channels.push_back(std::move(channel));
  UplinkChain uplink(std::move(config), stored);
  require(uplink.state().channels.size() <= max_link_channels);
  (void)uplink.next_clcw();

  // No lock-out: a BD frame with a higher counter always passes.
  std::uint64_t last = uplink.counter(1).value_or(0);
  if (strict && last > UplinkChain::max_strict_counter) last = 0;
  if (last == (strict ? UplinkChain::max_strict_counter : UINT64_MAX)) return;
  const wire::SdlsKey sender = key(1);
  const wire::SdlsSeal seal{sender, 1, last + 1};
  const auto cltu = wire::make_uplink_cltu({.spacecraft_id = 0xAB, .vc = 0, .whole_header = strict},
                                           wire::TcFrameType::bd, 0, &seal, Octets{1, 2, 3});
  const MonotonicTime now(seconds(1));
  auto packets = uplink.push(*cltu, now);
  for (auto& late : uplink.on_idle(now + seconds(1))) packets.push_back(std::move(late));
  require(packets.size() == 1 && uplink.counter(1) == last + 1);
  require(uplink.state().associations.size() <= max_link_associations);
  (void)encode_link_state(uplink.state());
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* input, std::size_t size) {
  const auto use_both = [](const std::optional<LinkState>& state) {
    for (const bool strict : {false, true}) {
      if (state) use(*state, strict);
    }
  };
  use_both(decode_link_state({input, size}));
  Octets copy(input, input + std::min(size, link_state_octets - 4));
  copy.resize(link_state_octets - 4);
  OctetWriter check;
  check.u32(crc32c(copy));
  copy.insert(copy.end(), check.view().begin(), check.view().end());
  use_both(decode_link_state(copy));
  return 0;
}
