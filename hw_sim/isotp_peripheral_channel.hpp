// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <optional>
#include <vector>

#include "hw_sim/peripheral_channel.hpp"
#include "wire/isotp.hpp"

namespace srfs::sim {

/// The transport of docs/reference/icd_can.md: ISO-TP.
class IsoTpPeripheralChannel final : public PeripheralChannel {
 public:
  /// @param address  of the peripheral
  explicit IsoTpPeripheralChannel(std::uint8_t address);

  [[nodiscard]] std::vector<wire::CanIdentifierPair> identifiers() const override;
  void on_frame(const wire::CanDataFrame& frame, MonotonicTime now) override {
    channel_.on_frame(frame, now);
  }
  void on_transmit_confirm(const wire::CanDataFrame& frame, MonotonicTime now) override {
    channel_.on_transmit_confirm(frame, now);
  }
  void on_transmit_refused(MonotonicTime now) override { channel_.on_transmit_refused(now); }
  [[nodiscard]] std::optional<Octets> take_request() override;
  [[nodiscard]] bool sending() const override { return channel_.sending(); }
  bool send(OctetView answer, MonotonicTime now) override { return channel_.send(answer, now).has_value(); }
  void abort() override { channel_.abort(); }
  [[nodiscard]] std::optional<wire::CanDataFrame> poll(MonotonicTime now) override;
  [[nodiscard]] std::optional<MonotonicTime> next_deadline() const override {
    return channel_.next_deadline();
  }
  [[nodiscard]] Counters counters() const override;

 private:
  wire::IsoTpChannel channel_;
};

}  // namespace srfs::sim
