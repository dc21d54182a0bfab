// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <deque>
#include <map>
#include <optional>
#include <random>
#include <set>
#include <utility>
#include <vector>

#include "base/octets.hpp"
#include "base/time.hpp"
#include "hw_sim/fault_confinement.hpp"

namespace srfs::sim {

/// One classic CAN frame on the simulated bus.
struct BusFrame {
  std::uint32_t id = 0;  ///< 29 bits if extended, else 11
  bool extended = true;
  bool remote = false;
  std::uint8_t size = 0;  ///< 0-8
  std::array<std::uint8_t, 8> data{};
  friend bool operator==(const BusFrame&, const BusFrame&) = default;
};

/// wire::can_bits_on_wire of it.
[[nodiscard]] unsigned bits_on_wire(const BusFrame& frame);

/// Faults of the bus, all off by default. Probabilities 0-1 are drawn per frame from a seeded generator.
struct BusFaults {
  double loss_probability = 0;  ///< no receiver gets the frame; the sender has its echo (receiver overrun)
  double bit_error_probability = 0;   ///< error frame; the controller sends the frame again at once
  double corruption_probability = 0;  ///< one bit of the data is inverted beyond the CAN CRC's notice
  microseconds extra_delay{0};        ///< foreign traffic in front of every frame
  std::set<std::uint8_t> muted{};  ///< source addresses (low octet of the id) whose frames no receiver gets
};

/// A station that sends without end what it likes.
struct Babble {
  BusFrame frame;
  nanoseconds pause{0};  ///< between two frames; 0: whenever it wins the bus
};

struct BusCounters {
  std::uint64_t submitted = 0;
  std::uint64_t delivered = 0;
  std::uint64_t refused_full = 0;     ///< client queue full: the newest is refused
  std::uint64_t refused_invalid = 0;  ///< identifier or size out of range
  std::uint64_t lost = 0;             ///< at random
  std::uint64_t muted = 0;            ///< lost because their source is muted
  std::uint64_t corrupted = 0;
  std::uint64_t error_frames = 0;
  std::uint64_t discarded = 0;  ///< queued frames of a client that left
  std::uint64_t refused_bus_off = 0;
  std::uint64_t lost_in_bus_off = 0;  ///< queued or on the wire when their station went bus-off
  std::uint64_t withdrawn = 0;        ///< taken back by their client
  std::uint64_t bus_off = 0;
  std::uint64_t restarts = 0;
  std::uint64_t babbled = 0;
  nanoseconds busy{0};  ///< time the bus carried frames
};

using BusClient = std::uint32_t;
/// A CAN controller; one or more clients send through it.
using BusStation = std::uint32_t;

enum class Submission : std::uint8_t { queued, queue_full, invalid, bus_off };

/// What a controller reports to its own computer.
struct ControllerReport {
  enum class Kind : std::uint8_t { error, state, bus_off, restarted };
  BusStation station = 0;
  Kind kind = Kind::state;
  ErrorState state = ErrorState::active;
  unsigned transmit_errors = 0;
  unsigned receive_errors = 0;
  bool was_transmitting = false;  ///< of an error
};

/// What became of one frame at its end on the bus.
struct BusDelivery {
  BusClient sender = 0;
  BusFrame frame;     ///< as receivers see it
  BusFrame original;  ///< as sent: what the sender's echo carries
  bool lost = false;  ///< for the sender's echo only
  bool corrupted = false;
  MonotonicTime start;
  MonotonicTime end;
};

/// Which waiting frame gets the bus next, and how long it takes. Pure: no sockets, no clock.
///
/// Each client has a queue in the order of submission (as behind one CAN controller); among the heads the
/// lowest arbitration key wins, equal keys go to the one that waits longest. Every frame is acknowledged. A
/// station that is bus-off sends and hears nothing until it is restarted, by itself or by request. The bus
/// runs back to back: the next frame starts at the end of the one before, however late advance() is called.
class BusArbiter {
 public:
  /// @param bit_rate  bit/s, 10'000-1'000'000
  /// @param queue_capacity  frames per client
  explicit BusArbiter(std::uint32_t bit_rate = 500'000, std::size_t queue_capacity = 64,
                      std::uint64_t seed = 1);

