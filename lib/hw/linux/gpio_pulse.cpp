// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include <cerrno>
#include <cstring>

#include <fcntl.h>
#include <fmt/format.h>
#include <linux/gpio.h>
#include <sys/ioctl.h>
#include <unistd.h>

#include "hw/backends.hpp"
#include "hw/reopening.hpp"

namespace srfs::hw {
namespace {

/// A line of the chip that reports rising edges, which the kernel stamps with CLOCK_MONOTONIC in its
/// interrupt (GPIO character device, second version: Linux 5.10).
Result<Fd, std::string> request_edges(const path& chip, unsigned line) {
  const Fd device(::open(chip.c_str(), O_RDWR | O_CLOEXEC));
  if (!device) return Err(fmt::format("{}: {}", chip.string(), errno_text(errno)));
  gpio_v2_line_request request{};
  request.offsets[0] = line;
  request.num_lines = 1;
  std::strncpy(request.consumer, "srfs pulse", sizeof request.consumer - 1);
  request.config.flags = GPIO_V2_LINE_FLAG_INPUT | GPIO_V2_LINE_FLAG_EDGE_RISING;
  if (::ioctl(device.get(), GPIO_V2_GET_LINE_IOCTL, &request) != 0)
    return Err(fmt::format("{}: edges of line {}: {}", chip.string(), line, errno_text(errno)));
  Fd edges(request.fd);
  if (::fcntl(edges.get(), F_SETFL, O_NONBLOCK) != 0 || ::fcntl(edges.get(), F_SETFD, FD_CLOEXEC) != 0)
    return Err("fcntl: " + errno_text(errno));
  return edges;
}

class GpioPulse : public PulseSource {
 public:
  GpioPulse(const std::string& uri, const path& chip, unsigned line)
      : source_(uri, [chip, line] { return request_edges(chip, line); }) {}

  [[nodiscard]] int fd() const override { return source_.fd(); }
  [[nodiscard]] std::string reason() const override { return source_.reason(); }
  [[nodiscard]] const PulseCounters& counters() const override { return counters_; }

  [[nodiscard]] std::optional<Pulse> read() override {
    const int edges = source_.device();
    counters_.reopened = source_.reopened();
    if (edges < 0) return std::nullopt;
    gpio_v2_line_event event{};
    const ssize_t n = ::read(edges, &event, sizeof event);
    if (n < 0) {
      if (errno != EAGAIN && errno != EINTR) source_.lost("read: " + errno_text(errno));
      return std::nullopt;
    }
    if (n != static_cast<ssize_t>(sizeof event)) {
      source_.lost("the chip is gone");
      return std::nullopt;
    }
    // The kernel keeps 16 events and drops the newest; its sequence number shows it.
    if (event.line_seqno > last_ + 1 && last_ > 0)
      counters_.dropped += static_cast<std::uint32_t>(event.line_seqno - last_ - 1);
    last_ = event.line_seqno;
    ++counters_.received;
    return Pulse{.edge = MonotonicTime(nanoseconds(static_cast<std::int64_t>(event.timestamp_ns))),
                 .counter = event.line_seqno};
  }

 private:
  Reopening source_;
  PulseCounters counters_;
  std::uint32_t last_ = 0;
};

}  // namespace

std::unique_ptr<PulseSource> make_gpio_pulse(const std::string& uri, const path& chip, unsigned line) {
  return std::make_unique<GpioPulse>(uri, chip, line);
}

}  // namespace srfs::hw
