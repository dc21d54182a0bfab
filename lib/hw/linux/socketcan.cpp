// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include <array>
#include <cerrno>
#include <cstring>
#include <utility>

#include <fmt/format.h>
#include <linux/can/error.h>
#include <linux/can/raw.h>
#include <net/if.h>
#include <sys/ioctl.h>
#include <sys/socket.h>
#include <sys/uio.h>

#include "base/log.hpp"
#include "hw/backends.hpp"
#include "hw/linux/can_link.hpp"
#include "hw/linux/clock_offset.hpp"
#include "hw/raw_can_bus.hpp"

namespace srfs::hw {
namespace {

constexpr int frames_per_call = 64;
constexpr canid_t whole_kind = CAN_EFF_FLAG | CAN_RTR_FLAG;  // filters compare the kind of frame by these

bool set_flag(int socket, int level, int option) {
  const int on = 1;
  return ::setsockopt(socket, level, option, &on, sizeof on) == 0;
}

/// The kernel filters echoes of own frames like the frames of others
/// (Documentation/networking/can.rst, 4.1.7).
bool set_filters(int socket, const std::vector<CanFilter>& filters) {
  if (filters.empty()) return true;  // the socket's default: everything
  std::vector<can_filter> raw;
  for (const CanFilter& f : filters) {
    const canid_t kind = f.extended ? CAN_EFF_FLAG : 0U;
    const canid_t whole = f.extended ? CAN_EFF_MASK : CAN_SFF_MASK;
    raw.push_back({.can_id = (f.match & whole) | kind, .can_mask = (f.mask & whole) | whole_kind});
    raw.push_back({.can_id = (f.echo_match & whole) | kind, .can_mask = (f.echo_mask & whole) | whole_kind});
  }
  return ::setsockopt(socket, SOL_CAN_RAW, CAN_RAW_FILTER, raw.data(),
                      static_cast<socklen_t>(raw.size() * sizeof(can_filter))) == 0;
}

/// What opening finds of the interface, also when it fails.
struct Interface {
  bool down = false;  ///< it exists, but is down
  int index = 0;
};

/// A bound raw socket. The error is for a person.
Result<Fd, std::string> open_raw(const std::string& interface, const std::vector<CanFilter>& filters,
                                 Interface& found) {
  found = {};
  Fd socket(::socket(PF_CAN, SOCK_RAW | SOCK_CLOEXEC | SOCK_NONBLOCK, CAN_RAW));
  if (!socket) {
    const bool no_can = errno == EAFNOSUPPORT || errno == EPROTONOSUPPORT;
    return Err((no_can ? "this kernel has no SocketCAN: " : "socket: ") + errno_text(errno));
  }
  ifreq request{};
  std::strncpy(request.ifr_name, interface.c_str(), IFNAMSIZ - 1);
  if (::ioctl(socket.get(), SIOCGIFFLAGS, &request) != 0) {
    return Err(fmt::format("interface {}: {}", interface, errno_text(errno)));
  }
  const bool up = (request.ifr_flags & IFF_UP) != 0;
  if (::ioctl(socket.get(), SIOCGIFINDEX, &request) != 0) {
    return Err(fmt::format("interface {}: {}", interface, errno_text(errno)));
  }
  found.index = request.ifr_ifindex;
  if (!up) {
    found.down = true;
    return Err(fmt::format("interface {} is down (ip link set {} up)", interface, interface));
  }
  const can_err_mask_t errors = CAN_ERR_MASK;
  // Options before bind: no frame shall arrive under other rules.
  if (!set_filters(socket.get(), filters) ||
      ::setsockopt(socket.get(), SOL_CAN_RAW, CAN_RAW_ERR_FILTER, &errors, sizeof errors) != 0 ||
      !set_flag(socket.get(), SOL_CAN_RAW, CAN_RAW_LOOPBACK) ||
      !set_flag(socket.get(), SOL_CAN_RAW, CAN_RAW_RECV_OWN_MSGS) ||
      !set_flag(socket.get(), SOL_SOCKET, SO_TIMESTAMPNS) ||
      !set_flag(socket.get(), SOL_SOCKET, SO_RXQ_OVFL)) {
    return Err("setsockopt: " + errno_text(errno));
  }
  sockaddr_can address{};
  address.can_family = AF_CAN;
  address.can_ifindex = request.ifr_ifindex;
  if (::bind(socket.get(), reinterpret_cast<const sockaddr*>(&address), sizeof address) != 0) {
    return Err(fmt::format("bind to {}: {}", interface, errno_text(errno)));
  }
  return socket;
}

/// What recvmsg says beside the frame.
struct Received {
  can_frame raw{};
  ssize_t size = 0;
  bool is_echo = false;
  MonotonicTime at;
  std::optional<std::uint32_t> dropped_so_far;
};

Received receive_one(int socket) {
  Received r;
  iovec part{.iov_base = &r.raw, .iov_len = sizeof r.raw};
  alignas(cmsghdr) std::array<char, 256> control{};
  msghdr message{};
  message.msg_iov = &part;
  message.msg_iovlen = 1;
  message.msg_control = control.data();
  message.msg_controllen = control.size();
  r.size = ::recvmsg(socket, &message, 0);
  if (r.size < 0) return r;
  r.is_echo = (message.msg_flags & MSG_CONFIRM) != 0;  // sent by this very socket
  std::optional<MonotonicTime> stamp;
  for (cmsghdr* c = CMSG_FIRSTHDR(&message); c != nullptr; c = CMSG_NXTHDR(&message, c)) {
    if (c->cmsg_level != SOL_SOCKET) continue;
    if (c->cmsg_type == SO_TIMESTAMPNS) {
      timespec t{};
      std::memcpy(&t, CMSG_DATA(c), sizeof t);
      stamp = place_on_monotonic(to_utc_time(t));
    } else if (c->cmsg_type == SO_RXQ_OVFL) {
      std::uint32_t dropped = 0;
      std::memcpy(&dropped, CMSG_DATA(c), sizeof dropped);
      r.dropped_so_far = dropped;
    }
  }
  r.at = stamp.value_or(monotonic_now());
  return r;
}

CanController to_controller(const CanLink& link) {
  return {.state = link.state.value_or(CanBusState::active),
          .transmit_errors = link.transmit_errors,
          .receive_errors = link.receive_errors,
          .bit_rate = link.bit_rate};
}

class SocketCan : public RawCanBus {
 public:
  SocketCan(const std::string& uri, std::string interface, std::vector<CanFilter> filters)
      : RawCanBus(uri, std::move(filters)), interface_(std::move(interface)) {
    start([this] { return open(); });
  }

