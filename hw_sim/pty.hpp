// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <filesystem>
#include <span>
#include <string>

#include "base/fd.hpp"
#include "base/octets.hpp"
#include "base/result.hpp"

namespace srfs::sim {

/// A pseudo-terminal whose slave is a raw serial port for another process, found through a symbolic link. The
/// slave is held open here too, so that any number of processes, or none, may have it open and hang up at any
/// time. Removes its link when destroyed.
class Pty {
 public:
  /// @param link  replaced if it exists  Error: ready to print.
  [[nodiscard]] static Result<Pty, std::string> create(const std::filesystem::path& link);
  Pty(Pty&&) noexcept = default;
  Pty& operator=(Pty&&) = delete;
  ~Pty();

  /// Readable when the process at the slave has written.
  [[nodiscard]] int fd() const { return master_.get(); }
  /// What the slave's side wrote; 0 when there is nothing. Never blocks.
  [[nodiscard]] std::size_t read(std::span<std::uint8_t> into);
  /// Writes what the slave's input queue has room for; never blocks. @return octets taken
  [[nodiscard]] std::size_t write(OctetView octets);
  /// Octets written and not read by the slave's side yet.
  [[nodiscard]] std::size_t unread() const;
  /// Throws those away.
  void discard_unread();
  /// Ends an exclusive hold (TIOCEXCL) left by a process that was killed: it lasts until the slave's last
  /// close, which never comes here. Locks by flock(2) are not touched.
  void release_exclusive_hold();

 private:
  Pty(std::filesystem::path link, Fd master, Fd slave)
      : link_(std::move(link)), master_(std::move(master)), slave_(std::move(slave)) {}

  std::filesystem::path link_;
  Fd master_;
  Fd slave_;
};

}  // namespace srfs::sim
