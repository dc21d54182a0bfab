// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
// Frames from a hostile or broken peer to an ISO-TP channel. Input: records of 10 octets, each with the
// action (send, confirm, pop, time settings), frame size and eight data octets. Checks that the queue is
// bounded and that the channel is idle again within the time-outs.

#include <algorithm>
#include <cstdint>
#include <cstdlib>

#include "base/octets.hpp"
#include "wire/isotp.hpp"

namespace {

void require(bool condition) {
  if (!condition) std::abort();
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* input, std::size_t size) {
  using namespace srfs;
  OctetReader reader(OctetView(input, size));
  const std::uint8_t setup = reader.u8();
  wire::IsoTpSettings settings;
  settings.block_size = setup & 0x07U;
  settings.await_confirmation = (setup & 0x08U) != 0;
  settings.wait_frames_when_full = setup >> 4U & 0x03U;
  settings.receive_queue = 1U + (setup >> 6U);
  wire::IsoTpChannel channel({.target = 0x11, .source = 0x01}, settings);
  MonotonicTime now{seconds(1)};

  while (reader.remaining() >= 10) {
    const std::uint8_t what = reader.u8();
    wire::CanDataFrame frame{.id = channel.receive_id(), .size = reader.u8()};
    const OctetView octets = reader.bytes(8);
    std::copy(octets.begin(), octets.end(), frame.data.begin());
    now += milliseconds(what >> 3U);
    if ((what & 0x01U) != 0) (void)channel.send(OctetView(input, std::min<std::size_t>(size, 4095)), now);
    channel.on_frame(frame, now);
    for (int i = 0; i < 4; ++i) {
      const auto out = channel.poll(now);
      if (!out) break;
      require(out->size == 8);
      if ((what & 0x02U) != 0) channel.on_transmit_confirm(*out, now);
    }
    if ((what & 0x04U) != 0) channel.pop_message();
    require(channel.messages_waiting() <= settings.receive_queue);
    require(channel.front_message().size() <= wire::isotp_max_message);
  }

  for (int i = 0; i < 2000 && channel.next_deadline(); ++i) {
    now = std::max(now, *channel.next_deadline());
    (void)channel.poll(now);
  }
  require(!channel.next_deadline() && !channel.sending() && !channel.receiving());
  return 0;
}
