// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "hw_sim/peripheral_endpoint.hpp"

#include <algorithm>

namespace srfs::sim {
namespace {

wire::CanDataFrame without_meta(const hw::CanFrame& frame) {
  return {.id = frame.id, .extended = frame.extended, .size = frame.size, .data = frame.data};
}

/// The transport's time-outs are in running time, too; it knows one clock only.
MonotonicTime transport(RunningTime t) {
  return MonotonicTime(t.since_epoch());
}

}  // namespace

PeripheralEndpoint::PeripheralEndpoint(std::uint8_t address, hw::CanBus& bus,
                                       std::unique_ptr<PeripheralChannel> channel, Peripheral& peripheral)
    : bus_(bus), channel_(std::move(channel)), peripheral_(peripheral), random_(address) {}

void PeripheralEndpoint::receive(RunningTime now) {
  while (const auto frame = bus_.receive()) {
    if (frame->is_echo) {
      channel_->on_transmit_confirm(without_meta(*frame), transport(now));
    } else if (peripheral_.listening(now)) {
      channel_->on_frame(without_meta(*frame), transport(now));
    }
  }
  while (const auto request = channel_->take_request()) peripheral_.on_request(*request, now);
}

void PeripheralEndpoint::transmit(RunningTime now) {
  while (auto answer = peripheral_.poll(now)) answers_.push_back(std::move(*answer));
  if (!peripheral_.listening(now)) {
    channel_->abort();
    answers_.clear();
    return;
  }
  // A new answer means that the computer has given up waiting for the one before. To go on waiting for its
  // flow control would make every later answer late as well.
  while (answers_.size() > 1) answers_.pop_front();
  if (!answers_.empty() && channel_->sending()) channel_->abort();
  if (!answers_.empty() && !channel_->sending() && channel_->send(answers_.front(), transport(now)))
    answers_.pop_front();
  while (const auto frame = channel_->poll(transport(now))) {
    if (!bus_.send(
            {.id = frame->id, .extended = frame->extended, .size = frame->size, .data = frame->data})) {
      channel_->on_transmit_refused(transport(now));
      break;
    }
  }
}

void PeripheralEndpoint::babble(RunningTime now) {
  constexpr std::size_t frames_waiting = 4;
  if (peripheral_.fault() != PeripheralFault::babble || !peripheral_.listening(now) || now < next_babble_)
    return;
  // It looks like unsolicited answers: single frames on its own identifier with random content.
  const wire::CanIdentifierPair own = channel_->identifiers().front();
  while (bus_.unconfirmed() < frames_waiting) {
    hw::CanFrame frame{.id = own.answer, .extended = own.extended, .size = 8};
    frame.data[0] = 0x07;
    for (std::size_t i = 1; i < frame.data.size(); ++i)
      frame.data[i] = static_cast<std::uint8_t>(random_() >> 8U);
    if (!bus_.send(frame)) break;
    ++babbled_;
    if (peripheral_.fault_delay() > milliseconds(0)) break;
  }
  next_babble_ = now + std::max<nanoseconds>(peripheral_.fault_delay(), microseconds(500));
}

std::optional<RunningTime> PeripheralEndpoint::next_deadline(RunningTime now) const {
  std::optional<RunningTime> next;
  const auto also = [&next](std::optional<RunningTime> at) {
    if (at && (!next || *at < *next)) next = at;
  };
  if (const auto at = channel_->next_deadline()) also(RunningTime(at->since_epoch()));
  also(peripheral_.next_deadline());
  if (peripheral_.fault() == PeripheralFault::babble && peripheral_.powered()) also(next_babble_);
  // Whatever is due and could not be done (a full bus) is tried again soon, not at once.
  if (next && *next <= now) next = now + microseconds(200);
  return next;
}

void PeripheralEndpoint::service(RunningTime now) {
  receive(now);
  transmit(now);
  babble(now);
}

}  // namespace srfs::sim
