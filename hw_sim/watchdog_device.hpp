// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <memory>
#include <string>
#include <vector>

#include <sys/types.h>

#include "base/fd.hpp"
#include "hw_sim/event_loop.hpp"
#include "hw_sim/seqpacket_server.hpp"
#include "hw_sim/starvation_timer.hpp"

namespace srfs::sim {

struct WatchdogDeviceCounters {
  std::uint64_t disarmed = 0;
  std::uint64_t restarts_started = 0;
  std::uint64_t restarts_failed = 0;  ///< not started, or ended with another code than 0
  std::uint64_t restarts_killed = 0;  ///< ran longer than the limit
};

/// The simulated hardware watchdog. When it bites it runs the restart command in a session of its own, as a
/// power-on would start the computer; after that it waits for the first feed again,
/// and bites once more after another time-out when the command failed. Both time-outs are in running time.
/// Its status register is a file (lib/hw/sim/sim_watchdog.cpp).
class WatchdogDevice {
 public:
  /// @param status  file of the status register; empty: none
  WatchdogDevice(EventLoop& loop, milliseconds timeout, std::vector<std::string> restart_command,
                 milliseconds restart_limit, std::filesystem::path status);
  ~WatchdogDevice();
  WatchdogDevice(const WatchdogDevice&) = delete;
  WatchdogDevice& operator=(const WatchdogDevice&) = delete;

  /// The computer's power, and this device's with it. When it comes the restart command runs: the boot's
  /// cause is no bite.
  void set_power(bool on);
  /// One datagram: "V" disarms, anything else feeds.
  void on_datagram(OctetView datagram);
  [[nodiscard]] const StarvationTimer& timer() const { return starvation_; }
  [[nodiscard]] const WatchdogDeviceCounters& counters() const { return counters_; }

 private:
  void on_timer();
  void on_limit();
  void start_restart();
  void set_bite_timer();
  void on_exit();
  void write_status() const;

  EventLoop& loop_;
  StarvationTimer starvation_;
  std::vector<std::string> command_;
  milliseconds limit_;
  std::filesystem::path status_;
  MonotonicTime switched_on_;
  std::uint64_t bites_at_power_on_ = 0;
  EventLoop::Timer bite_timer_;
  EventLoop::Timer limit_timer_;
  RunningTime restart_ends_;  // killed then
  WatchdogDeviceCounters counters_;
  pid_t child_ = -1;
  Fd child_fd_;  // pidfd, readable when it has ended
};

}  // namespace srfs::sim
