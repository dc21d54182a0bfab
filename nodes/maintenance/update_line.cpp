// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "nodes/maintenance/update_line.hpp"

#include <algorithm>

#include <fmt/format.h>

#include "base/saturate.hpp"

namespace srfs {
namespace {

constexpr std::uint32_t unknown_duration_ms = UINT32_MAX;
constexpr std::size_t longest_file_name = 60;
constexpr std::size_t longest_node_name = 32;
constexpr std::size_t longest_update_reason = 60;

std::uint32_t to_ms(const std::optional<milliseconds>& value) {
  return value ? static_cast<std::uint32_t>(std::clamp<std::int64_t>(value->count(), 0, UINT32_MAX - 1))
               : unknown_duration_ms;
}

}  // namespace

mission::UpdateStatusHousekeeping to_mission(const update::Update& update) {
  mission::UpdateStatusHousekeeping status;
  status.file = update.file.substr(0, longest_file_name);
  status.node = update.node.substr(0, longest_node_name);
  status.counter = update.counter;
  status.step = update.step;
  status.failed_in = update.ended_in;
  status.version = update.version;
  status.octets = static_cast<std::uint32_t>(update.octets);
  status.program_octets = as_u32(update.program_octets);
  status.build_ms = to_ms(update.build);
  status.outage_ms = to_ms(update.outage);
  status.starts = static_cast<std::uint8_t>(std::min<std::uint32_t>(update.starts, UINT8_MAX));
  status.reason = update.reason.substr(0, longest_update_reason);
  return status;
}

UpdateNews news_of(const update::Update& update) {
  using update::UpdateStep;
  const auto& u = update;
  switch (u.step) {
    case UpdateStep::installed:
      return {false,
              fmt::format("{} runs version {} from {}, outage {} ms", u.node, u.version, u.file,
                          u.outage ? u.outage->count() : -1),
              encode_event(mission::UpdateInstalledEvent{
                  .file = u.file,
                  .node = u.node,
                  .version = u.version,
                  .probation_s = static_cast<std::uint32_t>(u.probation.count()),
                  .outage_ms = to_ms(u.outage)})};
    case UpdateStep::candidate:
      return {
          false, fmt::format("version {} of {} from {} is a candidate", u.version, u.node, u.file),
          encode_event(mission::UpdateCandidateEvent{.file = u.file, .node = u.node, .version = u.version})};
    case UpdateStep::failed:
    case UpdateStep::cancelled:
      return {true,
              fmt::format("update of {} from {} {} in {}: {}", u.node, u.file, to_text(u.step),
                          to_text(u.ended_in), u.reason),
              encode_event(mission::UpdateFailedEvent{
                  .file = u.file, .step = u.ended_in, .reason = u.reason.substr(0, longest_update_text)})};
    default:
      return {false, fmt::format("update of {} from {}: {}", u.node, u.file, to_text(u.step)),
              encode_event(mission::UpdateStepEvent{.file = u.file, .step = u.step})};
  }
}

}  // namespace srfs
