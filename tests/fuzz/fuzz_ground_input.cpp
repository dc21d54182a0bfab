// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
// External input of the ground tool: datagrams of the bridge, and scripts.
#include <cstdlib>

#include "ground/bridge.hpp"
#include "ground/script.hpp"
#include "wire/cltu.hpp"

/// The first octet selects the target; the datagram or the text follows.
extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace srfs;
  using namespace srfs::ground;
  if (size == 0) return 0;
  const OctetView rest(data + 1, size - 1);
  if (data[0] % 2 == 0) {
    const auto line = uplink_octets(rest, (data[0] & 2) != 0);
    if (!line) return 0;
    // Uplinked octets begin like a CLTU and are no longer than one.
    if (line->size() < 4 || (*line)[0] != 0xEB || (*line)[1] != 0x90 || line->size() > 1186) std::abort();
    return 0;
  }
  const std::string_view text(reinterpret_cast<const char*>(rest.data()), rest.size());
  static_cast<void>(parse_internet_address(text));
  const auto steps = parse_script(text, [](const auto&, const auto&) { return std::nullopt; });
  if (!steps) return 0;
  if (steps->size() > script_lines_max) std::abort();
  for (const auto& step : *steps) {
    if (step.duration < milliseconds(0)) std::abort();
  }
  return 0;
}
