// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <string>

#include "base/fd.hpp"
#include "base/octets.hpp"
#include "base/result.hpp"
#include "base/time.hpp"

namespace srfs::ground {

/// The serial line to the spacecraft: raw, 8N1, held exclusively with flock. Errors are ready to print.
class Port {
 public:
  /// @param baud line rate; a pty ignores it
  static Result<Port, std::string> open(const std::filesystem::path& path, int baud);

  /// For poll(2).
  [[nodiscard]] int fd() const { return fd_.get(); }
  /// Octets that are there now, possibly none. An error: the other end is closed.
  [[nodiscard]] Result<Octets, std::string> read();
  /// Writes all, waiting for room at most @p patience in all.
  [[nodiscard]] Result<void, std::string> write(OctetView octets, milliseconds patience);

 private:
  Port(Fd fd, std::filesystem::path path) : fd_(std::move(fd)), path_(std::move(path)) {}
  Fd fd_;
  std::filesystem::path path_;
};

}  // namespace srfs::ground
