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

/// Octets to and from the spacecraft. Errors are ready to print.
class OctetLine {
 public:
  OctetLine() = default;
  virtual ~OctetLine() = default;
  OctetLine(const OctetLine&) = delete;
  OctetLine& operator=(const OctetLine&) = delete;

  /// For poll(2); -1: closed.
  [[nodiscard]] virtual int fd() const = 0;
  /// Octets that are there now, possibly none. An error: the other end is closed.
  [[nodiscard]] virtual Result<Octets, std::string> read() = 0;
  /// Writes all, waiting for room at most @p patience in all.
  [[nodiscard]] virtual Result<void, std::string> write(OctetView octets, milliseconds patience) = 0;

 protected:
  OctetLine(OctetLine&&) = default;
  OctetLine& operator=(OctetLine&&) = default;
};

/// The serial line to the spacecraft: raw, 8N1, held exclusively with flock.
class Port final : public OctetLine {
 public:
  /// @param baud line rate; a pty ignores it
  static Result<Port, std::string> open(const std::filesystem::path& path, int baud);

  /// One that is not there: nothing can be read or written.
  [[nodiscard]] static Port closed(const std::filesystem::path& path) { return {Fd(), path}; }

  [[nodiscard]] int fd() const override { return fd_.get(); }
  [[nodiscard]] Result<Octets, std::string> read() override;
  [[nodiscard]] Result<void, std::string> write(OctetView octets, milliseconds patience) override;

 private:
  Port(Fd fd, std::filesystem::path path) : fd_(std::move(fd)), path_(std::move(path)) {}
  Fd fd_;
  std::filesystem::path path_;
};

}  // namespace srfs::ground