  [[nodiscard]] Result<void, CanError> send(const CanFrame& frame) override {
    const auto raw = to_raw(frame);
    if (!raw) return Err(raw.error());
    const int device = socket();
    if (device < 0) return Err(found_.down ? CanError::down : CanError::gone);
    if (state() == CanBusState::bus_off) return Err(CanError::bus_off);
    if (::write(device, &*raw, sizeof *raw) != static_cast<ssize_t>(sizeof *raw)) return write_failed(errno);
    note_sent();
    return {};
  }

  [[nodiscard]] std::optional<CanFrame> receive() override {
    const int device = socket();
    if (device < 0) return std::nullopt;
    for (int i = 0; i < frames_per_call; ++i) {
      const Received r = receive_one(device);
      if (r.size < 0) {
        if (errno != EAGAIN && errno != EINTR) interface_lost(errno);
        return std::nullopt;
      }
      note_drops(r);
      const bool whole = r.size == static_cast<ssize_t>(sizeof(can_frame)) && r.raw.len <= CAN_MAX_DLEN;
      if (whole && is_error_frame(r.raw)) {
        on_report(decode_error_frame(r.raw));
        if (std::exchange(take_back_, false) && withdraw()) return std::nullopt;  // another socket by now
      } else if (!whole || is_unwanted_remote(r.raw)) {
        ++counters_.malformed;
      } else if (auto frame = accept(r.raw, r.is_echo, r.at)) {
        return frame;
      }
    }
    return std::nullopt;
  }

