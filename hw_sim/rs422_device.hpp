// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <memory>
#include <string>

#include "base/result.hpp"
#include "hw_sim/event_loop.hpp"
#include "hw_sim/pty.hpp"
#include "hw_sim/serial_line.hpp"

namespace srfs::sim {

/// The RS422 connection between the operator's port and the computer's: two pseudo-terminals and a line for
/// each direction. Towards the sender it is bounded by back-pressure (its writes block), towards the reader
/// by loss: what is not read for a second (of running time) is lost, as on a wire without a listener.
class Rs422Device {
 public:
  /// Error: ready to print.
  [[nodiscard]] static Result<std::unique_ptr<Rs422Device>, std::string> create(
      EventLoop& loop, const std::filesystem::path& operator_link, const std::filesystem::path& computer_link,
      std::uint32_t baud, std::uint64_t seed);
  ~Rs422Device();
  Rs422Device(const Rs422Device&) = delete;
  Rs422Device& operator=(const Rs422Device&) = delete;

  void set_flip_probability(double probability);
  void set_burst_probability(double probability);
  /// Cuts both directions: what is sent vanishes.
  void set_cut(bool cut) { cut_ = cut; }
  void release_exclusive_holds();
  [[nodiscard]] const SerialLineCounters& uplink() const { return up_.line.counters(); }
  [[nodiscard]] const SerialLineCounters& downlink() const { return down_.line.counters(); }

 private:
  struct Direction {
    Pty& from;
    Pty& to;
    SerialLine line;
    EventLoop::Timer timer;
    bool paused = false;  // back-pressure: the sender's side is not read
    std::uint64_t written = 0;
    std::uint64_t last_consumed = 0;
    RunningTime progress_at{};
  };
  Rs422Device(EventLoop& loop, Pty operator_side, Pty computer_side, std::uint32_t baud, std::uint64_t seed);
  void read(Direction& direction, MonotonicTime now);
  void service(Direction& direction, MonotonicTime now);
  void deliver(Direction& direction);

  EventLoop& loop_;
  Pty operator_side_;
  Pty computer_side_;
  bool cut_ = false;
  Direction up_;    // operator -> computer
  Direction down_;  // computer -> operator
};

}  // namespace srfs::sim
