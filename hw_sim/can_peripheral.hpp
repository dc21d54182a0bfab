// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <memory>
#include <string>

#include "hw/can_bus.hpp"
#include "hw_sim/event_loop.hpp"
#include "hw_sim/peripheral.hpp"
#include "hw_sim/peripheral_endpoint.hpp"
#include "hw_sim/running_clock.hpp"

namespace srfs::sim {

/// Puts one Peripheral on a CAN bus: its own handle of the bus, and a PeripheralEndpoint that this loop
/// serves. Thin adapter.
class CanPeripheral {
 public:
  static constexpr std::uint8_t computer_address = 0x01;

  CanPeripheral(EventLoop& loop, std::string name, std::uint8_t address, std::unique_ptr<hw::CanBus> bus,
                std::unique_ptr<PeripheralChannel> channel, Peripheral& peripheral);
  ~CanPeripheral();
  CanPeripheral(const CanPeripheral&) = delete;
  CanPeripheral& operator=(const CanPeripheral&) = delete;

  /// Runs everything that is due; after a change of power or fault too.
  void service(RunningTime now);
  [[nodiscard]] const std::string& name() const { return name_; }
  [[nodiscard]] std::uint8_t address() const { return address_; }
  [[nodiscard]] Peripheral& peripheral() { return peripheral_; }
  [[nodiscard]] PeripheralChannel::Counters channel_counters() const { return endpoint_.channel_counters(); }
  [[nodiscard]] std::uint64_t babbled() const { return endpoint_.babbled(); }

 private:
  EventLoop& loop_;
  std::string name_;
  std::uint8_t address_;
  std::unique_ptr<hw::CanBus> bus_;
  Peripheral& peripheral_;
  PeripheralEndpoint endpoint_;
  EventLoop::Timer timer_;
};

}  // namespace srfs::sim
