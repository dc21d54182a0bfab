// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "wire/farm1.hpp"

#include <array>
#include <cassert>

namespace srfs::wire {
namespace {

/// One cell of table 6-1: the verdict, the next state and what is done on the way.
struct Cell {
  FarmVerdict verdict;
  FarmMode next;
  unsigned actions = 0;
};

enum Action : unsigned {
  count_vr = 1U << 0,  // V(R) := V(R) + 1
  take_vr = 1U << 1,   // V(R) := V*(R)
  count_b = 1U << 2,   // FARM-B_Counter + 1
  set_retransmit = 1U << 3,
  clear_retransmit = 1U << 4,
  set_wait = 1U << 5,
  clear_wait = 1U << 6,
  set_lockout = 1U << 7,
  clear_lockout = 1U << 8,
};

constexpr auto open = FarmMode::open;
constexpr auto wait = FarmMode::wait;
constexpr auto lockout = FarmMode::lockout;
constexpr auto discard = FarmVerdict::discard;
constexpr auto control = FarmVerdict::control_executed;
constexpr auto expedited = FarmVerdict::accept_expedited;
constexpr auto no_frame = FarmVerdict::none;

/// CCSDS 232.1-B-2, table 6-1. Rows: FarmEvent; columns: open (S1), wait (S2), lockout (S3). In S2 there is
/// no buffer by definition, so E1 cannot come there; the table calls it "not applicable" and the frame is
/// discarded here.
constexpr std::array<std::array<Cell, 3>, 10> table{{
    /* E1  */ {{{FarmVerdict::accept_sequenced, open, count_vr | clear_retransmit},
                {discard, wait},
                {discard, lockout}}},
    /* E2  */ {{{discard, wait, set_retransmit | set_wait}, {discard, wait}, {discard, lockout}}},
    /* E3  */ {{{discard, open, set_retransmit}, {discard, wait}, {discard, lockout}}},
    /* E4  */ {{{discard, open}, {discard, wait}, {discard, lockout}}},
    /* E5  */ {{{discard, lockout, set_lockout}, {discard, lockout, set_lockout}, {discard, lockout}}},
    /* E6  */ {{{expedited, open, count_b}, {expedited, wait, count_b}, {expedited, lockout, count_b}}},
    /* E7  */
    {{{control, open, count_b | clear_retransmit},
      {control, open, count_b | clear_retransmit | clear_wait},
      {control, open, count_b | clear_retransmit | clear_wait | clear_lockout}}},
    /* E8  */
    {{{control, open, count_b | clear_retransmit | take_vr},
      {control, open, count_b | clear_retransmit | clear_wait | take_vr},
      {control, lockout, count_b}}},
    /* E9  */ {{{discard, open}, {discard, wait}, {discard, lockout}}},
    /* E10 */ {{{no_frame, open}, {no_frame, open, clear_wait}, {no_frame, lockout, clear_wait}}},
}};

}  // namespace

FarmEvent classify(const FarmState& state, const TcFrame& frame, bool buffer_available, std::uint8_t window) {
  assert(window >= 2 && window <= 254 && window % 2 == 0);
  if (frame.type == TcFrameType::bd) return FarmEvent::e6_expedited;
  if (frame.type == TcFrameType::bc) {
    const auto command = decode_control_command(frame.data);
    if (!command) return FarmEvent::e9_invalid;
    return command->kind == ControlCommand::Kind::unlock ? FarmEvent::e7_unlock : FarmEvent::e8_set_vr;
  }
  const auto ahead = static_cast<std::uint8_t>(frame.sequence - state.vr);   // N(S) - V(R)
  const auto behind = static_cast<std::uint8_t>(state.vr - frame.sequence);  // V(R) - N(S)
  if (ahead == 0) return buffer_available ? FarmEvent::e1_in_sequence : FarmEvent::e2_in_sequence_no_buffer;
  if (ahead <= window / 2 - 1) return FarmEvent::e3_in_positive_window;
  if (behind <= window / 2) return FarmEvent::e4_in_negative_window;
  return FarmEvent::e5_outside_window;
}

FarmOutcome farm_step(const FarmState& state, FarmEvent event, std::uint8_t set_vr) {
  const Cell& cell = table[static_cast<std::size_t>(event)][static_cast<std::size_t>(state.mode)];
  FarmOutcome outcome{.state = state, .verdict = cell.verdict};
  FarmState& next = outcome.state;
  next.mode = cell.next;
  if ((cell.actions & count_vr) != 0) ++next.vr;
  if ((cell.actions & take_vr) != 0) next.vr = set_vr;
  if ((cell.actions & count_b) != 0) ++next.farm_b_counter;
  if ((cell.actions & set_retransmit) != 0) next.retransmit = true;
  if ((cell.actions & clear_retransmit) != 0) next.retransmit = false;
  if ((cell.actions & set_wait) != 0) next.wait = true;
  if ((cell.actions & clear_wait) != 0) next.wait = false;
  if ((cell.actions & set_lockout) != 0) next.lockout = true;
  if ((cell.actions & clear_lockout) != 0) next.lockout = false;
  return outcome;
}

FarmOutcome farm_receive(const FarmState& state, const TcFrame& frame, bool buffer_available,
                         std::uint8_t window) {
  const FarmEvent event = classify(state, frame, buffer_available, window);
  std::uint8_t set_vr = 0;
  if (event == FarmEvent::e8_set_vr) set_vr = decode_control_command(frame.data)->vr;
  return farm_step(state, event, set_vr);
}

Clcw make_clcw(const FarmState& state, std::uint8_t vc) {
  return {.vc = vc,
          .lockout = state.lockout,
          .wait = state.wait,
          .retransmit = state.retransmit,
          .farm_b_counter = static_cast<std::uint8_t>(state.farm_b_counter & 3),
          .report_value = state.vr};
}

std::uint32_t encode_clcw(const Clcw& clcw) {
  assert(clcw.status <= 7 && clcw.vc <= tc_vc_max && clcw.farm_b_counter <= 3);
  constexpr std::uint32_t cop1 = 1U << 24;
  const auto flag = [](bool set, unsigned bit) { return set ? std::uint32_t{1} << bit : 0U; };
  return cop1 | static_cast<std::uint32_t>(clcw.status) << 26 | static_cast<std::uint32_t>(clcw.vc) << 18 |
         flag(clcw.no_rf_available, 15) | flag(clcw.no_bit_lock, 14) | flag(clcw.lockout, 13) |
         flag(clcw.wait, 12) | flag(clcw.retransmit, 11) |
         static_cast<std::uint32_t>(clcw.farm_b_counter) << 9 | clcw.report_value;
}

Result<Clcw, ClcwError> decode_clcw(std::uint32_t word) {
  if (word >> 29 != 0) return Err(ClcwError::not_a_clcw);
  if ((word >> 24 & 3) != 1) return Err(ClcwError::not_cop1);
  constexpr std::uint32_t reserved = 3U << 16 | 1U << 8;
  if ((word & reserved) != 0) return Err(ClcwError::reserved_bits);
  const auto flag = [word](unsigned bit) { return (word >> bit & 1) != 0; };
  return Clcw{.status = static_cast<std::uint8_t>(word >> 26 & 7),
              .vc = static_cast<std::uint8_t>(word >> 18 & 0x3F),
              .no_rf_available = flag(15),
              .no_bit_lock = flag(14),
              .lockout = flag(13),
              .wait = flag(12),
              .retransmit = flag(11),
              .farm_b_counter = static_cast<std::uint8_t>(word >> 9 & 3),
              .report_value = static_cast<std::uint8_t>(word & 0xFF)};
}

}  // namespace srfs::wire
