// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include <cerrno>
#include <sstream>

#include <sys/socket.h>

#include "base/file.hpp"
#include "hw/backends.hpp"
#include "hw/reopening.hpp"
#include "hw/sim/seqpacket.hpp"

namespace srfs::hw {
namespace {

/// Any datagram feeds; "V" disarms. A file beside the socket (watchdog.sock: watchdog.boot) is its status
/// register: "boot NAME", "watchdog 0" or "watchdog 1", "timeout_ms N".
class SimWatchdog : public Watchdog {
 public:
  SimWatchdog(const std::string& uri, const path& socket)
      : simulator_(
            uri,
            [this, socket] {
              read_status(path(socket).replace_extension(".boot"));
              return connect_seqpacket(socket);
            },
            false) {}

  [[nodiscard]] Result<void, WatchdogError> feed() override {
    auto fed = say('F');
    ++(fed ? counters_.fed : counters_.failed);
    return fed;
  }
  [[nodiscard]] Result<void, WatchdogError> disarm() override { return say('V'); }
  [[nodiscard]] std::optional<seconds> timeout() const override {
    return simulator_.present() ? in_force_ : std::nullopt;
  }
  [[nodiscard]] const WatchdogFacts& facts() const override { return facts_; }
  [[nodiscard]] std::string reason() const override { return simulator_.reason(); }
  [[nodiscard]] const WatchdogCounters& counters() const override { return counters_; }

 private:
  Result<void, WatchdogError> say(char what) {
    const int socket = simulator_.device();
    counters_.reopened = simulator_.reopened();
    if (socket < 0) return Err(WatchdogError::gone);
    if (::send(socket, &what, 1, MSG_NOSIGNAL) == 1) return {};
    // A full socket is a simulator that does not listen: not fed, but the connection may recover.
    if (errno != EAGAIN) simulator_.lost("write: " + errno_text(errno));
    return Err(WatchdogError::gone);
  }

  void read_status(const path& file) {
    constexpr std::size_t longest = 256;
    const auto text = read_file(file, longest);
    if (!text) return;
    std::istringstream lines(*text);
    std::string key;
    std::string boot;
    int by_watchdog = 0;
    std::int64_t timeout_ms = 0;
    lines >> key >> boot >> key >> by_watchdog >> key >> timeout_ms;
    if (!lines) return;
    facts_ = {"simulated", true, by_watchdog != 0, boot};
    in_force_ = std::chrono::floor<seconds>(milliseconds(timeout_ms));
  }

  WatchdogFacts facts_;
  std::optional<seconds> in_force_;
  WatchdogCounters counters_;
  Reopening simulator_;  // last: it opens while it is constructed
};

}  // namespace

std::unique_ptr<Watchdog> make_sim_watchdog(const std::string& uri, const path& socket) {
  return std::make_unique<SimWatchdog>(uri, socket);
}

}  // namespace srfs::hw
