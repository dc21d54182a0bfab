// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include <cerrno>
#include <utility>

#include <sys/socket.h>

#include "hw/backends.hpp"
#include "hw/raw_can_bus.hpp"
#include "hw/sim/can_hub_requests.hpp"
#include "hw/sim/seqpacket.hpp"

namespace srfs::hw {
namespace {

constexpr std::size_t transmit_queue = 64;  // of the hub for each client
constexpr int datagrams_per_call = 64;

constexpr std::uint32_t bit_rate = 500'000;  // docs/reference/icd_can.md, section 1
/// The hub of hw_sim (docs/reference/icd_can.md): each datagram is one struct can_frame, __res0 = 1 marks an
/// echo.
class SimCan : public RawCanBus {
 public:
  SimCan(const std::string& uri, const path& hub, std::vector<CanFilter> filters)
      : RawCanBus(uri, std::move(filters)) {
    start([this, hub] {
      // The hub reports a controller that is not error-active with the first frame.
      opened_with({.state = CanBusState::active,
                   .transmit_errors = std::uint16_t{0},
                   .receive_errors = std::uint16_t{0},
                   .bit_rate = bit_rate});
      auto device = connect_seqpacket(hub);
      simulator_ = device ? peer_of(device->get()) : 0;
      return device;
    });
  }

  [[nodiscard]] Result<void, CanError> send(const CanFrame& frame) override {
    const auto raw = to_raw(frame);
    if (!raw) return Err(raw.error());
    const int device = socket();
    if (device < 0) return Err(CanError::gone);
    if (state() == CanBusState::bus_off) return Err(CanError::bus_off);
    if (unconfirmed() == transmit_queue) return refuse_full();
    if (::send(device, &*raw, sizeof *raw, MSG_NOSIGNAL) != static_cast<ssize_t>(sizeof *raw)) {
      if (errno == EAGAIN || errno == ENOBUFS) return refuse_full();
      lost("write: " + errno_text(errno));
      return Err(CanError::gone);
    }
    note_sent();
    return {};
  }

  [[nodiscard]] std::optional<CanFrame> receive() override {
    const int device = socket();
    if (device < 0) return std::nullopt;
    for (int i = 0; i < datagrams_per_call; ++i) {
      can_frame raw{};
      const ssize_t n = ::recv(device, &raw, sizeof raw, MSG_TRUNC);
      if (n < 0) {
        if (errno != EAGAIN && errno != EINTR) lost("read: " + errno_text(errno));
        return std::nullopt;
      }
      if (n == 0) {
        lost("the hub closed the connection");
        return std::nullopt;
      }
      if (n != static_cast<ssize_t>(sizeof raw) || raw.len > CAN_MAX_DLEN) {
        ++counters_.malformed;
      } else if (raw.can_id == can_hub_withdraw) {
        on_withdrawn(raw.data[0]);
      } else if (is_error_frame(raw)) {
        on_report(decode_error_frame(raw));
      } else if (is_unwanted_remote(raw)) {
        ++counters_.malformed;
      } else if (auto frame = accept(raw, raw.__res0 == 1, monotonic_now())) {
        return frame;
      }
    }
    return std::nullopt;
  }

  bool withdraw() override {
    const int device = socket();
    if (device < 0 || !ask(device, can_hub_withdraw)) return false;
    ++counters_.withdrawals;
    return true;
  }

  [[nodiscard]] pid_t simulator() const override { return simulator_; }

 private:
  /// 0: of another PID namespace, or not known.
  static pid_t peer_of(int device) {
    ucred peer{};
    socklen_t size = sizeof peer;
    return ::getsockopt(device, SOL_SOCKET, SO_PEERCRED, &peer, &size) == 0 ? peer.pid : 0;
  }
  void try_restart(int device) override { (void)ask(device, can_hub_restart); }

  /// A hub that does not take it now is asked again by the next call, or hangs up.
  static bool ask(int device, canid_t request) {
    can_frame raw{};
    raw.can_id = request;
    return ::send(device, &raw, sizeof raw, MSG_NOSIGNAL) == static_cast<ssize_t>(sizeof raw);
  }

  pid_t simulator_ = 0;
};

}  // namespace

std::unique_ptr<CanBus> make_sim_can(const std::string& uri, const path& socket,
                                     std::vector<CanFilter> filters) {
  return std::make_unique<SimCan>(uri, socket, std::move(filters));
}

}  // namespace srfs::hw
