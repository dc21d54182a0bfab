// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <optional>

#include "nodes/ttc/services/pus_service.hpp"
#include "wire/time_packet.hpp"

namespace srfs {

/// PUS service 9, time (ECSS-E-ST-70-41C 6.9): a time report every 2^rate frames of the live channel. Pure.
class TimeReporter final : public PusService {
 public:
  static constexpr std::uint8_t service_type = 9;
  static constexpr std::uint8_t rate_max = 8;

  explicit TimeReporter(ReportQueue& report_queue) : report_queue_(report_queue) {}

  [[nodiscard]] bool provides(const mission::Command& command) const override {
    return command.service == service_type;
  }
  void execute(const Telecommand& telecommand, MonotonicTime /*now*/) override {
    set_rate(telecommand.arguments.front());
    report_queue_.done(telecommand.origin);
  }
  void set_rate(std::uint8_t rate) { rate_ = rate; }
  /// @param frames of the live channel made up to now @param now when the last one was made
  /// @return the packet of a report that is due
  [[nodiscard]] std::optional<Octets> on_frames(std::uint64_t frames, TaiTime now) {
    const bool due = frames >> rate_ != frames_ >> rate_;
    frames_ = frames;
    if (!due) return std::nullopt;
    const Octets packet =
        wire::make_time_packet({.sequence_count = sequence_count_, .rate = rate_, .time = now});
    sequence_count_ = static_cast<std::uint16_t>((sequence_count_ + 1) & 0x3FFF);
    return packet;
  }

 private:
  ReportQueue& report_queue_;
  std::uint8_t rate_ = rate_max;
  std::uint64_t frames_ = 0;
  std::uint16_t sequence_count_ = 0;
};

}  // namespace srfs
