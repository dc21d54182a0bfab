// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "nodes/ttc/report/event_reporter.hpp"

#include <algorithm>

namespace srfs {

void EventReporter::execute(const Telecommand& telecommand, MonotonicTime /*now*/) {
  constexpr std::uint8_t enable = 5;
  constexpr std::uint8_t report = 7;
  if (telecommand.command->subtype == report) return report_disabled(telecommand.origin);
  OctetReader reader(telecommand.arguments);
  const unsigned count = reader.u16();
  for (unsigned i = 0; i < count; ++i) {
    const std::uint16_t event = reader.u16();
    if (set_enabled(event, telecommand.command->subtype == enable)) continue;
    report_queue_.failure(telecommand.origin, Stage::start, mission::failure::unknown_identifier,
                          octets_of_u16(event));
    return;
  }
  report_queue_.done(telecommand.origin);
}

void EventReporter::report_disabled(const TelecommandOrigin& origin) {
  constexpr std::uint8_t disabled_report = 8;
  report_queue_.success(origin, Stage::start);
  for (const auto& [id, event] : events_) {
    if (event.enabled) continue;
    mission::EventDisabled report;
    report.events = 1;
    report.event = id;
    report_queue_.put(Report{.apid = origin.apid,
                             .service = service_type,
                             .subtype = disabled_report,
                             .destination_id = origin.source_id,
                             .data = report.encoded(),
                             .stored = false});
  }
  report_queue_.success(origin, Stage::completion);
}

void EventReporter::add_event(std::uint16_t event_id, bool enabled) {
  events_[event_id] =
      Event{.enabled = enabled, .essential = false, .tokens = 0, .refilled = {}, .seen = false};
}

void EventReporter::add_essential_event(std::uint16_t event_id) {
  add_event(event_id);
  events_[event_id].essential = true;
}

std::optional<Report> EventReporter::on_event(std::uint16_t apid, std::uint16_t event_id,
                                              std::uint8_t severity, OctetView data, MonotonicTime now) {
  if (!takes(event_id, severity)) {
    ++counters_.unknown;
    return std::nullopt;
  }
  const auto found = events_.find(event_id);
  if (!found->second.essential && !take_token(found->second, now)) {
    ++counters_.suppressed;
    return std::nullopt;
  }
  const bool live = found->second.enabled;
  ++(live ? counters_.reported : counters_.disabled);
  OctetWriter writer;
  writer.u16(event_id);
  writer.bytes(data);
  return Report{
      .apid = apid, .service = service_type, .subtype = severity, .data = writer.take(), .live = live};
}

bool EventReporter::takes(std::uint16_t event_id, std::uint8_t severity) const {
  return events_.contains(event_id) && severity >= static_cast<std::uint8_t>(mission::EventSeverity::info) &&
         severity <= static_cast<std::uint8_t>(mission::EventSeverity::high);
}

bool EventReporter::set_enabled(std::uint16_t event_id, bool enabled) {
  const auto found = events_.find(event_id);
  if (found == events_.end() || (found->second.essential && !enabled)) return false;
  found->second.enabled = enabled;
  return true;
}

bool EventReporter::take_token(Event& event, MonotonicTime now) const {
  if (!event.seen) {
    event.seen = true;
    event.tokens = limit_.burst;
    event.refilled = now;
  }
  const std::int64_t refills = (now - event.refilled) / nanoseconds(limit_.refill);
  if (refills > 0) {
    event.tokens = static_cast<std::uint32_t>(std::min<std::int64_t>(limit_.burst, event.tokens + refills));
    event.refilled += refills * nanoseconds(limit_.refill);
  }
  if (event.tokens == 0) return false;
  --event.tokens;
  return true;
}

}  // namespace srfs
