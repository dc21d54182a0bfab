// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <deque>
#include <memory>
#include <optional>
#include <random>

#include "hw/can_bus.hpp"
#include "hw_sim/peripheral.hpp"
#include "hw_sim/peripheral_channel.hpp"
#include "hw_sim/running_clock.hpp"

namespace srfs::sim {

/// One Peripheral's end of its channel to the computer, and what it sends unasked while it babbles, all in
/// running time. Pure but for the handle of the bus.
class PeripheralEndpoint {
 public:
  /// @param bus, peripheral  outlive it
  PeripheralEndpoint(std::uint8_t address, hw::CanBus& bus, std::unique_ptr<PeripheralChannel> channel,
                     Peripheral& peripheral);

  /// Runs everything that is due; after a frame, after a change of power or fault too.
  void service(RunningTime now);
  /// When service() has something to do; nullopt: nothing waits.
  [[nodiscard]] std::optional<RunningTime> next_deadline(RunningTime now) const;
  [[nodiscard]] PeripheralChannel::Counters channel_counters() const { return channel_->counters(); }
  [[nodiscard]] std::uint64_t babbled() const { return babbled_; }

 private:
  void receive(RunningTime now);
  void transmit(RunningTime now);
  void babble(RunningTime now);

  hw::CanBus& bus_;
  std::unique_ptr<PeripheralChannel> channel_;
  Peripheral& peripheral_;
  std::deque<Octets> answers_;  // at most one more than the channel sends; the peripheral bounds its own
  RunningTime next_babble_;
  std::uint64_t babbled_ = 0;
  std::minstd_rand random_;
};

}  // namespace srfs::sim
