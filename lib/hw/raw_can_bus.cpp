// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "hw/raw_can_bus.hpp"

#include <algorithm>
#include <utility>

#include "base/log.hpp"

namespace srfs::hw {

void RawCanBus::start(Reopening::Opener opener) {
  device_.emplace(uri_, std::move(opener));
  wake_for_restart();
}

int RawCanBus::socket() {
  const int fd = device_->device();
  counters_.reopened = device_->reopened();
  if (fd >= 0 && restart_.next_attempt()) {
    const MonotonicTime now = monotonic_now();
    if (restart_.due(now)) {
      restart_.on_attempt(now);
      try_restart(fd);
    }
    wake_for_restart();
  }
  return fd;
}

CanController RawCanBus::controller() const {
  if (present()) return controller_;
  return {
      .state = absent_state(), .transmit_errors = {}, .receive_errors = {}, .bit_rate = controller_.bit_rate};
}

void RawCanBus::opened_with(const CanController& controller) {
  controller_ = controller;
  waking_at_.reset();  // the device's timer is set anew with every opening
  if (controller.state == CanBusState::bus_off) {
    restart_.on_bus_off(monotonic_now());
  } else {
    restart_.on_recovered(monotonic_now());
  }
}

void RawCanBus::on_report(const CanErrorReport& report) {
  const CanBusState before = controller_.state;
  switch (apply(report, controller_, counters_)) {
    case CanTransition::none:
      return;
    case CanTransition::state_changed:
      break;
    case CanTransition::went_bus_off:
      restart_.on_bus_off(monotonic_now());
      if (unconfirmed_ > 0) on_bus_off_with_frames();
      break;
    case CanTransition::restarted:
      // The driver has flushed its echo buffers: those echoes never come.
      drop_unconfirmed();
      restart_.on_recovered(monotonic_now());
      break;
  }
  log::warn("{}: controller {} -> {}", uri_, to_string(before), to_string(controller_.state));
  wake_for_restart();
}

void RawCanBus::wake_for_restart() {
  if (waking_at_ == restart_.next_attempt() || !present()) return;
  waking_at_ = restart_.next_attempt();
  device_->wake_at(waking_at_);
}

Result<can_frame, CanError> RawCanBus::to_raw(const CanFrame& frame) {
  if (frame.size > CAN_MAX_DLEN || frame.id > (frame.extended ? CAN_EFF_MASK : CAN_SFF_MASK))
    return Err(CanError::invalid_frame);
  can_frame raw{};
  raw.can_id = frame.id | (frame.extended ? CAN_EFF_FLAG : 0U) | (frame.remote ? CAN_RTR_FLAG : 0U);
  raw.len = frame.size;
  std::copy_n(frame.data.begin(), frame.size, raw.data);
  return raw;
}

std::optional<CanFrame> RawCanBus::accept(const can_frame& raw, bool is_echo, MonotonicTime at) {
  const bool extended = (raw.can_id & CAN_EFF_FLAG) != 0;
  CanFrame frame{.id = raw.can_id & (extended ? CAN_EFF_MASK : CAN_SFF_MASK),
                 .extended = extended,
                 .remote = (raw.can_id & CAN_RTR_FLAG) != 0,
                 .size = raw.len,
                 .data = {},
                 .is_echo = is_echo,
                 .timestamp = at};
  std::copy_n(raw.data, raw.len, frame.data.begin());
  if (is_echo) {
    ++counters_.echoed;
    if (unconfirmed_ > 0) --unconfirmed_;
    return frame;
  }
  // A kernel's echo filters also let the same identifiers of others pass.
  if (!passes(frame.id, extended, filters_)) return std::nullopt;
  ++counters_.received;
  return frame;
}

void RawCanBus::note_sent() {
  ++counters_.sent;
  ++unconfirmed_;
}

tl::unexpected<CanError> RawCanBus::refuse_full() {
  ++counters_.refused_full;
  return Err(CanError::queue_full);
}

void RawCanBus::lost(std::string why, Reopening::Retry retry) {
  device_->lost(std::move(why), retry);
  drop_unconfirmed();
}

void RawCanBus::on_withdrawn(std::size_t left) {
  if (unconfirmed_ <= left) return;
  counters_.lost_in_queue += unconfirmed_ - left;
  unconfirmed_ = left;
}

}  // namespace srfs::hw