  [[nodiscard]] BusStation add_station();
  /// @param station  nothing: one of its own
  [[nodiscard]] BusClient add_client(std::optional<BusStation> station = {});
  [[nodiscard]] BusStation station_of(BusClient client) const { return stations_of_.at(client); }
  /// Its waiting frames are discarded (counted); one that is on the wire is completed.
  void remove_client(BusClient client);
  /// Queues a frame at @p now. Call advance(now) first. @p client must exist.
  Submission submit(BusClient client, const BusFrame& frame, MonotonicTime now);
  /// The next frame whose end is not after @p now; call until nullopt.
  [[nodiscard]] std::optional<BusDelivery> advance(MonotonicTime now);
  /// End of the frame on the wire; nullopt when the bus is idle.
  [[nodiscard]] std::optional<MonotonicTime> next_deadline() const;

  /// Takes back what waits in the client's queue. @return frames it has on the wire: 0 or 1
  std::size_t withdraw(BusClient client);
  /// What waits in the station's queues, or is on the wire, is lost.
  void force_bus_off(BusStation station, MonotonicTime now);
  /// A station that is bus-off is back after the recovery time of the standard.
  void request_restart(BusStation station, MonotonicTime now);
  /// @param after  bus-off until a station asks for its restart by itself; nothing: only by request_restart()
  void set_automatic_restart(std::optional<nanoseconds> after) { automatic_restart_ = after; }
  void set_babble(std::optional<Babble> babble, MonotonicTime now);
  [[nodiscard]] const FaultConfinement& controller(BusStation station) const {
    return stations_.at(station).errors;
  }
  /// What the controllers reported since the last call, at most 256: take it after every call that changes
  /// something.
  [[nodiscard]] std::vector<ControllerReport> take_reports() { return std::exchange(reports_, {}); }

  void set_faults(BusFaults faults) { faults_ = std::move(faults); }
  [[nodiscard]] const BusFaults& faults() const { return faults_; }
  [[nodiscard]] const BusCounters& counters() const { return counters_; }
  [[nodiscard]] std::size_t waiting(BusClient client) const;
  [[nodiscard]] std::uint32_t bit_rate() const { return bit_rate_; }
  [[nodiscard]] nanoseconds time_on_wire(const BusFrame& frame) const;

 private:
  struct Waiting {
    BusFrame frame;
    std::uint64_t order = 0;
  };
  struct OnWire {
    BusClient client = 0;
    Waiting waiting;
    MonotonicTime start;
    MonotonicTime end;
    bool error = false;
    bool destroyed = false;  ///< its sender went bus-off
  };
  struct Station {
    FaultConfinement errors;
    std::optional<MonotonicTime> restart_at;
    bool goes_with_client = false;
  };
  void on_error(const OnWire& done);
  void on_success(BusClient sender);
  void enter_bus_off(BusStation station, MonotonicTime now);
  void restart_stations(MonotonicTime now);
  void report(BusStation station, ControllerReport::Kind kind, bool was_transmitting = false);
  /// As ISO 11898-1 counts; reports a change of state.
  template <class Change>
  void change_errors(BusStation station, Change change);
  [[nodiscard]] std::optional<BusDelivery> finish(const OnWire& done);
  void start_next(MonotonicTime earliest);
  [[nodiscard]] bool draw(double probability);

  std::uint32_t bit_rate_;
  std::size_t queue_capacity_;
  std::mt19937_64 random_;
  BusFaults faults_;
  BusCounters counters_;
  std::map<BusClient, std::deque<Waiting>> queues_;
  std::map<BusClient, BusStation> stations_of_;
  std::map<BusStation, Station> stations_;
  std::vector<ControllerReport> reports_;
  std::optional<nanoseconds> automatic_restart_;
  std::optional<Babble> babble_;
  MonotonicTime babble_at_;
  BusStation next_station_ = 1;
  std::optional<OnWire> on_wire_;
  BusClient next_client_ = 1;
  std::uint64_t next_order_ = 0;
};

}  // namespace srfs::sim