  bool withdraw() override {
    if (socket() < 0) return false;
    const LinkCycle cycle = cycle_can_link(found_.index);
    if (!cycle.down) return false;
    taken_down_ = !cycle.up;
    ++counters_.withdrawals;
    on_withdrawn(0);
    // This socket is as dead as those of all other processes. The interface is there again: it is opened now.
    waits_after_bus_off_ = state() == CanBusState::bus_off;
    interface_lost(ENETDOWN);
    (void)socket();
    waits_after_bus_off_ = false;
    return true;
  }

 private:
  Result<Fd, std::string> open() {
    dropped_ = 0;
    auto socket = open_raw(interface_, filters_, found_);
    if (!socket && found_.down && taken_down_ && set_can_link_up(found_.index)) {
      socket = open_raw(interface_, filters_, found_);
    }
    if (!socket) return socket;
    taken_down_ = false;
    // Error frames tell changes only: a controller that went bus-off before would look well.
    const auto link = query_can_link(found_.index);
    CanController controller = link ? to_controller(*link) : CanController{};
    // Down and up restarted the controller: the wait before the next attempt stays all the same.
    if (waits_after_bus_off_) controller.state = CanBusState::bus_off;
    opened_with(controller);
    return socket;
  }

  /// The driver flushes its echo buffers before it is on the bus again, but what waits in the interface's
  /// queue would then leave, in whosever slot that is. Where it cannot be taken back the frames count as
  /// waiting.
  void on_bus_off_with_frames() override { take_back_ = true; }

  [[nodiscard]] CanBusState absent_state() const override {
    return found_.down ? CanBusState::down : CanBusState::gone;
  }

  void try_restart(int /*device*/) override {
    const auto link = query_can_link(found_.index);
    const CanLink known = link ? *link : CanLink{};
    const bool off = known.state ? known.state == CanBusState::bus_off : !known.carrier.value_or(true);
    if (!off) {
      // It was restarted, and the error frame that reports it was lost. An interface that reports nothing of
      // its controller is believed to work again: the next frame shows it, waiting shows nothing.
      on_report({.restarted = true,
                 .state = known.state,
                 .transmit_errors = known.transmit_errors,
                 .receive_errors = known.receive_errors});
      return;
    }
    if (!known.state) return;                      // no controller of its own that could be restarted
    if (known.restart_ms.value_or(0) > 0) return;  // the kernel does it
    const auto restarted = restart_can_controller(found_.index);
    if (restarted || restarted.error() == EBUSY) return;  // EBUSY: another process was first
    if (std::exchange(said_what_to_set_, true)) return;
    log::error(
        "{}: bus-off, and this process cannot restart the controller ({}): ip link set {} type can "
        "restart-ms 100",
        uri_, errno_text(restarted.error()), interface_);
  }

  Result<void, CanError> write_failed(int error) {
    switch (error) {
      case ENOBUFS:  // the interface's queue (txqueuelen) is full
      case EAGAIN:   // the socket's buffer is full
      case EINTR:
        return refuse_full();
      case EINVAL:
      case EMSGSIZE:
        return Err(CanError::invalid_frame);
      default:
        interface_lost(error);
        return Err(found_.down ? CanError::down : CanError::gone);
    }
  }

  // Down or unplugged. A socket bound to an interface that went away never comes back to life: a new one is
  // opened. One that went down is often up again at once: frames were withdrawn, by whomever.
  void interface_lost(int error) {
    using Retry = Reopening::Retry;
    found_.down = error == ENETDOWN;
    lost(errno_text(error), found_.down ? Retry::at_once : Retry::later);
  }

  void note_drops(const Received& r) {
    if (!r.dropped_so_far) return;
    counters_.receive_overruns += *r.dropped_so_far - dropped_;
    dropped_ = *r.dropped_so_far;
  }

  std::string interface_;
  Interface found_;
  bool taken_down_ = false;  // by withdraw(), and not up again
  bool take_back_ = false;
  bool waits_after_bus_off_ = false;  // while withdraw() opens the interface again
  bool said_what_to_set_ = false;
  std::uint32_t dropped_ = 0;
};

}  // namespace

std::unique_ptr<CanBus> make_socketcan(const std::string& uri, const std::string& interface,
                                       std::vector<CanFilter> filters) {
  return std::make_unique<SocketCan>(uri, interface, std::move(filters));
}

}  // namespace srfs::hw
