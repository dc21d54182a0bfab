// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include <array>
#include <cerrno>
#include <cstring>

#include <sys/socket.h>

#include "hw/backends.hpp"
#include "hw/reopening.hpp"
#include "hw/sim/seqpacket.hpp"

namespace srfs::hw {
namespace {

/// 16 octets in host order per pulse: monotonic_ns u64, counter u64. The queue is the socket's own.
class SimPulse : public PulseSource {
 public:
  SimPulse(const std::string& uri, const path& socket)
      : source_(uri, [socket] { return connect_seqpacket(socket); }) {}

  [[nodiscard]] int fd() const override { return source_.fd(); }
  [[nodiscard]] std::string reason() const override { return source_.reason(); }
  [[nodiscard]] const PulseCounters& counters() const override { return counters_; }

  [[nodiscard]] std::optional<Pulse> read() override {
    const int socket = source_.device();
    counters_.reopened = source_.reopened();
    if (socket < 0) return std::nullopt;
    std::array<std::uint64_t, 2> raw{};
    const ssize_t n = ::recv(socket, raw.data(), sizeof raw, MSG_TRUNC);
    if (n < 0) {
      if (errno != EAGAIN && errno != EINTR) source_.lost("read: " + errno_text(errno));
      return std::nullopt;
    }
    if (n == 0) {
      source_.lost("the simulator closed the connection");
      return std::nullopt;
    }
    if (n != static_cast<ssize_t>(sizeof raw)) {
      ++counters_.malformed;
      return std::nullopt;  // the descriptor stays readable while more is there
    }
    ++counters_.received;
    return Pulse{.edge = MonotonicTime(nanoseconds(static_cast<std::int64_t>(raw[0]))), .counter = raw[1]};
  }

 private:
  Reopening source_;
  PulseCounters counters_;
};

}  // namespace

std::unique_ptr<PulseSource> make_sim_pulse(const std::string& uri, const path& socket) {
  return std::make_unique<SimPulse>(uri, socket);
}

}  // namespace srfs::hw
