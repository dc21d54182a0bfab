// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>

#include "base/octets.hpp"
#include "base/result.hpp"
#include "base/time.hpp"

namespace srfs::hw {

/// One classic CAN frame.
struct CanFrame {
  std::uint32_t id = 0;  ///< 29 bits if extended, else 11
  bool extended = true;
  bool remote = false;    ///< without data; received only without filters
  std::uint8_t size = 0;  ///< 0-8
  std::array<std::uint8_t, 8> data{};
  bool is_echo = false;       ///< received: an own frame that has left on the bus (transmit confirmation)
  MonotonicTime timestamp{};  ///< received: when it was complete, on CLOCK_MONOTONIC

  [[nodiscard]] OctetView view() const { return {data.data(), size}; }
};

enum class CanError : std::uint8_t {
  queue_full,     ///< the transmit queue has no room now; try again after an echo
  invalid_frame,  ///< identifier or size out of range
  bus_off,        ///< the controller has taken itself off the bus; it comes back by a restart
  down,           ///< the interface is down
  gone,           ///< no device or no hub at present; it is opened again by later calls
  not_granted,    ///< LeasedCanBus: no lease, past its end, or an old grant
};
[[nodiscard]] const char* to_string(CanError error);

enum class CanBusState : std::uint8_t { active, warning, passive, bus_off, down, gone };
[[nodiscard]] const char* to_string(CanBusState state);

/// The controller as it was last reported: error counters are reported with changes of state, not with each
/// error.
struct CanController {
  CanBusState state = CanBusState::active;
  std::optional<std::uint16_t> transmit_errors;  ///< TEC of ISO 11898-1
  std::optional<std::uint16_t> receive_errors;   ///< REC
  std::optional<std::uint32_t> bit_rate;         ///< bit/s
  friend bool operator==(const CanController&, const CanController&) = default;
};

struct CanCounters {
  std::uint64_t sent = 0;              ///< accepted by the driver
  std::uint64_t echoed = 0;            ///< left on the bus
  std::uint64_t received = 0;          ///< of others
  std::uint64_t refused_full = 0;      ///< send() with queue_full
  std::uint64_t lost_in_queue = 0;     ///< own frames that never left: device vanished, bus-off, withdrawn
  std::uint64_t receive_overruns = 0;  ///< frames the driver or controller dropped before we read them
  std::uint64_t malformed = 0;         ///< no classic frame, or an unwanted remote frame
  std::uint64_t bus_errors = 0;        ///< error frames: bit, form, stuff, CRC, acknowledgement
  std::uint64_t arbitration_lost = 0;
  std::uint64_t bus_off = 0;   ///< times the controller went bus-off
  std::uint64_t restarts = 0;  ///< times it came back, by whomever
  std::uint64_t withdrawals = 0;
  std::uint64_t reopened = 0;
};

/// One CAN bus as one process sees it. Not thread-safe: one thread uses it.
///
/// A vanished device is no reason to give up: calls report `gone` and try to open it again, at most every 100
/// ms. fd() stays the same descriptor throughout and wakes the owner for such a try too.
class CanBus {
 public:
  virtual ~CanBus() = default;

  /// Readable (EPOLLIN, level-triggered) when receive() has something to do. Same number for the object's
  /// lifetime.
  [[nodiscard]] virtual int fd() const = 0;
  /// Queues one frame; never blocks. Only the echo shows that it has left.
  [[nodiscard]] virtual Result<void, CanError> send(const CanFrame& frame) = 0;
  /// The next frame, echoes of own frames included; nullopt when there is none. Never blocks.
  [[nodiscard]] virtual std::optional<CanFrame> receive() = 0;
  /// Frames accepted by send() whose echo has not been received.
  [[nodiscard]] virtual std::size_t unconfirmed() const = 0;
  /// Takes back own frames that wait for a bus they do not get; what is on the wire already is completed.
  /// unconfirmed() falls with the device's answer, at once or in a later receive().
  /// @return false: the device cannot, or this process may not
  virtual bool withdraw() = 0;
  [[nodiscard]] CanBusState state() const { return controller().state; }
  [[nodiscard]] virtual CanController controller() const = 0;
  /// Why state() is `gone` or `down`, for a person; empty otherwise.
  [[nodiscard]] virtual std::string reason() const = 0;
  [[nodiscard]] virtual const CanCounters& counters() const = 0;
  /// The process that plays this bus, which needs a CPU to let frames leave; 0: a real bus.
  [[nodiscard]] virtual pid_t simulator() const { return 0; }
};

/// The fence at the handle: writes only under the current grant and before the end of its lease. Everything
/// else is refused and counted, whatever state the owner believes to be in.
class LeasedCanBus {
 public:
  /// @param bus  must outlive this object
  explicit LeasedCanBus(CanBus& bus) : bus_(bus) {}

  /// Opens the fence. @p grant must be above every grant before (else refused). The lease is never renewed.
  bool begin(std::uint64_t grant, MonotonicTime lease_end);
  /// Closes it; the grant is used up.
  void end() { open_ = false; }
  /// As CanBus::send, when @p grant is the open one and @p now is before the lease end; else not_granted.
  [[nodiscard]] Result<void, CanError> send(const CanFrame& frame, std::uint64_t grant, MonotonicTime now);
  [[nodiscard]] bool granted(MonotonicTime now) const { return open_ && now < lease_end_; }
  /// Every own frame has left on the bus: the bus may be released.
  [[nodiscard]] bool quiet() const { return bus_.unconfirmed() == 0; }
  [[nodiscard]] std::uint64_t refused() const { return refused_; }

 private:
  CanBus& bus_;
  std::uint64_t grant_ = 0;
  MonotonicTime lease_end_;
  bool open_ = false;
  std::uint64_t refused_ = 0;
};

}  // namespace srfs::hw
