// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
// Messages from the simulated camera. The result is a frame or a reason, and never more than the announced
// frame.
#include <algorithm>
#include <cstdlib>

#include "hw/camera/sim_camera_protocol.hpp"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  namespace sim = srfs::hw::sim_camera;
  constexpr int width = 8;
  constexpr int height = 4;
  sim::FrameAssembler assembler(width, height, 12);
  assembler.expect(1);
  // Input: messages, each after a length of one octet.
  for (std::size_t at = 0; at < size;) {
    const std::size_t length = std::min<std::size_t>(data[at], size - at - 1);
    const srfs::OctetView message(data + at + 1, length);
    at += 1 + length;
    if (const auto request = sim::decode_request(message); request && sim::encode(*request).size() != length)
      std::abort();
    const auto reply = sim::decode_reply(message);
    if (!reply) continue;
    const auto frame = assembler.on_reply(*reply);
    if (!frame) {
      if (frame.error().empty()) std::abort();
      assembler.expect(1);
      continue;
    }
    if (*frame && ((*frame)->pixels.width() != width || (*frame)->pixels.height() != height)) std::abort();
  }
  return 0;
}
