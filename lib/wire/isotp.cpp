// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "wire/isotp.hpp"

#include <algorithm>
#include <cassert>
#include <utility>

namespace srfs::wire {
namespace {

// Protocol control information: the type in the high nibble of the first octet (ISO 15765-2:2016, table 9).
constexpr std::uint8_t single_frame = 0x0;
constexpr std::uint8_t first_frame = 0x1;
constexpr std::uint8_t consecutive_frame = 0x2;
constexpr std::uint8_t flow_control = 0x3;

constexpr std::uint8_t continue_to_send = 0;
constexpr std::uint8_t wait = 1;
constexpr std::uint8_t overflow = 2;

constexpr std::size_t single_frame_room = 7;
constexpr std::size_t first_frame_room = 6;
constexpr std::size_t consecutive_frame_room = 7;

constexpr milliseconds refused_retry{1};

}  // namespace

microseconds separation_time(std::uint8_t code) {
  if (code <= 0x7F) return milliseconds(code);
  if (code >= 0xF1 && code <= 0xF9) return microseconds(100 * (code - 0xF0));
  return milliseconds(0x7F);
}

std::uint8_t separation_code(microseconds time) {
  if (time <= microseconds(0)) return 0;
  if (time <= microseconds(900)) return static_cast<std::uint8_t>(0xF0 + (time.count() + 99) / 100);
  return static_cast<std::uint8_t>(std::min<std::int64_t>(0x7F, (time.count() + 999) / 1000));
}

const char* to_string(IsoTpError error) {
  switch (error) {
    case IsoTpError::busy:
      return "busy";
    case IsoTpError::empty_message:
      return "empty message";
    case IsoTpError::message_too_long:
      return "message too long";
    case IsoTpError::timeout_as:
      return "no transmit confirmation in time";
    case IsoTpError::timeout_bs:
      return "no flow control in time";
    case IsoTpError::timeout_cr:
      return "no consecutive frame in time";
    case IsoTpError::wrong_sequence:
      return "wrong sequence number";
    case IsoTpError::invalid_flow_status:
      return "invalid flow status";
    case IsoTpError::unexpected_pdu:
      return "reception cut off by a new message";
    case IsoTpError::wait_limit:
      return "too many wait frames";
    case IsoTpError::peer_overflow:
      return "no room at the peer";
    case IsoTpError::receive_overflow:
      return "no room for the message";
    case IsoTpError::aborted:
      return "aborted";
  }
  return "?";
}

IsoTpChannel::IsoTpChannel(IsoTpAddress outgoing, IsoTpSettings settings)
    : settings_(settings),
      transmit_id_(normal_fixed_id(outgoing)),
      receive_id_(normal_fixed_id({.target = outgoing.source, .source = outgoing.target})) {
  assert(settings_.receive_queue >= 1 && settings_.receive_queue <= 4);
  assert(settings_.frames_ahead >= 1 && settings_.frames_ahead <= isotp_most_ahead);
  assert(settings_.separation >= microseconds(0) && settings_.separation <= milliseconds(127));
  outgoing_.octets.resize(isotp_max_message);
  messages_.resize(settings_.receive_queue + 1);  // one more: the message that is being received
  for (Message& message : messages_) message.octets.resize(isotp_max_message);
}

// --- time

void IsoTpChannel::advance(MonotonicTime now) {
  now_ = std::max(now_, now);
  if (!settings_.await_confirmation && !hand_out_again_) {
    while (in_flight_ > 0) frame_left(0);
  }
}

void IsoTpChannel::expire() {
  while (in_flight_ > 0 && now_ >= confirm_deadline_) {
    ++counters_.timeouts_as;
    if (flying_[0].kind == FrameKind::message_frame) {
      forget_message_frames();
      finish_send(Err(IsoTpError::timeout_as));
    } else {
      drop_flying(0);
      if (receive_state_ == ReceiveState::clear_to_send_flies || receive_state_ == ReceiveState::wait_flies)
        fail_reception(IsoTpError::timeout_as);
    }
  }

  if (send_state_ == SendState::await_flow_control && now_ >= flow_control_deadline_) {
    ++counters_.timeouts_bs;
    finish_send(Err(IsoTpError::timeout_bs));
  }
  if (receive_state_ == ReceiveState::await_consecutive && now_ >= receive_deadline_) {
    ++counters_.timeouts_cr;
    fail_reception(IsoTpError::timeout_cr);
  }
  if (receive_state_ == ReceiveState::await_room && now_ >= receive_deadline_) decide_flow_control();
}

std::optional<MonotonicTime> IsoTpChannel::next_deadline() const {
  std::optional<MonotonicTime> earliest;
  const auto consider = [&earliest](MonotonicTime t) {
    if (!earliest || t < *earliest) earliest = t;
  };
  if (in_flight_ > 0) {
    consider(confirm_deadline_);
    if (!settings_.await_confirmation && !hand_out_again_) consider(now_);
  }
  if (hand_out_again_) {
    consider(*hand_out_again_);
  } else {
    if (flow_status_ && flying(FrameKind::flow_control) == 0) consider(now_);
    if (room_for_message_frame()) consider(next_frame_at_);
  }
  if (send_state_ == SendState::await_flow_control) consider(flow_control_deadline_);
  if (receive_state_ == ReceiveState::await_consecutive || receive_state_ == ReceiveState::await_room) {
    consider(receive_deadline_);
  }
  return earliest;
}

// --- sending

Result<void, IsoTpError> IsoTpChannel::send(OctetView message, MonotonicTime now) {
  advance(now);
  expire();
  if (message.empty()) return Err(IsoTpError::empty_message);
  if (message.size() > isotp_max_message) return Err(IsoTpError::message_too_long);
  if (sending() || send_result_) return Err(IsoTpError::busy);
  std::copy(message.begin(), message.end(), outgoing_.octets.begin());
  outgoing_.size = message.size();
  sent_ = 0;
  waits_received_ = 0;
  send_state_ = SendState::first;
  next_frame_at_ = now_;
  return {};
}

std::optional<Result<void, IsoTpError>> IsoTpChannel::take_send_result() {
  return std::exchange(send_result_, std::nullopt);
}

void IsoTpChannel::finish_send(Result<void, IsoTpError> result) {
  send_state_ = SendState::idle;
  last_handed_out_ = false;
  if (result) ++counters_.messages_sent;
  send_result_ = result;
}

bool IsoTpChannel::room_for_message_frame() const {
  if (send_state_ != SendState::first && send_state_ != SendState::consecutive) return false;
  const std::size_t most = peer_separation_ == microseconds(0) ? settings_.frames_ahead : 1;
  return !last_handed_out_ && flying(FrameKind::message_frame) < most;
}

CanDataFrame IsoTpChannel::padded() const {
  CanDataFrame frame{.id = transmit_id_, .size = 8};
  frame.data.fill(settings_.padding);
  return frame;
}

CanDataFrame IsoTpChannel::next_message_frame() {
  CanDataFrame frame = padded();
  std::size_t header = 1;
  std::size_t room = single_frame_room;
  if (send_state_ == SendState::consecutive) {
    frame.data[0] = static_cast<std::uint8_t>(consecutive_frame << 4U | send_sequence_);
    send_sequence_ = (send_sequence_ + 1U) & 0x0FU;
    room = consecutive_frame_room;
  } else if (outgoing_.size <= single_frame_room) {
    frame.data[0] = static_cast<std::uint8_t>(single_frame << 4U | outgoing_.size);
  } else {
    frame.data[0] = static_cast<std::uint8_t>(first_frame << 4U | outgoing_.size >> 8U);
    frame.data[1] = static_cast<std::uint8_t>(outgoing_.size);
    header = 2;
    room = first_frame_room;
    send_sequence_ = 1;
  }
  const std::size_t n = std::min(room, outgoing_.size - sent_);
  std::copy_n(outgoing_.octets.begin() + static_cast<std::ptrdiff_t>(sent_), n,
              frame.data.begin() + static_cast<std::ptrdiff_t>(header));
  sent_ += n;
  const bool ends_block = send_state_ == SendState::consecutive && !block_unlimited_ && --block_left_ == 0;
  last_handed_out_ = send_state_ == SendState::first || ends_block || sent_ == outgoing_.size;
  return frame;
}

void IsoTpChannel::message_frame_left() {
  if (flying(FrameKind::message_frame) > 0) return;
  if (!last_handed_out_) {
    next_frame_at_ = now_ + peer_separation_;
  } else if (sent_ == outgoing_.size) {
    finish_send({});
  } else {
    last_handed_out_ = false;
    send_state_ = SendState::await_flow_control;
    waits_received_ = 0;
    flow_control_deadline_ = now_ + settings_.n_bs;
  }
}

// --- frames out

std::size_t IsoTpChannel::flying(FrameKind kind) const {
  const auto end = flying_.begin() + static_cast<std::ptrdiff_t>(in_flight_);
  return static_cast<std::size_t>(
      std::count_if(flying_.begin(), end, [kind](const Flying& f) { return f.kind == kind; }));
}

void IsoTpChannel::drop_flying(std::size_t index) {
  assert(index < in_flight_);
  if (index + 1 == in_flight_) hand_out_again_.reset();
  const auto at = flying_.begin() + static_cast<std::ptrdiff_t>(index);
  std::move(at + 1, flying_.begin() + static_cast<std::ptrdiff_t>(in_flight_), at);
  --in_flight_;
  if (index == 0) confirm_deadline_ = now_ + settings_.n_as;
}

void IsoTpChannel::forget_message_frames() {
  for (std::size_t i = in_flight_; i-- > 0;) {
    if (flying_[i].kind == FrameKind::message_frame) drop_flying(i);
  }
}

CanDataFrame IsoTpChannel::hand_out(const CanDataFrame& frame, FrameKind kind) {
  assert(in_flight_ < flying_.size());
  if (in_flight_ == 0) confirm_deadline_ = now_ + settings_.n_as;
  flying_[in_flight_++] = {.frame = frame, .kind = kind};
  ++counters_.frames_sent;
  return frame;
}

std::optional<CanDataFrame> IsoTpChannel::poll(MonotonicTime now) {
  advance(now);
  expire();
  if (hand_out_again_) {
    if (now < *hand_out_again_) return std::nullopt;
    hand_out_again_.reset();
    ++counters_.frames_sent;
    return flying_[in_flight_ - 1].frame;
  }
  if (flow_status_ && flying(FrameKind::flow_control) == 0)
    return hand_out(next_flow_control_frame(), FrameKind::flow_control);
  if (room_for_message_frame() && now_ >= next_frame_at_)
    return hand_out(next_message_frame(), FrameKind::message_frame);
  return std::nullopt;
}

void IsoTpChannel::on_transmit_refused(MonotonicTime now) {
  now_ = std::max(now_, now);
  if (in_flight_ == 0 || hand_out_again_) return;
  --counters_.frames_sent;
  hand_out_again_ = now_ + refused_retry;
  expire();
}

void IsoTpChannel::on_transmit_confirm(const CanDataFrame& frame, MonotonicTime now) {
  if (frame.id != transmit_id_) return;
  advance(now);
  const std::size_t handed_out = in_flight_ - (hand_out_again_ ? 1 : 0);
  for (std::size_t i = 0; i < handed_out; ++i) {
    if (flying_[i].frame != frame) continue;
    if (hand_out_again_) hand_out_again_ = now_;  // the driver has room again
    frame_left(i);
    return;
  }
  ++counters_.stray_confirmations;
}

void IsoTpChannel::frame_left(std::size_t index) {
  const FrameKind kind = flying_[index].kind;
  drop_flying(index);
  if (kind == FrameKind::message_frame) message_frame_left();
  if (kind == FrameKind::flow_control) flow_control_left();
}

// --- receiving

void IsoTpChannel::on_frame(const CanDataFrame& frame, MonotonicTime now) {
  if (frame.id != receive_id_) return;
  advance(now);
  ++counters_.frames_received;
  if (frame.size == 0 || frame.size > frame.data.size()) {
    ++counters_.malformed_pdus;
    return;
  }
  switch (frame.data[0] >> 4U) {
    case single_frame:
      on_single_frame(frame.view());
      break;
    case first_frame:
      on_first_frame(frame.view());
      break;
    case consecutive_frame:
      on_consecutive_frame(frame.view());
      break;
    case flow_control:
      on_flow_control(frame.view());
      break;
    default:
      ++counters_.malformed_pdus;
      break;  // reserved types are ignored (9.8.3)
  }
}

IsoTpChannel::Message& IsoTpChannel::tail() {
  return messages_[(first_ + queued_) % messages_.size()];
}

void IsoTpChannel::cut_off_reception() {
  if (receive_state_ == ReceiveState::idle) return;
  ++counters_.unexpected_pdus;
  fail_reception(IsoTpError::unexpected_pdu);
}

void IsoTpChannel::fail_reception(IsoTpError error) {
  receive_state_ = ReceiveState::idle;
  flow_status_.reset();
  receive_error_ = error;
}

void IsoTpChannel::on_single_frame(OctetView frame) {
  const std::size_t length = frame[0] & 0x0FU;
  if (length == 0 || length > single_frame_room || frame.size() < 1 + length) {
    ++counters_.malformed_pdus;
    return;
  }
  cut_off_reception();
  if (queued_ == settings_.receive_queue) {
    ++counters_.receive_overflows;
    receive_error_ = IsoTpError::receive_overflow;
    return;
  }
  Message& message = tail();
  std::copy_n(frame.begin() + 1, length, message.octets.begin());
  message.size = length;
  complete_reception();
}

void IsoTpChannel::on_first_frame(OctetView frame) {
  if (frame.size() != 8) {
    ++counters_.malformed_pdus;
    return;
  }
  const std::size_t length = (frame[0] & 0x0FU) << 8U | frame[1];
  if (length != 0 && length <= single_frame_room) {
    ++counters_.malformed_pdus;
    return;
  }
  cut_off_reception();
  if (length == 0) {  // 32-bit length: above what we can take (9.6.3.2)
    ++counters_.receive_overflows;
    receive_error_ = IsoTpError::receive_overflow;
    flow_status_ = overflow;
    return;
  }
  Message& message = tail();
  message.size = length;
  std::copy_n(frame.begin() + 2, first_frame_room, message.octets.begin());
  filled_ = first_frame_room;
  receive_sequence_ = 1;
  received_in_block_ = 0;
  waits_sent_ = 0;
  decide_flow_control();
}

// Room decides: go on, wait (as long as the settings allow), or overflow.
void IsoTpChannel::decide_flow_control() {
  if (queued_ < settings_.receive_queue) {
    receive_state_ = ReceiveState::flow_control_due;
    flow_status_ = continue_to_send;
  } else if (waits_sent_ < settings_.wait_frames_when_full) {
    ++waits_sent_;
    receive_state_ = ReceiveState::flow_control_due;
    flow_status_ = wait;
  } else {
    ++counters_.receive_overflows;
    fail_reception(IsoTpError::receive_overflow);
    flow_status_ = overflow;
  }
}

CanDataFrame IsoTpChannel::next_flow_control_frame() {
  const std::uint8_t status = *std::exchange(flow_status_, std::nullopt);
  if (status == continue_to_send) receive_state_ = ReceiveState::clear_to_send_flies;
  if (status == wait) receive_state_ = ReceiveState::wait_flies;
  CanDataFrame frame = padded();
  frame.data[0] = static_cast<std::uint8_t>(flow_control << 4U | status);
  frame.data[1] = settings_.block_size;
  frame.data[2] = separation_code(settings_.separation);
  return frame;
}

// In any other state the reception it belonged to has gone on or is over.
void IsoTpChannel::flow_control_left() {
  if (receive_state_ == ReceiveState::clear_to_send_flies) {
    receive_state_ = ReceiveState::await_consecutive;
    receive_deadline_ = now_ + settings_.n_cr;
  } else if (receive_state_ == ReceiveState::wait_flies) {
    receive_state_ = ReceiveState::await_room;
    receive_deadline_ = now_ + settings_.wait_interval;
  }
}

void IsoTpChannel::on_consecutive_frame(OctetView frame) {
  // The peer may answer our flow control before we learn that it has left.
  const bool expected = receive_state_ == ReceiveState::await_consecutive ||
                        receive_state_ == ReceiveState::clear_to_send_flies;
  if (!expected) {
    ++counters_.ignored_pdus;
    return;
  }
  Message& message = tail();
  const std::size_t n = std::min(consecutive_frame_room, message.size - filled_);
  if (frame.size() < 1 + n) {
    ++counters_.malformed_pdus;
    return;
  }
  if ((frame[0] & 0x0FU) != receive_sequence_) {
    ++counters_.wrong_sequences;
    fail_reception(IsoTpError::wrong_sequence);
    return;
  }
  receive_sequence_ = (receive_sequence_ + 1U) & 0x0FU;
  std::copy_n(frame.begin() + 1, n, message.octets.begin() + static_cast<std::ptrdiff_t>(filled_));
  filled_ += n;
  if (filled_ == message.size) {
    complete_reception();
    return;
  }
  receive_state_ = ReceiveState::await_consecutive;
  receive_deadline_ = now_ + settings_.n_cr;
  ++received_in_block_;
  if (settings_.block_size != 0 && received_in_block_ == settings_.block_size) {
    received_in_block_ = 0;
    receive_state_ = ReceiveState::flow_control_due;
    flow_status_ = continue_to_send;
  }
}

void IsoTpChannel::complete_reception() {
  receive_state_ = ReceiveState::idle;
  ++queued_;
  ++counters_.messages_received;
}

// All that the peer waits for to answer by flow control is in the hands of the driver.
bool IsoTpChannel::may_be_answered() const {
  if (!last_handed_out_ || sent_ == outgoing_.size) return false;
  return !hand_out_again_ || flying_[in_flight_ - 1].kind != FrameKind::message_frame;
}

void IsoTpChannel::on_flow_control(OctetView frame) {
  if (frame.size() < 3) {
    ++counters_.malformed_pdus;
    return;
  }
  // The peer may answer the first frame or the end of a block before we learn that it has left.
  if (may_be_answered()) {
    forget_message_frames();
    message_frame_left();
  }
  if (send_state_ != SendState::await_flow_control) {
    ++counters_.ignored_pdus;
    return;
  }
  switch (frame[0] & 0x0FU) {
    case continue_to_send:
      block_unlimited_ = frame[1] == 0;
      block_left_ = frame[1];
      peer_separation_ = separation_time(frame[2]);
      send_state_ = SendState::consecutive;
      next_frame_at_ = now_;
      break;
    case wait:
      if (++waits_received_ > settings_.max_wait_frames) {
        ++counters_.wait_limits;
        finish_send(Err(IsoTpError::wait_limit));
      } else {
        flow_control_deadline_ = now_ + settings_.n_bs;
      }
      break;
    case overflow:
      ++counters_.peer_overflows;
      finish_send(Err(IsoTpError::peer_overflow));
      break;
    default:
      ++counters_.invalid_flow_statuses;
      finish_send(Err(IsoTpError::invalid_flow_status));
      break;
  }
}

OctetView IsoTpChannel::front_message() const {
  if (queued_ == 0) return {};
  const Message& message = messages_[first_];
  return {message.octets.data(), message.size};
}

void IsoTpChannel::pop_message() {
  if (queued_ == 0) return;
  first_ = (first_ + 1) % messages_.size();
  --queued_;
}

std::optional<IsoTpError> IsoTpChannel::take_receive_error() {
  return std::exchange(receive_error_, std::nullopt);
}

void IsoTpChannel::abort() {
  if (sending()) {
    ++counters_.aborts;
    finish_send(Err(IsoTpError::aborted));
  }
  if (receiving()) {
    ++counters_.aborts;
    fail_reception(IsoTpError::aborted);
  }
  in_flight_ = 0;
  hand_out_again_.reset();
  flow_status_.reset();
}

}  // namespace srfs::wire
