// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "ground/link.hpp"

#include <array>
#include <cerrno>
#include <utility>

#include <fcntl.h>
#include <fmt/format.h>
#include <poll.h>
#include <sys/file.h>
#include <termios.h>
#include <unistd.h>

namespace srfs::ground {
namespace {

constexpr std::size_t read_octets = 16384;

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
  return Port(std::move(fd), path);
}

Result<Octets, std::string> Port::read() {
  Octets octets(read_octets);
  const ssize_t got = ::read(fd_.get(), octets.data(), octets.size());
  if (got < 0 && (errno == EAGAIN || errno == EINTR)) return Octets{};
  if (got <= 0) return Err(fmt::format("{}: the other end of the link was closed", path_.string()));
  octets.resize(static_cast<std::size_t>(got));
  return octets;
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
    const ssize_t put = ::write(fd_.get(), waiting_.data(), waiting_.size());
    if (put > 0) {
      waiting_.erase(waiting_.begin(), waiting_.begin() + put);
      waiting_since_ = now;
      stalled_ = false;
      continue;
    }
    if (put < 0 && errno == EINTR) continue;
    if (put < 0 && errno != EAGAIN)
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
    const ssize_t put = ::write(fd_.get(), octets.data(), octets.size());
    if (put > 0) {
      octets = octets.subspan(static_cast<std::size_t>(put));
      continue;
    }
    if (put < 0 && errno != EAGAIN && errno != EINTR) {
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

}  // namespace srfs::ground
