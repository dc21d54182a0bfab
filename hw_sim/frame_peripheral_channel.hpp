// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <deque>
#include <memory>
#include <optional>
#include <variant>
#include <vector>

#include "hw_sim/peripheral_channel.hpp"
#include "wire/peripheral_protocol.hpp"

namespace srfs::sim {

/// The peripheral's side of a protocol of plain frames (srfs::FrameProtocol is the computer's). A mission's
/// model makes it by PeripheralModel::make_frames(). Pure.
class PeripheralFrames {
 public:
  using Request = decltype(wire::PeripheralRequest::body);

  virtual ~PeripheralFrames() = default;
  [[nodiscard]] virtual std::vector<wire::CanIdentifierPair> identifiers() const = 0;
  /// A frame of the computer. @return the request, when it is complete
  [[nodiscard]] virtual std::optional<Request> hear(const wire::CanDataFrame& frame) = 0;
  /// The frames of an answer; empty: the peripheral does not answer this.
  [[nodiscard]] virtual std::vector<wire::CanDataFrame> say(const wire::PeripheralResponse& answer) = 0;
};

/// Carries PeripheralFrames. An answer that a fault has damaged leaves as one frame of its first eight
/// octets.
class FramePeripheralChannel final : public PeripheralChannel {
 public:
  explicit FramePeripheralChannel(std::unique_ptr<PeripheralFrames> frames) : frames_(std::move(frames)) {}

  [[nodiscard]] std::vector<wire::CanIdentifierPair> identifiers() const override {
    return frames_->identifiers();
  }
  void on_frame(const wire::CanDataFrame& frame, MonotonicTime now) override;
  void on_transmit_confirm(const wire::CanDataFrame& /*frame*/, MonotonicTime /*now*/) override {}
  void on_transmit_refused(MonotonicTime now) override;
  [[nodiscard]] std::optional<Octets> take_request() override;
  [[nodiscard]] bool sending() const override { return !waiting_.empty(); }
  bool send(OctetView answer, MonotonicTime now) override;
  void abort() override { waiting_.clear(); }
  [[nodiscard]] std::optional<wire::CanDataFrame> poll(MonotonicTime now) override;
  [[nodiscard]] std::optional<MonotonicTime> next_deadline() const override;
  [[nodiscard]] Counters counters() const override { return counters_; }

 private:
  static constexpr nanoseconds offered_again = milliseconds(1);
  static constexpr std::size_t requests_max = 4;

  std::unique_ptr<PeripheralFrames> frames_;
  std::deque<Octets> requests_;  // the oldest makes room
  std::uint8_t sequence_ = 0;
  std::uint32_t commands_ = 0;  // the computer gives telecommands no number here
  std::deque<wire::CanDataFrame> waiting_;
  std::optional<wire::CanDataFrame> handed_out_;
  std::optional<MonotonicTime> not_before_;
  Counters counters_;
};

}  // namespace srfs::sim
