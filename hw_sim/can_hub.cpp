// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "hw_sim/can_hub.hpp"

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstring>
#include <vector>

#include <fmt/format.h>
#include <linux/can.h>
#include <linux/can/error.h>
#include <sys/epoll.h>
#include <sys/socket.h>
#include <sys/timerfd.h>
#include <sys/un.h>
#include <unistd.h>

#include "hw/linux/clock_offset.hpp"
#include "hw/sim/can_hub_requests.hpp"
#include "hw/sim/seqpacket.hpp"

namespace srfs::sim {
namespace {

constexpr std::size_t max_clients = 16;
constexpr int datagrams_per_call = 64;
constexpr int backlog = 16;

bool somebody_listens(const sockaddr_un& address) {
  const Fd probe(::socket(AF_UNIX, SOCK_SEQPACKET | SOCK_CLOEXEC | SOCK_NONBLOCK, 0));
  return ::connect(probe.get(), reinterpret_cast<const sockaddr*>(&address), sizeof address) == 0 ||
         errno == EAGAIN;
}

bool watch(int epoll, int fd) {
  epoll_event event{};
  event.events = EPOLLIN;
  event.data.fd = fd;
  return ::epoll_ctl(epoll, EPOLL_CTL_ADD, fd, &event) == 0;
}

std::optional<BusFrame> to_bus_frame(const can_frame& raw) {
  if (raw.len > CAN_MAX_DLEN || (raw.can_id & CAN_ERR_FLAG) != 0) return std::nullopt;
  const bool extended = (raw.can_id & CAN_EFF_FLAG) != 0;
  BusFrame frame{.id = raw.can_id & (extended ? CAN_EFF_MASK : CAN_SFF_MASK),
                 .extended = extended,
                 .remote = (raw.can_id & CAN_RTR_FLAG) != 0,
                 .size = raw.len,
                 .data = {}};
  std::copy_n(raw.data, raw.len, frame.data.begin());
  return frame;
}

can_frame to_raw(const BusFrame& frame, bool echo) {
  can_frame raw{};
  raw.can_id = frame.id | (frame.extended ? CAN_EFF_FLAG : 0U) | (frame.remote ? CAN_RTR_FLAG : 0U);
  raw.len = frame.size;
  raw.__res0 = echo ? 1 : 0;
  std::copy_n(frame.data.begin(), frame.size, raw.data);
  return raw;
}

can_frame to_raw(const ControllerReport& report) {
  using Kind = ControllerReport::Kind;
  can_frame raw{};
  raw.can_id = CAN_ERR_FLAG;
  raw.len = CAN_ERR_DLC;
  const auto side = [](unsigned errors, std::uint8_t passive, std::uint8_t warning) -> std::uint8_t {
    if (errors >= FaultConfinement::passive_from) return passive;
    return errors >= FaultConfinement::warning_from ? warning : 0;
  };
  switch (report.kind) {
    case Kind::error:
      raw.can_id |= CAN_ERR_PROT | CAN_ERR_BUSERROR;
      raw.data[2] = report.was_transmitting ? CAN_ERR_PROT_BIT | CAN_ERR_PROT_TX : CAN_ERR_PROT_STUFF;
      break;
    case Kind::state:
      raw.can_id |= CAN_ERR_CRTL;
      raw.data[1] = static_cast<std::uint8_t>(
          side(report.transmit_errors, CAN_ERR_CRTL_TX_PASSIVE, CAN_ERR_CRTL_TX_WARNING) |
          side(report.receive_errors, CAN_ERR_CRTL_RX_PASSIVE, CAN_ERR_CRTL_RX_WARNING));
      if (raw.data[1] == 0) raw.data[1] = CAN_ERR_CRTL_ACTIVE;
      break;
    case Kind::bus_off:
      raw.can_id |= CAN_ERR_BUSOFF;
      break;
    case Kind::restarted:
      raw.can_id |= CAN_ERR_RESTARTED;
      break;
  }
  if (report.state != ErrorState::bus_off && report.kind != Kind::restarted) {
    raw.can_id |= CAN_ERR_CNT;
    raw.data[6] = static_cast<std::uint8_t>(report.transmit_errors);
    raw.data[7] = static_cast<std::uint8_t>(report.receive_errors);
  }
  return raw;
}

/// One datagram, with the time at which the sender wrote it.
struct Datagram {
  can_frame raw{};
  ssize_t size = -1;
  std::optional<UtcTime> written;
};

Datagram receive_one(int socket) {
  Datagram d;
  iovec part{.iov_base = &d.raw, .iov_len = sizeof d.raw};
  alignas(cmsghdr) std::array<char, CMSG_SPACE(sizeof(timespec))> control{};
  msghdr message{};
  message.msg_iov = &part;
  message.msg_iovlen = 1;
  message.msg_control = control.data();
  message.msg_controllen = control.size();
  d.size = ::recvmsg(socket, &message, MSG_TRUNC);
  if (d.size <= 0) return d;
  for (const cmsghdr* c = CMSG_FIRSTHDR(&message); c != nullptr;
       c = CMSG_NXTHDR(&message, const_cast<cmsghdr*>(c))) {
    if (c->cmsg_level != SOL_SOCKET || c->cmsg_type != SO_TIMESTAMPNS) continue;
    timespec t{};
    std::memcpy(&t, CMSG_DATA(c), sizeof t);
    d.written = hw::to_utc_time(t);
  }
  return d;
}

bool is_of_this_process(int socket) {
  ucred peer{};
  socklen_t size = sizeof peer;
  return ::getsockopt(socket, SOL_SOCKET, SO_PEERCRED, &peer, &size) == 0 && peer.pid == ::getpid();
}

}  // namespace

CanHub::CanHub(std::filesystem::path socket_path, Fd listener, BusArbiter arbiter)
    : socket_path_(std::move(socket_path)),
      arbiter_(std::move(arbiter)),
      epoll_(::epoll_create1(EPOLL_CLOEXEC)),
      listener_(std::move(listener)),
      timer_(::timerfd_create(CLOCK_MONOTONIC, TFD_CLOEXEC | TFD_NONBLOCK)),
      computer_(arbiter_.add_station()) {}

CanHub::~CanHub() {
  ::unlink(socket_path_.c_str());
}

Result<std::unique_ptr<CanHub>, std::string> CanHub::create(const std::filesystem::path& socket_path,
                                                            BusArbiter arbiter) {
  const auto address = hw::unix_address(socket_path);
  if (!address) return Err(address.error());
  if (somebody_listens(*address))
    return Err(fmt::format("another hub is listening at {}", socket_path.string()));
  auto listener = hw::listen_seqpacket(socket_path, backlog);
  if (!listener) return Err(listener.error());
  std::unique_ptr<CanHub> hub(new CanHub(socket_path, *std::move(listener), std::move(arbiter)));
  if (!watch(hub->epoll_.get(), hub->listener_.get()) || !watch(hub->epoll_.get(), hub->timer_.get()))
    return Err(fmt::format("cannot watch {}: {}", socket_path.string(), errno_text(errno)));
  return hub;
}

void CanHub::on_readable(MonotonicTime now) {
  // All stamps are placed by one look at both clocks: their distances are exact.
  const UtcTime utc_now = system_utc_now();
  const ClockPair clocks{.utc = utc_now, .monotonic = hw::place_on_monotonic(utc_now).value_or(now)};
  std::array<epoll_event, max_clients + 2> events{};
  const int n = ::epoll_wait(epoll_.get(), events.data(), static_cast<int>(events.size()), 0);
  for (int i = 0; i < n; ++i) {
    const int fd = events[static_cast<std::size_t>(i)].data.fd;
    if (fd == listener_.get()) {
      accept_clients();
    } else if (fd == timer_.get()) {
      std::uint64_t expiries = 0;
      [[maybe_unused]] const auto got = ::read(fd, &expiries, sizeof expiries);
      armed_.reset();
    } else {
      read_client(fd, now, clocks);
    }
  }
  handle_inputs();
  advance(now);
}

/// In the order in which they were written, the bus with them.
void CanHub::handle_inputs() {
  std::stable_sort(inputs_.begin(), inputs_.end(),
                   [](const Input& a, const Input& b) { return a.at < b.at; });
  for (const Input& input : inputs_) {
    const auto client = clients_.find(input.fd);
    if (client == clients_.end()) continue;
    advance(std::max(input.at, advanced_));
    if (!input.frame) {
      drop_client(input.fd);
    } else if (input.frame->can_id == hw::can_hub_restart || input.frame->can_id == hw::can_hub_withdraw) {
      on_request(client->second, *input.frame, advanced_);
    } else if (const auto frame = to_bus_frame(*input.frame)) {
      if (!client->second.address && frame->extended)
        client->second.address = static_cast<std::uint8_t>(frame->id);
      (void)arbiter_.submit(client->second.bus, *frame, advanced_);  // refusals are counted by the arbiter
    } else {
      ++counters_.malformed;
    }
  }
  inputs_.clear();
}

void CanHub::advance(MonotonicTime now) {
  advanced_ = std::max(advanced_, now);
  while (const auto delivery = arbiter_.advance(now)) {
    send_reports();
    deliver(*delivery);
    if (tap_) tap_(*delivery);
  }
  send_reports();
  arm_timer();
}

void CanHub::accept_clients() {
  while (true) {
    Fd socket(::accept4(listener_.get(), nullptr, nullptr, SOCK_CLOEXEC | SOCK_NONBLOCK));
    if (!socket) return;
    if (clients_.size() == max_clients) {
      ++counters_.refused_clients;
      continue;
    }
    const int fd = socket.get();
    const int on = 1;
    // Without stamps a frame counts as written when it is read.
    (void)::setsockopt(fd, SOL_SOCKET, SO_TIMESTAMPNS, &on, sizeof on);
    if (!watch(epoll_.get(), fd)) continue;
    ++counters_.connected;
    const BusClient bus = is_of_this_process(fd) ? arbiter_.add_client() : arbiter_.add_client(computer_);
    const auto client = clients_.emplace(
        fd, Client{.socket = std::move(socket), .bus = bus, .address = {}, .overrun = false});
    greet(client.first->second);
  }
}

void CanHub::read_client(int fd, MonotonicTime now, const ClockPair& clocks) {
  MonotonicTime last;  // a client's frames keep their order, whatever the clock is set to meanwhile
  for (int i = 0; i < datagrams_per_call; ++i) {
    const Datagram datagram = receive_one(fd);
    if (datagram.size < 0 && (errno == EAGAIN || errno == EINTR)) return;
    if (datagram.size <= 0) {
      inputs_.push_back({.at = now, .fd = fd, .frame = std::nullopt});
      return;
    }
    if (datagram.size == static_cast<ssize_t>(sizeof datagram.raw)) {
      const nanoseconds age = datagram.written ? clocks.utc - *datagram.written : nanoseconds(0);
      // Not a step of the clock: at most a second older than the last look, however long ago that was.
      const bool plausible = age >= nanoseconds(0) && age < now - advanced_ + seconds(1);
      last = std::max(last, plausible ? std::min(now, clocks.monotonic - age) : now);
      inputs_.push_back({.at = last, .fd = fd, .frame = datagram.raw});
    } else {
      ++counters_.malformed;
    }
  }
}

void CanHub::drop_client(int fd) {
  const auto client = clients_.find(fd);
  if (client == clients_.end()) return;
  arbiter_.remove_client(client->second.bus);
  clients_.erase(client);
  ++counters_.disconnected;
}

void CanHub::deliver(const BusDelivery& delivery) {
  for (auto& [fd, client] : clients_) {
    const bool echo = client.bus == delivery.sender;
    if (!echo && delivery.lost) continue;
    if (arbiter_.controller(arbiter_.station_of(client.bus)).state() == ErrorState::bus_off) continue;
    send_to(client, to_raw(echo ? delivery.original : delivery.frame, echo));
  }
}

void CanHub::send_to(Client& client, const can_frame& raw) {
  const auto sent = [&client](const can_frame& frame) {
    // A client that went away shows as a hang-up at its descriptor; it is dropped there.
    return ::send(client.socket.get(), &frame, sizeof frame, MSG_NOSIGNAL | MSG_DONTWAIT) >= 0 ||
           (errno != EAGAIN && errno != ENOBUFS);
  };
  if (client.overrun) {
    can_frame overflow{};
    overflow.can_id = CAN_ERR_FLAG | CAN_ERR_CRTL;
    overflow.len = CAN_ERR_DLC;
    overflow.data[1] = CAN_ERR_CRTL_RX_OVERFLOW;
    client.overrun = !sent(overflow);
  }
  if (client.overrun || !sent(raw)) {
    client.overrun = true;
    ++counters_.receive_overruns;
  }
}

void CanHub::send_reports() {
  for (const ControllerReport& report : arbiter_.take_reports()) {
    for (auto& [fd, client] : clients_) {
      if (arbiter_.station_of(client.bus) == report.station) send_to(client, to_raw(report));
    }
  }
}

void CanHub::greet(Client& client) {
  const BusStation station = arbiter_.station_of(client.bus);
  const FaultConfinement& errors = arbiter_.controller(station);
  if (errors.state() == ErrorState::active) return;
  send_to(client, to_raw({.station = station,
                          .kind = errors.state() == ErrorState::bus_off ? ControllerReport::Kind::bus_off
                                                                        : ControllerReport::Kind::state,
                          .state = errors.state(),
                          .transmit_errors = errors.transmit_errors(),
                          .receive_errors = errors.receive_errors(),
                          .was_transmitting = false}));
}

void CanHub::on_request(Client& client, const can_frame& raw, MonotonicTime now) {
  const BusStation station = arbiter_.station_of(client.bus);
  if (raw.can_id == hw::can_hub_withdraw) {
    can_frame answer = raw;
    answer.len = CAN_ERR_DLC;
    answer.data[0] = static_cast<std::uint8_t>(arbiter_.withdraw(client.bus));
    send_to(client, answer);
  } else if (arbiter_.controller(station).state() == ErrorState::bus_off) {
    arbiter_.request_restart(station, now);
  } else {
    // It missed the earlier report.
    send_to(client, to_raw({.station = station,
                            .kind = ControllerReport::Kind::restarted,
                            .state = ErrorState::active,
                            .transmit_errors = 0,
                            .receive_errors = 0,
                            .was_transmitting = false}));
  }
}

bool CanHub::force_bus_off(std::uint8_t address, MonotonicTime now) {
  constexpr std::uint8_t computer_address = 0x01;
  advance(now);
  bool found = address == computer_address;
  if (found) arbiter_.force_bus_off(computer_, now);
  for (const auto& [fd, client] : clients_) {
    if (client.address != address) continue;
    arbiter_.force_bus_off(arbiter_.station_of(client.bus), now);
    found = true;
  }
  send_reports();
  arm_timer();
  return found;
}

void CanHub::set_babble(std::optional<Babble> babble, MonotonicTime now) {
  advance(now);
  arbiter_.set_babble(std::move(babble), now);
  arm_timer();
}

void CanHub::arm_timer() {
  const auto deadline = arbiter_.next_deadline();
  if (deadline == armed_) return;
  armed_ = deadline;
  itimerspec when{};  // all zero disarms
  if (deadline) {
    when.it_value.tv_sec = deadline->ns() / 1'000'000'000;
    when.it_value.tv_nsec = deadline->ns() % 1'000'000'000;
  }
  ::timerfd_settime(timer_.get(), TFD_TIMER_ABSTIME, &when, nullptr);
}

}  // namespace srfs::sim
