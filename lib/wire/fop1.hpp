// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <deque>
#include <optional>
#include <string_view>

#include "base/octets.hpp"
#include "base/time.hpp"
#include "wire/farm1.hpp"
#include "wire/tc_frame.hpp"

namespace srfs::wire {

/// States of FOP-1 (CCSDS 232.1-B-2, 5.1.2); the values are the standard's numbers.
enum class FopState : std::uint8_t {
  active = 1,                   ///< S1
  retransmit_without_wait = 2,  ///< S2
  retransmit_with_wait = 3,     ///< S3
  initialising = 4,             ///< S4, without BC frame: waits for a good CLCW
  initialising_with_bc = 5,     ///< S5, waits for the effect of a BC frame
  initial = 6,                  ///< S6, no AD service
};
inline constexpr std::size_t fop_state_count = 6;
[[nodiscard]] std::string_view to_string(FopState state);

/// Events of table 5-1, by its numbers.
enum class FopEvent : std::uint8_t {
  // CLCW, no lockout, N(R) = V(S): everything is acknowledged
  e1,  ///< no flags, N(R) = NN(R)
  e2,  ///< no flags, N(R) /= NN(R)
  e3,  ///< wait without retransmit
  e4,  ///< retransmit
  // CLCW, no lockout, NN(R) <= N(R) < V(S)
  e5,    ///< no flags, N(R) = NN(R)
  e6,    ///< no flags, N(R) /= NN(R)
  e7,    ///< wait without retransmit
  e101,  ///< retransmit, limit 1, N(R) /= NN(R)
  e102,  ///< retransmit, limit 1, N(R) = NN(R)
  e8,    ///< retransmit, N(R) /= NN(R), no wait
  e9,    ///< same, wait
  e10,   ///< retransmit, N(R) = NN(R), transmissions left, no wait
  e11,   ///< same, wait
  e12,   ///< retransmit, N(R) = NN(R), no transmission left, no wait
  e103,  ///< same, wait
  // other CLCW
  e13,  ///< N(R) outside NN(R)..V(S)
  e14,  ///< lockout
  e15,  ///< not a valid CLCW
  // timer
  e16,   ///< transmissions left, timeout type 0
  e104,  ///< transmissions left, timeout type 1
  e17,   ///< no transmission left, timeout type 0
  e18,   ///< no transmission left, timeout type 1
  // requests to transfer
  e19,  ///< AD, wait queue empty
  e20,  ///< AD, wait queue full
  e21,  ///< BD, lower procedures ready
  e22,  ///< BD, not ready
  // directives
  e23,  ///< initiate AD without CLCW check
  e24,  ///< initiate AD with CLCW check
  e25,  ///< initiate AD with unlock, lower procedures ready
  e26,  ///< same, not ready
  e27,  ///< initiate AD with set V(R), lower procedures ready
  e28,  ///< same, not ready
  e29,  ///< terminate AD
  e30,  ///< resume AD, not suspended
  e31,  ///< resume AD, suspended in S1
  e32,  ///< in S2
  e33,  ///< in S3
  e34,  ///< in S4
  e35,  ///< set V(S)
  e36,  ///< set the sliding window
  e37,  ///< set the timer's initial value
  e38,  ///< set the transmission limit
  e39,  ///< set the timeout type
  e40,  ///< not a directive
  // answers of the lower procedures
  e41,  ///< AD accepted
  e42,  ///< AD rejected
  e43,  ///< BC accepted
  e44,  ///< BC rejected
  e45,  ///< BD accepted
  e46,  ///< BD rejected
};
inline constexpr std::size_t fop_event_count = 50;
/// "E1" to "E46", "E101" to "E104".
[[nodiscard]] std::string_view to_string(FopEvent event);

/// Reasons of an alert (table 4-4): the AD service ended.
enum class FopAlert : std::uint8_t {
  limit,    ///< transmissions exhausted (limit 1), reported by a CLCW
  t1,       ///< transmissions exhausted when the timer expired
  lockout,  ///< the spacecraft's FARM-1 is locked out
  synch,    ///< a CLCW contradicts what was sent
  nn_r,     ///< a CLCW acknowledges what was not sent, or less than before
  clcw,     ///< a CLCW contradicts itself
  llif,     ///< the lower procedures refused a frame
  term,     ///< terminated by directive
};
[[nodiscard]] std::string_view to_string(FopAlert alert);

/// What one cell of table 5-1 does, in the standard's words (5.2).
enum class FopAction : std::uint8_t {
  none,  ///< also "ignore"
  remove_acknowledged,
  look_for_frame,
  look_for_directive,
  retransmit_ad,  ///< initiate AD retransmission
  retransmit_bc,  ///< initiate BC retransmission
  start_timer,
  cancel_timer,
  alert,
  confirm_initiate,  ///< positive confirm of the pending initiate directive
  release_bc,        ///< drop the copy of the BC frame
  suspend,
  resume,
  queue_frame,  ///< to the wait queue
  accept,
  reject,
  confirm,
  initialise,
  take_vs,  ///< V(S) and NN(R) := the directive's value
  transmit_bc,
  transmit_bd,
  take_value,  ///< window, timer, limit or timeout type := the directive's value
  ad_ready,
  bc_ready,
  bd_ready,
};

struct FopCell {
  std::array<FopAction, 4> actions{};  ///< in order, none behind the last
  FopState next = FopState::initial;
  FopAlert reason = FopAlert::synch;  ///< of alert
};
/// Table 5-1. Where the standard has "not applicable" stands what is safe: a CLCW that acknowledges during S4
/// gives alert(synch), one during S5 is ignored; a timer in S6 is ignored.
[[nodiscard]] const FopCell& fop_cell(FopEvent event, FopState state);

/// What the operator may set (E36 to E39), within the standard's ranges.
struct FopSettings {
  std::uint8_t window = 10;              ///< K, 1 to FARM-1's positive window (32)
  milliseconds timer{2000};              ///< T1_Initial, over the longest round trip
  std::uint8_t transmission_limit = 10;  ///< 1 to 255
  bool suspend_when_exhausted = false;   ///< Timeout_Type 1: suspend (resumable) instead of alert
  friend bool operator==(const FopSettings&, const FopSettings&) = default;
};
[[nodiscard]] bool is_valid(const FopSettings& settings);

/// What FOP-1 wants done or has to report. To be handled in order.
struct FopSignal {
  enum class Kind : std::uint8_t {
    transmit_ad,          ///< frame with `sequence` and `data`; answer with on_ad_accepted or on_ad_rejected
    transmit_bc,          ///< `control`; answer with on_bc_accepted or on_bc_rejected
    transmit_bd,          ///< `data`; answer with on_bd_accepted or on_bd_rejected
    accepted,             ///< request `tag` was taken
    rejected,             ///< request `tag` was refused: it was never transmitted
    confirmed,            ///< AD request `tag`: FARM-1 has accepted it
    not_confirmed,        ///< AD request `tag`: transmitted, whether it arrived is unknown
    directive_accepted,   ///< directive `tag`
    directive_rejected,   ///< directive `tag` does not fit the state
    directive_confirmed,  ///< directive `tag` is done
    directive_failed,     ///< initiate directive `tag`: ended by an alert
    alert,                ///< `reason`; the service is off (S6)
    suspended,            ///< resume goes on where it stopped
  };
  Kind kind = Kind::alert;
  std::uint64_t tag = 0;
  std::uint8_t sequence = 0;
  bool repeated = false;  ///< transmit_ad, transmit_bc: not the first time
  Octets data = {};
  ControlCommand control = {};
  FopAlert reason = FopAlert::synch;
  FopEvent event = FopEvent::e1;       ///< alert: what caused it
  FopState state = FopState::initial;  ///< alert: where it happened
};

/// FOP-1 of one virtual channel (CCSDS 232.1-B-2, section 5): sends AD frames in order, each exactly once,
/// over a line that loses some. Holds data, not frames: the transmitter makes (and secures) a new frame each
/// time. Pure; memory: K frames and the signals of one event. Handle next_signal() until it is empty after
/// each call. Tags are the caller's.
class Fop1 {
 public:
  struct Sent {
    std::uint8_t sequence = 0;
    std::uint64_t tag = 0;
    bool retransmit = false;  ///< To_Be_Retransmitted_Flag
    bool repeated = false;
    Octets data;
  };

