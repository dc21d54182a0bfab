// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "base/time.hpp"
#include "hw/can_bus.hpp"
#include "wire/isotp.hpp"

namespace srfs::testing_support {

[[nodiscard]] inline wire::CanDataFrame to_isotp(const hw::CanFrame& frame) {
  return {.id = frame.id, .size = frame.size, .data = frame.data};
}

/// Like a payload node, moves all frames that are due between a handle and a channel. Calls @p on_frame for
/// each frame of the peer and for the echo of each sent frame.
template <class OnFrame>
void move_frames(hw::CanBus& bus, wire::IsoTpChannel& channel, OnFrame on_frame) {
  while (const auto frame = bus.receive()) {
    on_frame(*frame);
    if (frame->is_echo) {
      channel.on_transmit_confirm(to_isotp(*frame), frame->timestamp);
    } else {
      channel.on_frame(to_isotp(*frame), frame->timestamp);
    }
  }
  while (const auto out = channel.poll(monotonic_now())) {
    if (!bus.send({.id = out->id, .size = out->size, .data = out->data})) {
      channel.on_transmit_refused(monotonic_now());
      break;
    }
  }
}
inline void move_frames(hw::CanBus& bus, wire::IsoTpChannel& channel) {
  move_frames(bus, channel, [](const hw::CanFrame&) {});
}

}  // namespace srfs::testing_support
