// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <filesystem>
#include <string>
#include <string_view>

#include <netinet/in.h>
#include <sys/types.h>

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

/// The line to the spacecraft: a serial port (raw, 8N1, held exclusively with flock), a TCP connection that
/// carries the same octets, or UDP datagrams with them. PortOpener makes one of its name.
class Port final : public OctetLine {
 public:
  /// @param baud line rate; a pty ignores it
  static Result<Port, std::string> open(const std::filesystem::path& path, int baud);

  /// One that is not there: nothing can be read or written.
  [[nodiscard]] static Port closed(const std::filesystem::path& path) { return {Fd(), path, Kind::serial}; }

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
  friend class PortOpener;
  enum class Kind : std::uint8_t { serial, stream, datagrams };

  Port(Fd fd, std::filesystem::path path, Kind kind)
      : fd_(std::move(fd)), path_(std::move(path)), kind_(kind) {}
  /// As write(2); of datagrams, one.
  [[nodiscard]] ssize_t put(OctetView octets) const;

  Fd fd_;
  std::filesystem::path path_;  ///< or name, for texts
  Kind kind_;
  Octets waiting_;
  MonotonicTime waiting_since_;  ///< since the line took something, while there is something
  bool stalled_ = false;         ///< something was discarded, and nothing written since
};

/// Whether @p port names a line by its address, "tcp:..." or "udp:...", and not by the path of a serial port.
[[nodiscard]] bool is_network_port(std::string_view port);

/// Opens the line of a name:
/// - the path of a serial port or pty
/// - "tcp:[HOST:]PORT": a serial device server or a modem that carries the octets of the line
/// - "udp:[HOST:]PORT[,LOCAL_PORT]": datagrams with these octets, to that address and from it alone; each
///   CLTU is one. LOCAL_PORT: where they are received (default: any free port)
/// HOST is a.b.c.d (default 127.0.0.1). Whoever sits on the way can read, delay and suppress what it carries,
/// as on a radio link; what holds against that is the link's security.
class PortOpener {
 public:
  /// The error, ready to print: @p port can never be opened.
  [[nodiscard]] static Result<PortOpener, std::string> of(std::string port, int baud);

  /// Waits for the other end of a TCP connection, at most @p patience; the next call goes on with the attempt
  /// that is under way. Nothing else blocks. The error is ready to print.
  [[nodiscard]] Result<Port, std::string> open(milliseconds patience);

 private:
  PortOpener(std::string port, int baud) : port_(std::move(port)), baud_(baud) {}
  [[nodiscard]] Result<Port, std::string> open_tcp(milliseconds patience);
  [[nodiscard]] Result<Port, std::string> open_udp() const;

  std::string port_;
  int baud_;
  Port::Kind kind_ = Port::Kind::serial;
  sockaddr_in remote_{};          ///< of a network port
  std::uint16_t local_port_ = 0;  ///< of datagrams; 0: any
  Fd connecting_;
};

}  // namespace srfs::ground