  explicit Fop1(FopSettings settings);

  // Directives (4.2)
  void initiate_without_check(std::uint64_t tag, MonotonicTime now);
  /// Succeeds with a CLCW whose N(R) is V(S).
  void initiate_with_check(std::uint64_t tag, MonotonicTime now);
  /// @note V(S) should be the FARM's V(R): set_vs before it, from a CLCW
  void initiate_with_unlock(std::uint64_t tag, MonotonicTime now);
  void initiate_with_set_vr(std::uint64_t tag, std::uint8_t vr, MonotonicTime now);
  void terminate(std::uint64_t tag, MonotonicTime now);
  void resume(std::uint64_t tag, MonotonicTime now);
  void set_vs(std::uint64_t tag, std::uint8_t vs, MonotonicTime now);
  /// E36 to E39 at once; values out of range are refused (E40).
  void set_settings(std::uint64_t tag, const FopSettings& settings, MonotonicTime now);

  // Requests
  /// One frame may wait (room() shows whether it can): more is rejected.
  void request_ad(std::uint64_t tag, Octets data, MonotonicTime now);
  void request_bd(std::uint64_t tag, Octets data, MonotonicTime now);

  // From the line
  /// A CLCW of this virtual channel with COP-1 in effect.
  void on_clcw(const Clcw& clcw, MonotonicTime now);
  /// A control word that should be one, and is not valid.
  void on_invalid_clcw(MonotonicTime now);
  /// To be called from deadline() on.
  void on_time(MonotonicTime now);
  [[nodiscard]] std::optional<MonotonicTime> deadline() const { return timer_; }

