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

  static constexpr std::size_t waiting_octets_max = 128U << 10;
  static constexpr milliseconds flush_patience{5000};
  /// Without waiting, instead of write(): what the line does not take now waits for flush(). All of it or,
  /// with an error, nothing: when too much waits, and at once while the line is known to take nothing.
  [[nodiscard]] Result<void, std::string> queue(OctetView octets, MonotonicTime now);
  /// Writes what the line takes. What waits is discarded, and the error says so, when the line took nothing
  /// for flush_patience: what was ordered then is not to go up long after.
  [[nodiscard]] Result<void, std::string> flush(MonotonicTime now);
  [[nodiscard]] bool has_waiting() const { return !waiting_.empty(); }

 private:
  Port(Fd fd, std::filesystem::path path) : fd_(std::move(fd)), path_(std::move(path)) {}
  Fd fd_;
  std::filesystem::path path_;
  Octets waiting_;
  MonotonicTime waiting_since_;  ///< since the line took something, while there is something
  bool stalled_ = false;         ///< something was discarded, and nothing written since
};

}  // namespace srfs::ground
