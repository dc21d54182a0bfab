// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <vector>

#include "base/octets.hpp"
#include "base/result.hpp"
#include "base/time.hpp"
#include "wire/can_data_frame.hpp"

namespace srfs::wire {

/// Longest message of ISO 15765-2 with a 12-bit length, octets.
inline constexpr std::size_t isotp_max_message = 4095;

/// Bound of IsoTpSettings::frames_ahead.
inline constexpr std::size_t isotp_most_ahead = 32;

/// The two ends of a 29-bit normal fixed identifier (ISO 15765-2:2016, 10.3.3.2, physical addressing).
struct IsoTpAddress {
  std::uint8_t target = 0;  ///< the receiver
  std::uint8_t source = 0;  ///< the sender
  friend constexpr bool operator==(IsoTpAddress, IsoTpAddress) = default;
};

/// 0x18DA<target><source>: priority 6, PF 218.
[[nodiscard]] constexpr std::uint32_t normal_fixed_id(IsoTpAddress a) {
  return 0x18DA0000U | std::uint32_t{a.target} << 8U | a.source;
}
/// The addresses in a 29-bit identifier; nullopt when it is not of the form 0x18DAxxxx.
[[nodiscard]] constexpr std::optional<IsoTpAddress> parse_normal_fixed_id(std::uint32_t id) {
  if ((id & 0xFFFF0000U) != 0x18DA0000U) return std::nullopt;
  return IsoTpAddress{.target = static_cast<std::uint8_t>(id >> 8U), .source = static_cast<std::uint8_t>(id)};
}

/// Separation time of a flow control frame (9.6.5.4): 0x00-0x7F are ms, 0xF1-0xF9 are 100-900 us. A reserved
/// code means the longest time, 127 ms.
[[nodiscard]] microseconds separation_time(std::uint8_t code);
/// The code of the shortest representable time that is not below @p time; above 127 ms it is 127 ms.
[[nodiscard]] std::uint8_t separation_code(microseconds time);

/// Timing and flow control of one channel. The standard's own limit is 1000 ms for each time-out; these
/// defaults are shorter, so that a silent peer is noticed within a bus slot.
struct IsoTpSettings {
  std::uint8_t block_size = 0;  ///< asked of the peer: consecutive frames per flow control, 0 = all
  microseconds separation{0};   ///< STmin asked of the peer, 0-127 ms
  /// Frame handed out, or the one before confirmed if that is later -> transmit confirmation (N_As and N_Ar).
  milliseconds n_as{25};
  milliseconds n_bs{40};                   ///< first frame or block sent -> flow control received
  milliseconds n_cr{40};                   ///< flow control sent or frame received -> next consecutive frame
  std::uint8_t max_wait_frames = 8;        ///< FC.WAIT in a row accepted from the peer (N_WFTmax)
  std::uint8_t wait_frames_when_full = 0;  ///< FC.WAIT sent while the receive queue is full, before FC.OVFLW
  milliseconds wait_interval{20};          ///< between those (N_Br); shorter than the peer's N_Bs
  std::uint8_t padding = 0xCC;
  std::size_t receive_queue = 2;  ///< complete messages kept until taken, 1-4
  /// true: a frame has left when on_transmit_confirm() says so. false: a frame counts as sent when poll()
  /// returns it (buses without echo).
  bool await_confirmation = true;
  /// Frames of a message handed out and not yet confirmed, 1-isotp_most_ahead. They bridge the time from an
  /// echo to the next frame, so that the bus need not wait for this process. At 500 kbit/s the default takes
  /// at most 4.8 ms, less than a payload at the end of its slot waits before it withdraws its frames. Where
  /// the peer asks for a separation time, which counts from the end of a frame, it is one.
  std::size_t frames_ahead = 15;
};

enum class IsoTpError : std::uint8_t {
  busy,                 ///< send: the message before is not finished, or its result not taken
  empty_message,        ///< send: a message has at least one octet
  message_too_long,     ///< send: above 4095 octets
  timeout_as,           ///< no transmit confirmation in time (N_TIMEOUT_A)
  timeout_bs,           ///< no flow control in time (N_TIMEOUT_Bs)
  timeout_cr,           ///< no consecutive frame in time (N_TIMEOUT_Cr)
  wrong_sequence,       ///< consecutive frame out of order (N_WRONG_SN)
  invalid_flow_status,  ///< flow control with a reserved status (N_INVALID_FS)
  unexpected_pdu,       ///< reception cut off by a new single or first frame (N_UNEXP_PDU)
  wait_limit,           ///< the peer, or we, asked to wait too often (N_WFT_OVRN)
  peer_overflow,        ///< the peer has no room for the message (N_BUFFER_OVFLW)
  receive_overflow,     ///< a message came and we had no room, or it was above 4095 octets
  aborted,              ///< abort() was called
};
[[nodiscard]] const char* to_string(IsoTpError error);

/// What happened on a channel since its construction; no dropped input without a counter.
struct IsoTpCounters {
  std::uint64_t frames_sent = 0;      ///< handed out by poll()
  std::uint64_t frames_received = 0;  ///< with the identifier of this channel
  std::uint64_t messages_sent = 0;
  std::uint64_t messages_received = 0;
  std::uint64_t timeouts_as = 0;
  std::uint64_t timeouts_bs = 0;
  std::uint64_t timeouts_cr = 0;
  std::uint64_t wrong_sequences = 0;
  std::uint64_t invalid_flow_statuses = 0;
  std::uint64_t unexpected_pdus = 0;  ///< receptions cut off
  std::uint64_t ignored_pdus = 0;     ///< well-formed, but not awaited (9.8.3)
  std::uint64_t malformed_pdus = 0;   ///< unknown type, impossible or missing length
  std::uint64_t wait_limits = 0;
  std::uint64_t peer_overflows = 0;
  std::uint64_t receive_overflows = 0;
  std::uint64_t aborts = 0;
  std::uint64_t stray_confirmations = 0;  ///< of a frame that is not in flight (late, or foreign)
};

/// Both directions of ISO 15765-2:2016 over classic CAN between this computer and one peer (full duplex).
/// Pure: time is an argument, frames go in by on_frame() and out by poll(). All buffers are made by the
/// constructor.
///
/// Use: after every call and at next_deadline(), call poll() until it gives nothing. `now` never goes back;
/// an earlier `now` (a frame's receive stamp read late) counts as the latest one seen.
class IsoTpChannel {
 public:
  /// @param outgoing  target = the peer, source = we; frames of the peer carry the two exchanged
  IsoTpChannel(IsoTpAddress outgoing, IsoTpSettings settings);