  // Answers of the lower procedures
  void on_ad_accepted(MonotonicTime now);
  void on_ad_rejected(MonotonicTime now);
  void on_bc_accepted(MonotonicTime now);
  void on_bc_rejected(MonotonicTime now);
  void on_bd_accepted(MonotonicTime now);
  void on_bd_rejected(MonotonicTime now);

  [[nodiscard]] std::optional<FopSignal> next_signal();

  [[nodiscard]] FopState state() const { return state_; }
  [[nodiscard]] const FopSettings& settings() const { return settings_; }
  [[nodiscard]] std::uint8_t vs() const { return vs_; }    ///< V(S), the next N(S)
  [[nodiscard]] std::uint8_t nnr() const { return nnr_; }  ///< NN(R), the oldest N(S) not acknowledged
  /// Frames that are transmitted and not acknowledged.
  [[nodiscard]] std::size_t outstanding() const { return sent_.size(); }
  [[nodiscard]] bool waiting() const { return wait_.has_value(); }
  /// A request_ad would be accepted or queued.
  [[nodiscard]] bool room() const;
  [[nodiscard]] std::uint8_t transmission_count() const { return transmission_count_; }
  /// The state it was suspended in, nullopt: it is not suspended (Suspend_State).
  [[nodiscard]] std::optional<FopState> suspended_in() const { return suspended_in_; }

 private:
  /// What came with an event.
  struct Input {
    std::uint64_t tag = 0;
    std::uint8_t value = 0;  ///< N(R), V*(R), V*(S)
    Octets data = {};
    ControlCommand control = {};
    FopSettings settings = {};
    bool directive = false;
  };
  struct Waiting {
    std::uint64_t tag;
    Octets data;
  };
  struct ControlFrame {
    ControlCommand command;
    bool retransmit = false;
  };

  [[nodiscard]] FopEvent classify(const Clcw& clcw) const;
  void apply(FopEvent event, Input input, MonotonicTime now);
  void act(FopAction action, FopEvent event, const FopCell& cell, Input& input, MonotonicTime now);
  void retransmit_ad(MonotonicTime now);
  void retransmit_bc(MonotonicTime now);
  void confirm_initiate();
  void suspend(FopEvent event);
  void initialise();
  void transmit_bc(const ControlCommand& command, MonotonicTime now);
  void transmit_bd(Input& input);
  void remove_acknowledged(std::uint8_t nr);
  void look_for_frame(MonotonicTime now);
  void look_for_directive();
  void raise_alert(FopAlert reason, FopEvent event);
  void purge();
  void answer(FopSignal::Kind directive, FopSignal::Kind request, const Input& input);
  void start_timer(MonotonicTime now) { timer_ = now + settings_.timer; }

  FopSettings settings_;
  FopState state_ = FopState::initial;
  std::uint8_t vs_ = 0;
  std::uint8_t nnr_ = 0;
  std::uint8_t transmission_count_ = 1;
  std::optional<FopState> suspended_in_;
  bool ad_ready_ = true;
  bool bc_ready_ = true;
  bool bd_ready_ = true;
  std::uint64_t bd_tag_ = 0;
  std::optional<MonotonicTime> timer_;
  std::deque<Sent> sent_;           // Sent_Queue, AD frames
  std::optional<ControlFrame> bc_;  // Sent_Queue, the BC frame
  std::optional<Waiting> wait_;     // Wait_Queue
  std::optional<std::uint64_t> initiating_;
  std::deque<FopSignal> signals_;
};

}  // namespace srfs::wire
