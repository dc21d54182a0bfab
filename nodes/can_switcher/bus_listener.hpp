// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <memory>
#include <string>

#include "hw/can_bus.hpp"
#include "nodes/can_switcher/bus_meter.hpp"
#include "nodes/can_switcher/unattended_peripherals.hpp"

namespace srfs {

/// A handle of the CAN bus that hears every frame. It is read by the clock and not when something comes: a
/// full bus costs the switcher a bounded share of its time and delays no flag.
class BusListener {
 public:
  /// Frames are taken so often, so many at most: more than 500 kbit/s can carry (10,600 of the shortest a
  /// second). What comes faster is lost in the handle's queue and counted there.
  static constexpr nanoseconds period = milliseconds(20);
  static constexpr int frames_per_turn = 256;
  static constexpr std::uint32_t usual_bit_rate = 500'000;  ///< where the interface does not say

  /// @return nullptr: the URI can never work, it was logged
  static std::unique_ptr<BusListener> open(const std::string& uri, const std::filesystem::path& var);

  /// To call each period.
  void listen();
  BusMeter::Flood end_window();
  [[nodiscard]] const BusMeter& meter() const { return meter_; }
  [[nodiscard]] const hw::CanBus& bus() const { return *bus_; }
  [[nodiscard]] hw::CanBus& bus() { return *bus_; }
  [[nodiscard]] UnattendedPeripherals& unattended() { return unattended_; }

 private:
  explicit BusListener(std::unique_ptr<hw::CanBus> bus);

  std::unique_ptr<hw::CanBus> bus_;
  BusMeter meter_;
  UnattendedPeripherals unattended_;
};

}  // namespace srfs
