// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "ground/link.hpp"

#include <algorithm>
#include <array>
#include <cerrno>
#include <optional>
#include <utility>

#include <fcntl.h>
#include <fmt/format.h>
#include <netinet/tcp.h>
#include <poll.h>
#include <sys/file.h>
#include <sys/socket.h>
#include <termios.h>
#include <unistd.h>

#include "base/text.hpp"
#include "ground/internet_address.hpp"

namespace srfs::ground {
namespace {

constexpr std::size_t read_octets = 16384;
constexpr std::size_t received_datagram_octets_max = 65536;
constexpr std::size_t sent_datagram_octets_max = 1472;  ///< unfragmented on Ethernet; the longest CLTU fits
constexpr std::string_view tcp_scheme = "tcp:";
constexpr std::string_view udp_scheme = "udp:";

constexpr std::array<std::pair<int, speed_t>, 11> speeds{{{9600, B9600},
                                                          {19200, B19200},
                                                          {38400, B38400},
                                                          {57600, B57600},
                                                          {115200, B115200},
                                                          {230400, B230400},
                                                          {460800, B460800},
                                                          {921600, B921600},
                                                          {1000000, B1000000},
                                                          {2000000, B2000000},
                                                          {4000000, B4000000}}};

Result<void, std::string> make_raw(int fd, const std::string& path, int baud) {
  termios settings{};
  if (tcgetattr(fd, &settings) != 0)
    return Err(fmt::format("{}: not a serial port: {}", path, errno_text(errno)));
  cfmakeraw(&settings);
  settings.c_cflag |= CLOCAL | CREAD;
  settings.c_cflag &= ~static_cast<tcflag_t>(CSTOPB | CRTSCTS);
  for (const auto& [rate, speed] : speeds) {
    if (rate == baud) cfsetspeed(&settings, speed);
  }
  if (tcsetattr(fd, TCSANOW, &settings) != 0)
    return Err(fmt::format("{}: cannot set raw mode: {}", path, errno_text(errno)));
  return {};
}

/// A connection whose other end is gone without a word is known to be closed after 11 to 16 s.
void watch_connection(int fd) {
  const auto set = [fd](int level, int option, int value) {
    static_cast<void>(::setsockopt(fd, level, option, &value, sizeof value));
  };
  set(SOL_SOCKET, SO_KEEPALIVE, 1);
  set(IPPROTO_TCP, TCP_KEEPIDLE, 5);
  set(IPPROTO_TCP, TCP_KEEPINTVL, 2);
  set(IPPROTO_TCP, TCP_KEEPCNT, 3);
  set(IPPROTO_TCP, TCP_USER_TIMEOUT, 15'000);
  set(IPPROTO_TCP, TCP_NODELAY, 1);
}

std::string closed_text(const std::filesystem::path& path) {
  return fmt::format("{} is closed; the server opens it again when it is there", path.string());
}

}  // namespace

Result<Port, std::string> Port::open(const std::filesystem::path& path, int baud) {
  Fd fd(::open(path.c_str(), O_RDWR | O_NOCTTY | O_NONBLOCK | O_CLOEXEC));
  if (!fd) {
    const int error = errno;
    const std::string_view hint =
        error == ENOENT || error == ENXIO || error == EIO
            ? " - is the spacecraft running? ./run sim starts the simulated one, with this port"
            : "";
    return Err(fmt::format("{}: cannot open the port: {}{}", path.string(), errno_text(error), hint));
  }
  if (flock(fd.get(), LOCK_EX | LOCK_NB) != 0) {
    if (errno == EWOULDBLOCK)
      return Err(fmt::format("{}: the port is in use by another ground tool; end it first", path.string()));
    return Err(fmt::format("{}: cannot lock the port: {}", path.string(), errno_text(errno)));
  }
  if (auto raw = make_raw(fd.get(), path.string(), baud); !raw) return Err(raw.error());
  return Port(std::move(fd), path, Kind::serial);
}

Result<Octets, std::string> Port::read() {
  Octets octets(kind_ == Kind::datagrams ? received_datagram_octets_max : read_octets);
  const ssize_t got = ::read(fd_.get(), octets.data(), octets.size());
  if (got < 0 && (errno == EAGAIN || errno == EINTR)) return Octets{};
  // An empty one; or the answer to an earlier one of ours, that nobody listened there.
  if (kind_ == Kind::datagrams && (got == 0 || (got < 0 && errno == ECONNREFUSED))) return Octets{};
  if (got <= 0) return Err(fmt::format("{}: the other end of the link was closed", path_.string()));
  octets.resize(static_cast<std::size_t>(got));
  return octets;
}

ssize_t Port::put(OctetView octets) const {
  if (kind_ == Kind::serial) return ::write(fd_.get(), octets.data(), octets.size());
  if (kind_ == Kind::datagrams) octets = octets.first(std::min(octets.size(), sent_datagram_octets_max));
  const auto send = [&] { return ::send(fd_.get(), octets.data(), octets.size(), MSG_NOSIGNAL); };
  const ssize_t sent = send();
  const bool of_an_earlier_one = kind_ == Kind::datagrams && sent < 0 && errno == ECONNREFUSED;
  return of_an_earlier_one ? send() : sent;
}

Result<void, std::string> Port::queue(OctetView octets, MonotonicTime now) {
  if (!fd_) return Err(closed_text(path_));
  if (waiting_.size() + octets.size() > waiting_octets_max)
    return Err(fmt::format("{}: {} octets wait for the line already", path_.string(), waiting_.size()));
  if (waiting_.empty()) waiting_since_ = now;
  waiting_.insert(waiting_.end(), octets.begin(), octets.end());
  if (auto flushed = flush(now); !flushed) return flushed;
  if (!stalled_) return {};
  waiting_.clear();  // these octets alone: when the line stalled, all before was discarded
  return Err(fmt::format("{}: the spacecraft accepts no octets", path_.string()));
}

Result<void, std::string> Port::flush(MonotonicTime now) {
  const auto discard = [this](std::string why) {
    waiting_.clear();
    return Err(std::move(why));
  };
  while (!waiting_.empty()) {
    const ssize_t written = put(waiting_);
    if (written > 0) {
      waiting_.erase(waiting_.begin(), waiting_.begin() + written);
      waiting_since_ = now;
      stalled_ = false;
      continue;
    }
    if (written < 0 && errno == EINTR) continue;
    if (written < 0 && errno != EAGAIN)
      return discard(fmt::format("{}: cannot write: {}", path_.string(), errno_text(errno)));
    if (now - waiting_since_ < flush_patience) return {};
    stalled_ = true;
    return discard(fmt::format("{}: the spacecraft accepted no octets for {} ms; {} are discarded",
                               path_.string(), flush_patience.count(), waiting_.size()));
  }
  return {};
}

Result<void, std::string> Port::write(OctetView octets, milliseconds patience) {
  if (!fd_) return Err(closed_text(path_));
  const MonotonicTime deadline = monotonic_now() + patience;
  while (!octets.empty()) {
    const ssize_t written = put(octets);
    if (written > 0) {
      octets = octets.subspan(static_cast<std::size_t>(written));
      continue;
    }
    if (written < 0 && errno != EAGAIN && errno != EINTR) {
      return Err(fmt::format("{}: cannot write: {}", path_.string(), errno_text(errno)));
    }
    const auto left = std::chrono::duration_cast<milliseconds>(deadline - monotonic_now()).count();
    if (left <= 0)
      return Err(
          fmt::format("{}: the spacecraft accepted no octets for {} ms", path_.string(), patience.count()));
    pollfd wait{fd_.get(), POLLOUT, 0};
    static_cast<void>(::poll(&wait, 1, static_cast<int>(left)));
  }
  return {};
}

bool is_network_port(std::string_view port) {
  return port.starts_with(tcp_scheme) || port.starts_with(udp_scheme);
}

Result<PortOpener, std::string> PortOpener::of(std::string port, int baud) {
  PortOpener opener(std::move(port), baud);
  const std::string_view name = opener.port_;
  if (!is_network_port(name)) return opener;
  const bool tcp = name.starts_with(tcp_scheme);
  const std::size_t comma = tcp ? std::string_view::npos : name.find(',');
  const auto remote = parse_internet_address(name.substr(0, comma).substr(tcp_scheme.size()));
  const auto local_port = comma == std::string_view::npos ? std::optional<std::uint16_t>(0)
                                                          : to_number<std::uint16_t>(name.substr(comma + 1));
  if (!remote || remote->sin_port == 0 || !local_port)
    return Err(fmt::format(
        "{}: expected tcp:[HOST:]PORT or udp:[HOST:]PORT[,LOCAL_PORT], the host as a.b.c.d", name));
  opener.kind_ = tcp ? Port::Kind::stream : Port::Kind::datagrams;
  opener.remote_ = *remote;
  opener.local_port_ = *local_port;
  return opener;
}

Result<Port, std::string> PortOpener::open(milliseconds patience) {
  switch (kind_) {
    case Port::Kind::serial:
      return Port::open(port_, baud_);
    case Port::Kind::stream:
      return open_tcp(patience);
    case Port::Kind::datagrams:
      return open_udp();
  }
  return Port::closed(port_);
}

Result<Port, std::string> PortOpener::open_tcp(milliseconds patience) {
  const auto cannot = [this](int error) {
    connecting_.reset();
    return Err(fmt::format("{}: cannot connect: {}", port_, errno_text(error)));
  };
  if (!connecting_) {
    connecting_ = Fd(::socket(AF_INET, SOCK_STREAM | SOCK_NONBLOCK | SOCK_CLOEXEC, 0));
    if (!connecting_) return cannot(errno);
    watch_connection(connecting_.get());
    if (::connect(connecting_.get(), reinterpret_cast<const sockaddr*>(&remote_), sizeof remote_) != 0 &&
        errno != EINPROGRESS)
      return cannot(errno);
  }
  pollfd wait{connecting_.get(), POLLOUT, 0};
  if (::poll(&wait, 1, static_cast<int>(patience.count())) <= 0)
    return Err(fmt::format("{}: the other end does not answer", port_));
  int error = 0;
  socklen_t length = sizeof error;
  if (::getsockopt(connecting_.get(), SOL_SOCKET, SO_ERROR, &error, &length) != 0) error = errno;
  if (error != 0) return cannot(error);
  return Port(std::move(connecting_), port_, Port::Kind::stream);
}

Result<Port, std::string> PortOpener::open_udp() const {
  Fd fd(::socket(AF_INET, SOCK_DGRAM | SOCK_NONBLOCK | SOCK_CLOEXEC, 0));
  if (!fd) return Err(fmt::format("{}: cannot create a socket: {}", port_, errno_text(errno)));
  sockaddr_in local{};
  local.sin_family = AF_INET;
  local.sin_port = htons(local_port_);
  if (::bind(fd.get(), reinterpret_cast<const sockaddr*>(&local), sizeof local) != 0)
    return Err(fmt::format("{}: cannot receive at port {}: {}", port_, local_port_, errno_text(errno)));
  if (::connect(fd.get(), reinterpret_cast<const sockaddr*>(&remote_), sizeof remote_) != 0)
    return Err(fmt::format("{}: no way to that address: {}", port_, errno_text(errno)));
  return Port(std::move(fd), port_, Port::Kind::datagrams);
}

}  // namespace srfs::ground
