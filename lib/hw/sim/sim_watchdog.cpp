#include <cerrno>

#include <sys/socket.h>

#include "hw/backends.hpp"
#include "hw/reopening.hpp"
#include "hw/sim/seqpacket.hpp"

namespace srfs::hw {
namespace {

/// Any datagram feeds; "V" disarms.
class SimWatchdog : public Watchdog {
 public:
  SimWatchdog(const std::string& uri, const path& socket)
      : simulator_(
            uri, [socket] { return connect_seqpacket(socket); }, false) {}

  [[nodiscard]] Result<void, WatchdogError> feed() override {
    auto fed = say('F');
    ++(fed ? counters_.fed : counters_.failed);
    return fed;
  }
  [[nodiscard]] Result<void, WatchdogError> disarm() override { return say('V'); }
  [[nodiscard]] std::optional<seconds> timeout() const override { return std::nullopt; }
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

  Reopening simulator_;
  WatchdogCounters counters_;
};

}  // namespace

std::unique_ptr<Watchdog> make_sim_watchdog(const std::string& uri, const path& socket) {
  return std::make_unique<SimWatchdog>(uri, socket);
}

}  // namespace srfs::hw
