// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "nodes/maintenance/fault_line.hpp"

#include <algorithm>

namespace srfs {
namespace {

constexpr std::uint32_t unknown_ms = UINT32_MAX;
constexpr std::size_t longest_name = 32;
constexpr std::size_t longest_text = 60;

std::uint32_t as_ms(const std::optional<nanoseconds>& duration) {
  if (!duration) return unknown_ms;
  return static_cast<std::uint32_t>(std::clamp<std::int64_t>(*duration / milliseconds(1), 0, unknown_ms - 1));
}

}  // namespace

mission::RingFaultHousekeeping to_mission(const suite::FaultRecord& record) {
  mission::RingFaultHousekeeping line;
  line.sequence = record.sequence;
  line.recovered = record.kind == suite::FaultRecord::Kind::active;
  line.utc_s = static_cast<std::uint64_t>(std::max<std::int64_t>(record.utc.ns() / 1'000'000'000, 0));
  line.observer = record.observer.substr(0, longest_name);
  line.node = record.subject.substr(0, longest_name);
  line.fault = static_cast<mission::NodeFault>(record.fault);
  line.misses = static_cast<std::uint16_t>(std::min<std::uint32_t>(record.misses, UINT16_MAX));
  line.outcome =
      line.recovered ? mission::RestartOutcome::none : static_cast<mission::RestartOutcome>(record.outcome);
  line.old_incarnation = record.old_incarnation;
  line.new_incarnation = record.new_incarnation;
  line.judged_ms = as_ms(record.judged);
  line.killed_ms = as_ms(record.killed);
  line.started_ms = as_ms(record.started);
  line.active_ms = as_ms(record.active);
  line.cause = (record.cause.empty() ? record.reason : record.cause).substr(0, longest_text);
  line.detail = record.detail.substr(0, longest_text);
  return line;
}

}  // namespace srfs
