// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "hw_sim/can_peripheral.hpp"

#include <sys/epoll.h>

namespace srfs::sim {

CanPeripheral::CanPeripheral(EventLoop& loop, std::string name, std::uint8_t address,
                             std::unique_ptr<hw::CanBus> bus, std::unique_ptr<PeripheralChannel> channel,
                             Peripheral& peripheral)
    : loop_(loop),
      name_(std::move(name)),
      address_(address),
      bus_(std::move(bus)),
      peripheral_(peripheral),
      endpoint_(address, *bus_, std::move(channel), peripheral),
      timer_(loop.add_timer([this](MonotonicTime) { service(loop_.running_now()); })) {
  loop_.watch(bus_->fd(), EPOLLIN, [this](std::uint32_t, MonotonicTime) { service(loop_.running_now()); });
  service(loop_.running_now());
}

CanPeripheral::~CanPeripheral() {
  loop_.set_timer(timer_, std::nullopt);
  loop_.unwatch(bus_->fd());
}

void CanPeripheral::service(RunningTime now) {
  endpoint_.service(now);
  loop_.set_timer(timer_, loop_.earliest(endpoint_.next_deadline(now)));
}

}  // namespace srfs::sim
