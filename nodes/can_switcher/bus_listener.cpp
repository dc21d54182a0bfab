// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "nodes/can_switcher/bus_listener.hpp"

#include "base/log.hpp"
#include "hw/open.hpp"
#include "wire/can_bits.hpp"

namespace srfs {

BusListener::BusListener(std::unique_ptr<hw::CanBus> bus) : bus_(std::move(bus)), meter_(monotonic_now()) {}

std::unique_ptr<BusListener> BusListener::open(const std::string& uri, const std::filesystem::path& var) {
  auto bus = hw::open_can(uri, var);
  if (!bus) {
    log::error("cannot measure the CAN bus load: {}", bus.error().message);
    return nullptr;
  }
  return std::unique_ptr<BusListener>(new BusListener(std::move(*bus)));
}

void BusListener::listen() {
  for (int i = 0; i < frames_per_turn; ++i) {
    const auto frame = bus_->receive();
    if (!frame) return;
    unattended_.on_frame(frame->id, frame->extended, frame->timestamp);
    meter_.on_frame(frame->id, frame->extended,
                    wire::can_bits_on_wire({.id = frame->id,
                                            .extended = frame->extended,
                                            .remote = frame->remote,
                                            .size = frame->size,
                                            .data = frame->view()}));
  }
}

BusMeter::Flood BusListener::end_window() {
  return meter_.end_window(monotonic_now(), bus_->controller().bit_rate.value_or(usual_bit_rate));
}

}  // namespace srfs
