// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <optional>
#include <vector>

#include "nodes/payload/peripheral_link.hpp"
#include "wire/isotp.hpp"

namespace srfs {

/// The protocol of docs/reference/icd_can.md: messages over an ISO-TP channel; an answer is recognised by its
/// sequence number.
class IsoTpPeripheralLink final : public PeripheralLink {
 public:
  static constexpr std::uint8_t computer_address = 0x01;

  /// @param address  of the peripheral on the bus
  explicit IsoTpPeripheralLink(std::uint8_t address);

  [[nodiscard]] std::vector<wire::CanIdentifierPair> identifiers() const override {
    return {{.request = channel_.transmit_id(), .answer = channel_.receive_id()}};
  }
  void request(const Body& body, MonotonicTime now) override;
  void abort() override;
  void on_frame(const wire::CanDataFrame& frame, MonotonicTime now) override {
    channel_.on_frame(frame, now);
  }
  void on_transmit_confirm(const wire::CanDataFrame& frame, MonotonicTime now) override {
    channel_.on_transmit_confirm(frame, now);
  }
  void on_transmit_refused(MonotonicTime now) override { channel_.on_transmit_refused(now); }
  [[nodiscard]] std::optional<wire::CanDataFrame> poll(MonotonicTime now) override {
    return channel_.poll(now);
  }
  [[nodiscard]] std::optional<MonotonicTime> next_deadline() const override {
    return channel_.next_deadline();
  }
  [[nodiscard]] std::optional<Outcome> take_outcome() override;
  [[nodiscard]] Counters counters() const override;

 private:
  std::optional<Outcome> judge(OctetView message);
  std::optional<Outcome> fail(RequestFailure kind, const char* detail);

  wire::IsoTpChannel channel_;
  std::optional<wire::PeripheralRequest> request_;
  std::uint8_t next_sequence_ = 0;
  std::uint32_t late_answers_ = 0;
};

}  // namespace srfs
