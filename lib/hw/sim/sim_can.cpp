#include <algorithm>
#include <cerrno>
#include <cstring>
#include <utility>

#include <linux/can.h>
#include <sys/socket.h>

#include "hw/backends.hpp"
#include "hw/reopening.hpp"
#include "hw/sim/seqpacket.hpp"

namespace srfs::hw {
namespace {

constexpr std::size_t transmit_queue =
    64;  // the hub's bound per client: what it would refuse is refused here
constexpr int datagrams_per_call = 64;

/// The hub of hw_sim (docs/icd_can.md): each datagram is one struct can_frame, __res0 = 1 marks an echo.
class SimCan : public CanBus {
 public:
  SimCan(const std::string& uri, const path& socket, std::vector<CanFilter> filters)
      : filters_(std::move(filters)), hub_(uri, [socket] { return connect_seqpacket(socket); }) {}

  [[nodiscard]] int fd() const override { return hub_.fd(); }
  [[nodiscard]] std::size_t unconfirmed() const override { return unconfirmed_; }
  [[nodiscard]] CanBusState state() const override {
    return hub_.present() ? CanBusState::active : CanBusState::gone;
  }
  [[nodiscard]] std::string reason() const override { return hub_.reason(); }
  [[nodiscard]] const CanCounters& counters() const override { return counters_; }

  [[nodiscard]] Result<void, CanError> send(const CanFrame& frame) override {
    if (frame.size > CAN_MAX_DLEN || frame.id > (frame.extended ? CAN_EFF_MASK : CAN_SFF_MASK)) {
      return Err(CanError::invalid_frame);
    }
    const int socket = device();
    if (socket < 0) return Err(CanError::gone);
    if (unconfirmed_ == transmit_queue) return refuse_full();
    can_frame raw{};
    raw.can_id = frame.id | (frame.extended ? CAN_EFF_FLAG : 0U);
    raw.len = frame.size;
    std::copy_n(frame.data.begin(), frame.size, raw.data);
    if (::send(socket, &raw, sizeof raw, MSG_NOSIGNAL) != static_cast<ssize_t>(sizeof raw)) {
      if (errno == EAGAIN || errno == ENOBUFS) return refuse_full();
      lost("write: " + errno_text(errno));
      return Err(CanError::gone);
    }
    ++counters_.sent;
    ++unconfirmed_;
    return {};
  }

  [[nodiscard]] std::optional<CanFrame> receive() override {
    const int socket = device();
    if (socket < 0) return std::nullopt;
    for (int i = 0; i < datagrams_per_call; ++i) {
      can_frame raw{};
      const ssize_t n = ::recv(socket, &raw, sizeof raw, MSG_TRUNC);
      if (n < 0) {
        if (errno != EAGAIN && errno != EINTR) lost("read: " + errno_text(errno));
        return std::nullopt;
      }
      if (n == 0) {
        lost("the hub closed the connection");
        return std::nullopt;
      }
      if (n != static_cast<ssize_t>(sizeof raw) || raw.len > CAN_MAX_DLEN ||
          (raw.can_id & (CAN_RTR_FLAG | CAN_ERR_FLAG)) != 0) {
        ++counters_.malformed;
        continue;
      }
      if (auto frame = accept(raw)) return frame;
    }
    return std::nullopt;
  }

 private:
  int device() {
    const int socket = hub_.device();
    counters_.reopened = hub_.reopened();
    return socket;
  }

  std::optional<CanFrame> accept(const can_frame& raw) {
    const bool extended = (raw.can_id & CAN_EFF_FLAG) != 0;
    CanFrame frame{.id = raw.can_id & (extended ? CAN_EFF_MASK : CAN_SFF_MASK),
                   .extended = extended,
                   .size = raw.len,
                   .data = {},
                   .is_echo = raw.__res0 == 1,
                   .timestamp = monotonic_now()};
    std::copy_n(raw.data, raw.len, frame.data.begin());
    if (frame.is_echo) {
      ++counters_.echoed;
      if (unconfirmed_ > 0) --unconfirmed_;
      return frame;
    }
    if (!filters_.empty() && !(extended && passes(frame.id, filters_))) return std::nullopt;
    ++counters_.received;
    return frame;
  }

  tl::unexpected<CanError> refuse_full() {
    ++counters_.refused_full;
    return Err(CanError::queue_full);
  }

  void lost(std::string why) {
    hub_.lost(std::move(why));
    counters_.lost_in_queue += unconfirmed_;
    unconfirmed_ = 0;
  }

  std::vector<CanFilter> filters_;
  Reopening hub_;
  std::size_t unconfirmed_ = 0;
  CanCounters counters_;
};

}  // namespace

std::unique_ptr<CanBus> make_sim_can(const std::string& uri, const path& socket,
                                     std::vector<CanFilter> filters) {
  return std::make_unique<SimCan>(uri, socket, std::move(filters));
}

}  // namespace srfs::hw
