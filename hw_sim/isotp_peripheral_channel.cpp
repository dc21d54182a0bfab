// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "hw_sim/isotp_peripheral_channel.hpp"

#include <tuple>

namespace srfs::sim {
namespace {

constexpr std::uint8_t computer_address = 0x01;

wire::IsoTpSettings peripheral_transport() {
  wire::IsoTpSettings settings;
  // A small controller is patient: it waits the standard's time for the bus, not the computer's shorter one.
  settings.n_as = milliseconds(100);
  settings.n_bs = milliseconds(100);
  settings.n_cr = milliseconds(100);
  return settings;
}

}  // namespace

IsoTpPeripheralChannel::IsoTpPeripheralChannel(std::uint8_t address)
    : channel_({.target = computer_address, .source = address}, peripheral_transport()) {}

std::vector<wire::CanIdentifierPair> IsoTpPeripheralChannel::identifiers() const {
  return {{.request = channel_.receive_id(), .answer = channel_.transmit_id()}};
}

std::optional<Octets> IsoTpPeripheralChannel::take_request() {
  if (channel_.messages_waiting() == 0) return std::nullopt;
  const OctetView message = channel_.front_message();
  Octets request(message.begin(), message.end());
  channel_.pop_message();
  return request;
}

std::optional<wire::CanDataFrame> IsoTpPeripheralChannel::poll(MonotonicTime now) {
  auto frame = channel_.poll(now);
  if (!frame) {
    std::ignore = channel_.take_send_result();
    std::ignore = channel_.take_receive_error();
  }
  return frame;
}

PeripheralChannel::Counters IsoTpPeripheralChannel::counters() const {
  const wire::IsoTpCounters& c = channel_.counters();
  return {.frames_sent = c.frames_sent,
          .frames_received = c.frames_received,
          .timeouts = c.timeouts_as + c.timeouts_bs + c.timeouts_cr};
}

}  // namespace srfs::sim
