// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include <array>
#include <cerrno>
#include <utility>

#include <fcntl.h>
#include <fmt/format.h>
#include <linux/serial.h>
#include <sys/file.h>
#include <sys/ioctl.h>
#include <termios.h>
#include <unistd.h>

#include "hw/backends.hpp"
#include "hw/reopening.hpp"

namespace srfs::hw {
namespace {

constexpr seconds error_counter_period{1};

Result<Fd, std::string> open_tty(const path& tty, speed_t speed) {
  Fd line(::open(tty.c_str(), O_RDWR | O_NOCTTY | O_NONBLOCK | O_CLOEXEC));
  if (!line) return Err(fmt::format("{}: {}", tty.string(), errno_text(errno)));
  termios settings{};
  if (::tcgetattr(line.get(), &settings) != 0)
    return Err(fmt::format("{} is not a serial line", tty.string()));
  // TIOCEXCL does not keep root out; the lock does, between processes of ours. An added node is refused all
  // locks, and has no capability that passes TIOCEXCL.
  if (::flock(line.get(), LOCK_EX | LOCK_NB) != 0 && errno != EPERM)
    return Err(fmt::format("{} is used by another process", tty.string()));
  ::ioctl(line.get(), TIOCEXCL);

  ::cfmakeraw(&settings);
  settings.c_cflag &= ~static_cast<tcflag_t>(CSIZE | CSTOPB | PARENB | CRTSCTS);
  settings.c_cflag |= CS8 | CLOCAL | CREAD;
  settings.c_iflag &= ~static_cast<tcflag_t>(IXON | IXOFF | IXANY | INPCK);
  settings.c_iflag |= IGNBRK;
  settings.c_cc[VMIN] = 1;  // so that "nothing there" is EAGAIN and 0 means hung up
  settings.c_cc[VTIME] = 0;
  if (::cfsetispeed(&settings, speed) != 0 || ::cfsetospeed(&settings, speed) != 0 ||
      ::tcsetattr(line.get(), TCSANOW, &settings) != 0) {
    return Err(fmt::format("{}: settings refused: {}", tty.string(), errno_text(errno)));
  }
  // tcsetattr succeeds when any of the settings took effect.
  termios actual{};
  if (::tcgetattr(line.get(), &actual) != 0 || ::cfgetospeed(&actual) != speed ||
      (actual.c_cflag & CSIZE) != CS8) {
    return Err(fmt::format("{} does not support the speed or 8N1", tty.string()));
  }
  return line;
}

class Tty : public SerialPort {
 public:
  Tty(const std::string& uri, const path& tty, speed_t speed)
      : line_(uri, [tty, speed] { return open_tty(tty, speed); }) {}

  [[nodiscard]] int fd() const override { return line_.fd(); }
  [[nodiscard]] std::string reason() const override { return line_.reason(); }
  [[nodiscard]] const SerialCounters& counters() const override { return counters_; }
  void discard_output() override {
    if (line_.present()) ::tcflush(line_.device(), TCOFLUSH);
  }

  [[nodiscard]] Result<std::size_t, SerialError> read(std::span<std::uint8_t> into) override {
    const int fd = device();
    if (fd < 0) return Err(SerialError::gone);
    if (into.empty()) return 0;
    const ssize_t n = ::read(fd, into.data(), into.size());
    if (n > 0) {
      counters_.octets_read += static_cast<std::uint64_t>(n);
      look_for_line_errors(fd);
      return static_cast<std::size_t>(n);
    }
    if (n < 0 && (errno == EAGAIN || errno == EINTR)) return 0;
    line_.lost(n == 0 ? "hung up" : "read: " + errno_text(errno));
    return Err(SerialError::gone);
  }

  [[nodiscard]] Result<std::size_t, SerialError> write(OctetView octets) override {
    const int fd = device();
    if (fd < 0) return Err(SerialError::gone);
    if (octets.empty()) return 0;
    const ssize_t n = ::write(fd, octets.data(), octets.size());
    if (n >= 0) {
      counters_.octets_written += static_cast<std::uint64_t>(n);
      return static_cast<std::size_t>(n);
    }
    if (errno == EAGAIN || errno == EINTR) return 0;
    line_.lost("write: " + errno_text(errno));
    return Err(SerialError::gone);
  }

  [[nodiscard]] std::size_t output_pending() const override {
    int pending = 0;
    if (line_fd_ < 0 || !line_.present() || ::ioctl(line_fd_, TIOCOUTQ, &pending) != 0 || pending < 0)
      return 0;
    return static_cast<std::size_t>(pending);
  }

 private:
  int device() {
    line_fd_ = line_.device();
    if (counters_.reopened != line_.reopened()) {
      counters_.reopened = line_.reopened();
      seen_.reset();
    }
    return line_fd_;
  }

  void look_for_line_errors(int fd) {
    const MonotonicTime now = monotonic_now();
    if (now - looked_at_ < error_counter_period) return;
    looked_at_ = now;
    serial_icounter_struct counts{};
    if (::ioctl(fd, TIOCGICOUNT, &counts) != 0) return;  // ptys and some USB adapters do not count
    if (seen_) {
      counters_.overruns += static_cast<std::uint32_t>(counts.overrun - seen_->overrun + counts.buf_overrun -
                                                       seen_->buf_overrun);
      counters_.framing_errors += static_cast<std::uint32_t>(counts.frame - seen_->frame);
    }
    seen_ = counts;
  }

  Reopening line_;
  int line_fd_ = -1;
  SerialCounters counters_;
  MonotonicTime looked_at_;
  std::optional<serial_icounter_struct> seen_;
};

}  // namespace

unsigned termios_speed(std::uint32_t baud) {
  static constexpr std::array<std::pair<std::uint32_t, speed_t>, 21> speeds{{
      {1200, B1200},       {2400, B2400},       {4800, B4800},       {9600, B9600},       {19200, B19200},
      {38400, B38400},     {57600, B57600},     {115200, B115200},   {230400, B230400},   {460800, B460800},
      {500000, B500000},   {576000, B576000},   {921600, B921600},   {1000000, B1000000}, {1152000, B1152000},
      {1500000, B1500000}, {2000000, B2000000}, {2500000, B2500000}, {3000000, B3000000}, {3500000, B3500000},
      {4000000, B4000000},
  }};
  for (const auto& [rate, code] : speeds) {
    if (rate == baud) return code;
  }
  return 0;
}

std::unique_ptr<SerialPort> make_serial(const std::string& uri, const path& tty, unsigned speed) {
  return std::make_unique<Tty>(uri, tty, speed);
}

}  // namespace srfs::hw
