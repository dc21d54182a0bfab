// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <deque>
#include <optional>
#include <string>
#include <string_view>

#include "base/octets.hpp"
#include "base/time.hpp"
#include "wire/farm1.hpp"
#include "wire/fop1.hpp"

namespace srfs::ground {

/// What the operator has of the AD service.
enum class AdPhase : std::uint8_t {
  off,
  seeking,     ///< waits for a CLCW that says where FARM-1 stands
  initiating,  ///< FOP-1 in S4 or S5
  on,          ///< FOP-1 in S1, S2 or S3
};
[[nodiscard]] std::string_view to_text(AdPhase phase);

/// COP-1 as the ground sees it.
struct CopReport {
  AdPhase phase = AdPhase::off;
  wire::FopState state = wire::FopState::initial;
  std::uint8_t vs = 0;
  std::uint8_t nnr = 0;
  std::size_t outstanding = 0;     ///< transmitted, not acknowledged
  std::size_t queued = 0;          ///< not transmitted yet
  std::uint64_t repeated = 0;      ///< frames transmitted again so far
  std::optional<wire::Clcw> clcw;  ///< the last one of the channel
  std::uint64_t bad_clcws = 0;     ///< control words that are no CLCW of COP-1
  std::string problem;             ///< why the service ended; empty: it did not, or on request
};

/// What the service orders or reports. To be handled in order.
struct AdSignal {
  enum class Kind : std::uint8_t {
    transmit_ad,  ///< frame with `sequence` around `packet`; answer with on_transmitted
    transmit_bc,  ///< `control`; answer with on_transmitted
    delivered,    ///< `tag` was accepted by FARM-1
    undelivered,  ///< `tag` was transmitted; whether it arrived is unknown
    not_sent,     ///< `tag` was never transmitted
    changed,      ///< report() has news
  };
  Kind kind = Kind::changed;
  std::uint64_t tag = 0;
  std::uint8_t sequence = 0;
  bool repeated = false;
  Octets packet = {};
  wire::ControlCommand control = {};
};

/// The AD service of one telecommand channel for an operator: FOP-1, a queue before it, and the management
/// that the standard leaves to the user: it takes V(S) from the spacecraft's CLCW, and starts with Set V(R)
/// when none comes by itself (the spacecraft answers every uplink with a CLCW) or the last user left frames
/// behind. Pure. After an alert it is off:
/// starting again is the operator's decision. Handle next_signal() until it is empty after each call.
class AdService {
 public:
  static constexpr std::size_t queue_capacity = 256;

  AdService(std::uint8_t vc, wire::FopSettings settings) : vc_(vc), fop_(settings) {}

  /// Nothing when it is on or starting.
  void start(MonotonicTime now);
  /// Ends a running service, unlocks FARM-1 and starts anew.
  void unlock(MonotonicTime now);
  /// Ends a running service, sets FARM-1's V(R) and starts anew.
  void set_vr(std::uint8_t vr, MonotonicTime now);
  void stop(MonotonicTime now);

  /// @return false: the service is off or the queue full; nothing was taken
  [[nodiscard]] bool request(std::uint64_t tag, Octets packet, MonotonicTime now);
  /// A control word of the downlink; of another channel it is ignored.
  void on_control_word(std::uint32_t word, MonotonicTime now);
  /// The frame of the last transmit signal is on the line (or could not be written).
  void on_transmitted(AdSignal::Kind kind, bool written, MonotonicTime now);
  void on_time(MonotonicTime now);
  [[nodiscard]] std::optional<MonotonicTime> deadline() const;

  [[nodiscard]] std::optional<AdSignal> next_signal();
  [[nodiscard]] CopReport report() const;
  [[nodiscard]] AdPhase phase() const;

 private:
  struct Queued {
    std::uint64_t tag;
    Octets packet;
  };
  enum class Purpose : std::uint8_t { check, unlock };

  void seek(Purpose purpose, MonotonicTime now);
  void initiate(std::optional<wire::Clcw> clcw, MonotonicTime now);
  void end(std::string problem);
  /// Passes on what FOP-1 says, feeds it, and notes what changed.
  void settle(MonotonicTime now);
  void pass_on(wire::FopSignal signal);

  std::uint8_t vc_;
  wire::Fop1 fop_;
  std::optional<MonotonicTime> seeking_until_;
  Purpose purpose_ = Purpose::check;
  bool by_unlock_ = false;  // S5 was entered with unlock
  std::deque<Queued> queue_;
  std::deque<AdSignal> signals_;
  std::optional<wire::Clcw> clcw_;
  std::uint64_t bad_clcws_ = 0;
  std::uint64_t repeated_ = 0;
  std::string problem_;
  AdPhase told_phase_ = AdPhase::off;
  wire::FopState told_state_ = wire::FopState::initial;
  std::uint32_t told_flags_ = 0;
};

}  // namespace srfs::ground
