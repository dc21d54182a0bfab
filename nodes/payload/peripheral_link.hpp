// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <variant>

#include "base/result.hpp"
#include "base/time.hpp"
#include "nodes/payload/payload_cycle.hpp"
#include "wire/isotp.hpp"
#include "wire/peripheral_protocol.hpp"

namespace srfs {

/// The computer's end of the ISO-TP channel to one peripheral: one request at a time, its answer recognised
/// by the sequence number. Deadlines of a request are the caller's; only the transport's own time-outs run
/// here. Pure.
class PeripheralLink {
 public:
  static constexpr std::uint8_t computer_address = 0x01;

  /// @param address  of the peripheral on the bus (docs/reference/icd_can.md)
  explicit PeripheralLink(std::uint8_t address);

  struct Failure {
    RequestFailure kind = RequestFailure::silent;
    std::string detail;
  };
  using Body = decltype(SendRequest::body);

  /// Starts a request; one under way is forgotten.
  void request(const Body& body, MonotonicTime now);
  /// Forgets the request under way: nothing more is sent, a late answer is only counted.
  void abort();

  void on_frame(const wire::IsoTpFrame& frame, MonotonicTime now) { channel_.on_frame(frame, now); }
  void on_transmit_confirm(const wire::IsoTpFrame& frame, MonotonicTime now) {
    channel_.on_transmit_confirm(frame, now);
  }
  void on_transmit_refused(MonotonicTime now) { channel_.on_transmit_refused(now); }
  [[nodiscard]] std::optional<wire::IsoTpFrame> poll(MonotonicTime now) { return channel_.poll(now); }
  [[nodiscard]] std::optional<MonotonicTime> next_deadline() const { return channel_.next_deadline(); }

  /// The answer to the request under way, or why there will be none; once. After poll().
  [[nodiscard]] std::optional<Result<wire::PeripheralResponse, Failure>> take_outcome();

  [[nodiscard]] std::uint32_t late_answers() const { return late_answers_; }
  [[nodiscard]] const wire::IsoTpCounters& transport() const { return channel_.counters(); }

 private:
  std::optional<Result<wire::PeripheralResponse, Failure>> judge(OctetView message);
  std::optional<Result<wire::PeripheralResponse, Failure>> fail(RequestFailure kind, const char* detail);

  wire::IsoTpChannel channel_;
  std::optional<wire::PeripheralRequest> request_;
  std::uint8_t next_sequence_ = 0;
  std::uint32_t late_answers_ = 0;
};

}  // namespace srfs