  /// Starts the transfer of a copy of @p message (1-4095 octets). Its end comes through take_send_result().
  [[nodiscard]] Result<void, IsoTpError> send(OctetView message, MonotonicTime now);
  /// true from an accepted send() until its result stands.
  [[nodiscard]] bool sending() const { return send_state_ != SendState::idle; }
  /// The end of the last send(), once. Success: every frame has left (confirmed when confirmations are
  /// awaited); it is not an acknowledgement by the peer's application.
  [[nodiscard]] std::optional<Result<void, IsoTpError>> take_send_result();

  /// A frame from the bus. Frames with another identifier are ignored, uncounted: they belong to other
  /// channels. Time-outs are for the other calls: a frame that is here is not late, but who reads it may be.
  void on_frame(const CanDataFrame& frame, MonotonicTime now);
  /// The echo of an own frame: it has left on the bus.
  void on_transmit_confirm(const CanDataFrame& frame, MonotonicTime now);
  /// The driver refused the frame that poll() gave last (queue full): poll() gives it again 1 ms later or
  /// after the next confirmation, within N_As, and none before it.
  void on_transmit_refused(MonotonicTime now);
  /// Runs the time-outs, then gives the next frame to put on the bus, if one is due. Flow control goes first.
  [[nodiscard]] std::optional<CanDataFrame> poll(MonotonicTime now);
  /// When poll() has to be called at the latest; not after the last `now` when a frame is due already.
  /// nullopt: idle.
  [[nodiscard]] std::optional<MonotonicTime> next_deadline() const;

