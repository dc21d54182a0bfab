#include <array>
#include <cerrno>
#include <cstring>
#include <utility>

#include <fcntl.h>
#include <fmt/format.h>
#include <linux/can/error.h>
#include <linux/can/raw.h>
#include <net/if.h>
#include <sys/ioctl.h>
#include <sys/socket.h>
#include <sys/uio.h>
#include <unistd.h>

#include "base/log.hpp"
#include "hw/backends.hpp"
#include "hw/linux/clock_offset.hpp"
#include "hw/raw_can_bus.hpp"

namespace srfs::hw {
namespace {

constexpr int frames_per_call = 64;
constexpr milliseconds restart_report_time(1000);  // after it a restart that was not reported is looked for
constexpr canid_t whole_kind =
    CAN_EFF_FLAG | CAN_RTR_FLAG;  // filters say extended data frames by comparing these

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
    raw.push_back({.can_id = (f.match & CAN_EFF_MASK) | CAN_EFF_FLAG,
                   .can_mask = (f.mask & CAN_EFF_MASK) | whole_kind});
    raw.push_back({.can_id = (f.echo_match & CAN_EFF_MASK) | CAN_EFF_FLAG,
                   .can_mask = (f.echo_mask & CAN_EFF_MASK) | whole_kind});
  }
  return ::setsockopt(socket, SOL_CAN_RAW, CAN_RAW_FILTER, raw.data(),
                      static_cast<socklen_t>(raw.size() * sizeof(can_filter))) == 0;
}

/// A bound raw socket. The error is for a person; @p down tells whether the interface exists but is down.
Result<Fd, std::string> open_raw(const std::string& interface, const std::vector<CanFilter>& filters,
                                 bool& down) {
  down = false;
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
  if ((request.ifr_flags & IFF_UP) == 0) {
    down = true;
    return Err(fmt::format("interface {} is down (ip link set {} up)", interface, interface));
  }
  if (::ioctl(socket.get(), SIOCGIFINDEX, &request) != 0) {
    return Err(fmt::format("interface {}: {}", interface, errno_text(errno)));
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

/// false when it cannot be told, too.
bool has_carrier(const std::string& interface) {
  const Fd file(::open(("/sys/class/net/" + interface + "/carrier").c_str(), O_RDONLY | O_CLOEXEC));
  char digit = '0';
  return file && ::read(file.get(), &digit, 1) == 1 && digit == '1';
}

bool is_remote(const can_frame& raw) {
  return (raw.can_id & CAN_RTR_FLAG) != 0 && (raw.can_id & CAN_ERR_FLAG) == 0;
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

class SocketCan : public RawCanBus {
 public:
  SocketCan(const std::string& uri, std::string interface, std::vector<CanFilter> filters)
      : RawCanBus(std::move(filters)), uri_(uri), interface_(std::move(interface)) {
    start(uri, [this] { return open(); });
  }

  [[nodiscard]] CanBusState state() const override {
    if (!present()) return down_ ? CanBusState::down : CanBusState::gone;
    return controller_;
  }

  [[nodiscard]] Result<void, CanError> send(const CanFrame& frame) override {
    const auto raw = to_raw(frame);
    if (!raw) return Err(raw.error());
    const int device = socket();
    if (device < 0) return Err(down_ ? CanError::down : CanError::gone);
    if (controller_ == CanBusState::bus_off && !restarted_unnoticed()) return Err(CanError::bus_off);
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
      if (r.size != static_cast<ssize_t>(sizeof(can_frame)) || r.raw.len > CAN_MAX_DLEN || is_remote(r.raw)) {
        ++counters_.malformed;
      } else if ((r.raw.can_id & CAN_ERR_FLAG) != 0) {
        on_error_frame(r.raw);
      } else if (auto frame = accept(r.raw, r.is_echo, r.at)) {
        return frame;
      }
    }
    return std::nullopt;
  }

 private:
  Result<Fd, std::string> open() {
    controller_ = CanBusState::active;
    dropped_ = 0;
    return open_raw(interface_, filters_, down_);
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
        return Err(down_ ? CanError::down : CanError::gone);
    }
  }

  // Down or unplugged. A socket bound to an interface that went away never comes back to life: a new one is
  // opened.
  void interface_lost(int error) {
    down_ = error == ENETDOWN;
    lost(errno_text(error));
  }

  void note_drops(const Received& r) {
    if (!r.dropped_so_far) return;
    counters_.receive_overruns += *r.dropped_so_far - dropped_;
    dropped_ = *r.dropped_so_far;
  }

  // Classes and octets as in linux/can/error.h.
  void on_error_frame(const can_frame& raw) {
    const canid_t id = raw.can_id;
    if ((id & (CAN_ERR_PROT | CAN_ERR_ACK | CAN_ERR_BUSERROR | CAN_ERR_TRX)) != 0) ++counters_.bus_errors;
    if ((id & CAN_ERR_LOSTARB) != 0) ++counters_.arbitration_lost;
    if ((id & CAN_ERR_CRTL) != 0) on_controller_status(raw.data[1]);
    if ((id & CAN_ERR_BUSOFF) != 0) {
      ++counters_.bus_off;
      look_for_carrier_at_ = monotonic_now() + restart_report_time;
      change(CanBusState::bus_off);
      drop_unconfirmed();  // the driver flushes its echo buffers when it takes itself off
    }
    if ((id & CAN_ERR_RESTARTED) != 0) change(CanBusState::active);
  }

  // The report of the restart may have been dropped with other frames that nobody read in time; without it
  // the bus would stay closed for ever. A controller that is off the bus has no carrier.
  bool restarted_unnoticed() {
    const MonotonicTime now = monotonic_now();
    if (now < look_for_carrier_at_) return false;
    look_for_carrier_at_ = now + restart_report_time;
    if (!has_carrier(interface_)) return false;
    change(CanBusState::active);
    return true;
  }

  void on_controller_status(std::uint8_t status) {
    if ((status & CAN_ERR_CRTL_RX_OVERFLOW) != 0) ++counters_.receive_overruns;
    if (controller_ == CanBusState::bus_off) return;  // left only by a restart
    if ((status & (CAN_ERR_CRTL_RX_PASSIVE | CAN_ERR_CRTL_TX_PASSIVE)) != 0) {
      change(CanBusState::passive);
    } else if ((status & (CAN_ERR_CRTL_RX_WARNING | CAN_ERR_CRTL_TX_WARNING)) != 0) {
      change(CanBusState::warning);
    } else if ((status & CAN_ERR_CRTL_ACTIVE) != 0) {
      change(CanBusState::active);
    }
  }

  void change(CanBusState to) {
    if (controller_ == to) return;
    log::warn("{}: controller {} -> {}", uri_, to_string(controller_), to_string(to));
    controller_ = to;
  }

  std::string uri_;
  std::string interface_;
  bool down_ = false;
  CanBusState controller_ = CanBusState::active;
  MonotonicTime look_for_carrier_at_;  // while bus-off
  std::uint32_t dropped_ = 0;
};

}  // namespace

std::unique_ptr<CanBus> make_socketcan(const std::string& uri, const std::string& interface,
                                       std::vector<CanFilter> filters) {
  return std::make_unique<SocketCan>(uri, interface, std::move(filters));
}

}  // namespace srfs::hw
