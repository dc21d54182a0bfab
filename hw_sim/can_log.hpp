// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <string>

#include "base/fd.hpp"
#include "hw_sim/bus_arbiter.hpp"

namespace srfs::sim {

/// "(12.345678) can0 18DA1101#0102", the line format of `candump -L`; time is CLOCK_MONOTONIC.
[[nodiscard]] std::string candump_line(const BusDelivery& delivery);

/// Writes every frame on the bus to a file in candump's format. At the limit the file becomes FILE.1
/// (replacing an older one) and a new one starts, so that at most twice the limit is on disk. Lines wait in
/// memory for flush().
class CanLog {
 public:
  CanLog(std::filesystem::path file, std::size_t limit);
  ~CanLog() { flush(); }
  CanLog(const CanLog&) = delete;
  CanLog& operator=(const CanLog&) = delete;

  void record(const BusDelivery& delivery);
  /// Writes what waits. Blocks as long as the page cache does.
  void flush();
  [[nodiscard]] std::uint64_t lost() const { return lost_; }

 private:
  std::filesystem::path file_;
  std::size_t limit_;
  Fd fd_;
  std::size_t size_ = 0;
  std::string waiting_;
  std::uint64_t lost_ = 0;  // octets the disk did not take
};

}  // namespace srfs::sim