  /// Oldest complete message, empty when there is none. Valid until pop_message().
  [[nodiscard]] OctetView front_message() const;
  void pop_message();
  [[nodiscard]] std::size_t messages_waiting() const { return queued_; }
  [[nodiscard]] bool receiving() const { return receive_state_ != ReceiveState::idle; }
  /// Why the last reception failed, once; the newest replaces one that was not taken.
  [[nodiscard]] std::optional<IsoTpError> take_receive_error();

  /// Forgets both transfers at once and silently (the bus is not ours any more). Complete messages stay.
  void abort();

  [[nodiscard]] const IsoTpCounters& counters() const { return counters_; }
  [[nodiscard]] std::uint32_t transmit_id() const { return transmit_id_; }
  [[nodiscard]] std::uint32_t receive_id() const { return receive_id_; }

 private:
  enum class SendState : std::uint8_t { idle, first, await_flow_control, consecutive };
  enum class ReceiveState : std::uint8_t {
    idle,
    flow_control_due,     // flow_status_ says which
    clear_to_send_flies,  // handed out, not yet confirmed
    wait_flies,
    await_room,
    await_consecutive,
  };
  enum class FrameKind : std::uint8_t { message_frame, flow_control };
  struct Flying {
    CanDataFrame frame;
    FrameKind kind = FrameKind::message_frame;
  };
  struct Message {
    std::size_t size = 0;
    std::vector<std::uint8_t> octets;  // isotp_max_message long from the start
  };

  void advance(MonotonicTime now);
  void expire();
  void on_single_frame(OctetView frame);
  void on_first_frame(OctetView frame);
  void on_consecutive_frame(OctetView frame);
  void on_flow_control(OctetView frame);
  void cut_off_reception();
  void finish_send(Result<void, IsoTpError> result);
  void fail_reception(IsoTpError error);
  void message_frame_left();
  void flow_control_left();
  void frame_left(std::size_t index);
  [[nodiscard]] bool may_be_answered() const;
  [[nodiscard]] std::size_t flying(FrameKind kind) const;
  void forget_message_frames();
  void drop_flying(std::size_t index);
  CanDataFrame hand_out(const CanDataFrame& frame, FrameKind kind);
  [[nodiscard]] bool room_for_message_frame() const;
  [[nodiscard]] CanDataFrame next_message_frame();
  [[nodiscard]] CanDataFrame next_flow_control_frame();
  [[nodiscard]] CanDataFrame padded() const;
  [[nodiscard]] Message& tail();
  void complete_reception();
  void decide_flow_control();

  IsoTpSettings settings_;
  std::uint32_t transmit_id_;
  std::uint32_t receive_id_;
  MonotonicTime now_;
  IsoTpCounters counters_;

  // Handed out and not confirmed, oldest first: frames_ahead of the message, one flow control.
  std::array<Flying, isotp_most_ahead + 1> flying_;
  std::size_t in_flight_ = 0;
  MonotonicTime confirm_deadline_;               // of the oldest
  std::optional<MonotonicTime> hand_out_again_;  // the newest was refused by the driver

  SendState send_state_ = SendState::idle;
  Message outgoing_;
  std::size_t sent_ = 0;
  std::uint8_t send_sequence_ = 0;
  std::uint8_t block_left_ = 0;   // frames to hand out until the next flow control; 0 with block_unlimited_
  bool last_handed_out_ = false;  // of the message, or before the next flow control
  bool block_unlimited_ = false;
  microseconds peer_separation_{0};
  std::uint8_t waits_received_ = 0;
  MonotonicTime next_frame_at_;
  MonotonicTime flow_control_deadline_;
  std::optional<Result<void, IsoTpError>> send_result_;

  ReceiveState receive_state_ = ReceiveState::idle;
  std::vector<Message> messages_;  // ring; the slot behind the last queued one is being filled
  std::size_t first_ = 0;
  std::size_t queued_ = 0;
  std::size_t filled_ = 0;
  std::uint8_t receive_sequence_ = 0;
  std::uint8_t received_in_block_ = 0;
  std::uint8_t waits_sent_ = 0;
  std::optional<std::uint8_t> flow_status_;  // of a flow control frame that is to be handed out
  MonotonicTime receive_deadline_;
  std::optional<IsoTpError> receive_error_;
};

}  // namespace srfs::wire
