// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <deque>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "hw/can_bus.hpp"
#include "hw/fake/readiness.hpp"

namespace srfs::hw {

/// An in-memory CAN bus for tests: what was sent lies open, what shall be received is put in.
class FakeCanBus : public CanBus {
 public:
  [[nodiscard]] int fd() const override { return readiness_.fd(); }
  [[nodiscard]] Result<void, CanError> send(const CanFrame& frame) override {
    if (refuse_with) {
      if (*refuse_with == CanError::queue_full) ++counters_.refused_full;
      return Err(*refuse_with);
    }
    ++counters_.sent;
    sent.push_back(frame);
    if (auto_echo) {
      echo(frame, frame.timestamp);
    } else {
      ++unconfirmed_;
    }
    return {};
  }
  [[nodiscard]] std::optional<CanFrame> receive() override {
    if (incoming_.empty()) return std::nullopt;
    const CanFrame frame = incoming_.front();
    incoming_.pop_front();
    if (incoming_.empty()) readiness_.clear();
    ++(frame.is_echo ? counters_.echoed : counters_.received);
    return frame;
  }
  [[nodiscard]] std::size_t unconfirmed() const override { return unconfirmed_; }
  bool withdraw() override {
    if (!can_withdraw) return false;
    ++counters_.withdrawals;
    counters_.lost_in_queue += std::exchange(unconfirmed_, 0);
    return true;
  }
  [[nodiscard]] CanController controller() const override {
    return {.state = bus_state, .transmit_errors = {}, .receive_errors = {}, .bit_rate = {}};
  }
  [[nodiscard]] std::string reason() const override {
    return bus_state == CanBusState::gone || bus_state == CanBusState::down ? "fake" : "";
  }
  [[nodiscard]] const CanCounters& counters() const override { return counters_; }

  /// A frame of another station.
  void deliver(CanFrame frame) {
    frame.is_echo = false;
    push(frame);
  }
  /// The oldest unconfirmed frame leaves on the bus; needs auto_echo off.
  void confirm_oldest(MonotonicTime at) {
    if (unconfirmed_ == 0) return;
    const CanFrame frame = sent[sent.size() - unconfirmed_];
    --unconfirmed_;
    echo(frame, at);
  }

  std::vector<CanFrame> sent;
  bool auto_echo = true;                ///< each frame is on the bus at once
  std::optional<CanError> refuse_with;  ///< what send() answers instead
  bool can_withdraw = true;
  CanBusState bus_state = CanBusState::active;

 private:
  void echo(CanFrame frame, MonotonicTime at) {
    frame.is_echo = true;
    frame.timestamp = at;
    push(frame);
  }
  void push(const CanFrame& frame) {
    incoming_.push_back(frame);
    readiness_.set();
  }

  Readiness readiness_;
  std::deque<CanFrame> incoming_;
  std::size_t unconfirmed_ = 0;
  CanCounters counters_;
};

}  // namespace srfs::hw
