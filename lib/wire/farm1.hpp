// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>

#include "base/result.hpp"
#include "wire/tc_frame.hpp"

namespace srfs::wire {

/// States of FARM-1 (CCSDS 232.1-B-2, 6.1.2).
enum class FarmMode : std::uint8_t { open, wait, lockout };

/// Everything FARM-1 remembers of one virtual channel (6.1.3). Plain values: it can be journalled and
/// restored.
struct FarmState {
  FarmMode mode = FarmMode::open;
  std::uint8_t vr = 0;              ///< V(R), the N(S) expected next
  bool lockout = false;             ///< Lockout_Flag
  bool wait = false;                ///< Wait_Flag
  bool retransmit = false;          ///< Retransmit_Flag
  std::uint8_t farm_b_counter = 0;  ///< modulo 256; the CLCW shows its two lowest bits
  friend bool operator==(const FarmState&, const FarmState&) = default;
};

/// FARM_Sliding_Window_Width W of the link: even, 2 to 254. Its halves are the positive and negative window.
inline constexpr std::uint8_t farm_window_default = 64;

/// Events of table 6-1, by its numbers.
enum class FarmEvent : std::uint8_t {
  e1_in_sequence,            ///< valid AD frame, N(S) = V(R), buffer available
  e2_in_sequence_no_buffer,  ///< same, no buffer available
  e3_in_positive_window,     ///< V(R) < N(S) <= V(R) + PW - 1
  e4_in_negative_window,     ///< V(R) - NW <= N(S) < V(R)
  e5_outside_window,         ///< neither
  e6_expedited,              ///< valid BD frame
  e7_unlock,                 ///< valid BC frame, unlock
  e8_set_vr,                 ///< valid BC frame, set V(R)
  e9_invalid,                ///< invalid frame or unknown control command
  e10_buffer_released,       ///< higher layers have room again
};

/// What becomes of the frame.
enum class FarmVerdict : std::uint8_t {
  discard,           ///< to be dropped and counted
  accept_sequenced,  ///< AD: pass the data on
  accept_expedited,  ///< BD: pass the data on
  control_executed,  ///< BC: nothing to pass on
  none,              ///< the event was no frame
};

struct FarmOutcome {
  FarmState state;  ///< after the event
  FarmVerdict verdict = FarmVerdict::discard;
};

/// Which event a valid frame is (6.1.5 to 6.1.7).
/// @param buffer_available  the data of an AD frame could be taken now
/// @param window            W, even, 2 to 254
[[nodiscard]] FarmEvent classify(const FarmState& state, const TcFrame& frame, bool buffer_available,
                                 std::uint8_t window = farm_window_default);

/// One step of table 6-1.
/// @param set_vr  V*(R), used by e8_set_vr only
[[nodiscard]] FarmOutcome farm_step(const FarmState& state, FarmEvent event, std::uint8_t set_vr = 0);

/// classify and farm_step for one frame that passed decode_tc_frame (and security, where the channel has it).
[[nodiscard]] FarmOutcome farm_receive(const FarmState& state, const TcFrame& frame, bool buffer_available,
                                       std::uint8_t window = farm_window_default);

/// Communications link control word (CCSDS 232.0-B-3, 4.2).
struct Clcw {
  std::uint8_t status = 0;  ///< status field, 0 to 7, mission-specific
  std::uint8_t vc = 0;      ///< 0 to 63
  bool no_rf_available = false;
  bool no_bit_lock = false;
  bool lockout = false;
  bool wait = false;
  bool retransmit = false;
  std::uint8_t farm_b_counter = 0;  ///< 0 to 3
  std::uint8_t report_value = 0;    ///< V(R)
  friend bool operator==(const Clcw&, const Clcw&) = default;
};

/// What the CLCW of a channel reports about its FARM (e11: report).
[[nodiscard]] Clcw make_clcw(const FarmState& state, std::uint8_t vc);
[[nodiscard]] std::uint32_t encode_clcw(const Clcw& clcw);

enum class ClcwError : std::uint8_t {
  not_a_clcw,     ///< control word type is not 0 or the version is not 0
  not_cop1,       ///< COP in effect is not 1
  reserved_bits,  ///< a reserved bit is set
};
[[nodiscard]] Result<Clcw, ClcwError> decode_clcw(std::uint32_t word);

}  // namespace srfs::wire
