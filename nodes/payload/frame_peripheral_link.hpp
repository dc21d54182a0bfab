// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <deque>
#include <memory>
#include <optional>
#include <vector>

#include "nodes/payload/frame_protocol.hpp"
#include "nodes/payload/peripheral_link.hpp"

namespace srfs {

/// A peripheral with a protocol of its own (FrameProtocol). Frames of a request leave in order, as fast as
/// the driver takes them.
class FramePeripheralLink final : public PeripheralLink {
 public:
  static constexpr std::size_t frames_max = 64;  ///< that wait to leave; a request with more is not sent
  static constexpr nanoseconds offered_again = milliseconds(1);

  explicit FramePeripheralLink(std::unique_ptr<FrameProtocol> protocol);

  [[nodiscard]] std::vector<wire::CanIdentifierPair> identifiers() const override { return identifiers_; }
  void request(const Body& body, MonotonicTime now) override;
  void abort() override;
  void on_frame(const wire::CanDataFrame& frame, MonotonicTime now) override;
  void on_transmit_confirm(const wire::CanDataFrame& frame, MonotonicTime now) override;
  void on_transmit_refused(MonotonicTime now) override;
  [[nodiscard]] std::optional<wire::CanDataFrame> poll(MonotonicTime now) override;
  [[nodiscard]] std::optional<MonotonicTime> next_deadline() const override;
  [[nodiscard]] std::optional<Outcome> take_outcome() override;
  [[nodiscard]] Counters counters() const override { return counters_; }

 private:
  void send(FrameProtocol::Frames frames);
  void end(Outcome outcome);
  [[nodiscard]] bool is_answer(const wire::CanDataFrame& frame) const;
  [[nodiscard]] bool is_request(const wire::CanDataFrame& frame) const;

  std::unique_ptr<FrameProtocol> protocol_;
  std::vector<wire::CanIdentifierPair> identifiers_;
  std::optional<Body> under_way_;
  std::deque<wire::CanDataFrame> waiting_;
  std::optional<wire::CanDataFrame> handed_out_;
  std::optional<MonotonicTime> not_before_;
  std::optional<Outcome> outcome_;
  Counters counters_;
};

}  // namespace srfs
