// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <linux/can.h>

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "base/fd.hpp"
#include "base/result.hpp"
#include "base/time.hpp"
#include "hw_sim/bus_arbiter.hpp"

namespace srfs::sim {

struct CanHubCounters {
  std::uint64_t connected = 0;  ///< clients ever
  std::uint64_t disconnected = 0;
  std::uint64_t refused_clients = 0;  ///< above the limit of 16
  std::uint64_t malformed = 0;        ///< datagrams that are neither a classic struct can_frame nor a request
  std::uint64_t receive_overruns = 0;  ///< deliveries a client was too slow to take: lost for that client
};

/// The simulated CAN bus: an AF_UNIX SOCK_SEQPACKET server that carries struct can_frame
/// (docs/reference/icd_can.md, "The hub") and paces them through a BusArbiter. Not thread-safe; never blocks.
///
/// Use: watch fd() for EPOLLIN and call on_readable() with the time of the wake-up. Connections, frames and
/// the ends of frames on the wire all arrive through that one descriptor.
class CanHub {
 public:
  /// Sees every frame at its end on the bus, lost and corrupted ones too.
  using Tap = std::function<void(const BusDelivery&)>;

  /// Listens at @p socket_path; replaces a socket file without a listener. Error: ready to print.
  [[nodiscard]] static Result<std::unique_ptr<CanHub>, std::string> create(
      const std::filesystem::path& socket_path, BusArbiter arbiter);
  ~CanHub();
  CanHub(const CanHub&) = delete;
  CanHub& operator=(const CanHub&) = delete;

  /// One descriptor for everything (level-triggered, EPOLLIN): the same for the hub's lifetime.
  [[nodiscard]] int fd() const { return epoll_.get(); }
  /// Handles all that is due at @p now, bounded to 64 datagrams per client and call. A frame is ready for the
  /// bus from the time its client wrote it, as with a controller: how late this process was woken does not
  /// count.
  void on_readable(MonotonicTime now);
  /// Delivers the frames whose end is not after @p now. on_readable() includes it.
  void advance(MonotonicTime now);
  /// When advance() has something to do; fd() turns readable then.
  [[nodiscard]] std::optional<MonotonicTime> next_deadline() const { return arbiter_.next_deadline(); }

  void set_tap(Tap tap) { tap_ = std::move(tap); }
  void set_faults(BusFaults faults) { arbiter_.set_faults(std::move(faults)); }
  /// The controller of a station goes bus-off: all the computer's handles share one.
  /// @param address  of docs/reference/icd_can.md; of a peripheral: known once it has sent a frame
  /// @return false: no such station
  bool force_bus_off(std::uint8_t address, MonotonicTime now);
  void set_automatic_restart(std::optional<nanoseconds> after) { arbiter_.set_automatic_restart(after); }
  void set_babble(std::optional<Babble> babble, MonotonicTime now);
  [[nodiscard]] const FaultConfinement& computer() const { return arbiter_.controller(computer_); }
  [[nodiscard]] const BusFaults& faults() const { return arbiter_.faults(); }
  [[nodiscard]] const BusCounters& bus_counters() const { return arbiter_.counters(); }
  [[nodiscard]] const CanHubCounters& counters() const { return counters_; }
  [[nodiscard]] std::size_t clients() const { return clients_.size(); }

 private:
  struct Client {
    Fd socket;
    BusClient bus = 0;
    std::optional<std::uint8_t> address;  ///< the source of the frames it sends
    bool overrun = false;                 ///< it lost something and was not notified yet
  };
  /// One instant on two clocks.
  struct ClockPair {
    UtcTime utc;
    MonotonicTime monotonic;
  };
  /// What a client wrote, or without frame, that it is gone.
  struct Input {
    MonotonicTime at;
    int fd = -1;
    std::optional<can_frame> frame;
  };
  CanHub(std::filesystem::path socket_path, Fd listener, BusArbiter arbiter);
  void accept_clients();
  /// Appends to inputs_ what @p fd has.
  void read_client(int fd, MonotonicTime now, const ClockPair& clocks);
  void handle_inputs();
  void drop_client(int fd);
  void deliver(const BusDelivery& delivery);
  /// Counts and remembers what the client is too slow to take.
  void send_to(Client& client, const can_frame& raw);
  void send_reports();
  void greet(Client& client);
  void on_request(Client& client, const can_frame& raw, MonotonicTime now);
  void arm_timer();

  std::filesystem::path socket_path_;
  BusArbiter arbiter_;
  CanHubCounters counters_;
  Tap tap_;
  Fd epoll_;
  Fd listener_;
  Fd timer_;
  std::optional<MonotonicTime> armed_;
  std::map<int, Client> clients_;
  std::vector<Input> inputs_;  // of one call of on_readable()
  MonotonicTime advanced_;
  BusStation computer_;  ///< every client of another process: handles of one controller
};

}  // namespace srfs::sim
