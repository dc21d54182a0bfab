// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
// On-board monitoring and event-action in TtcCore: from samples to transitions, from events to telecommands.
#include <algorithm>

#include <fmt/format.h>

#include "nodes/ttc/ttc_core.hpp"

namespace srfs {

// ---- monitoring

void TtcCore::monitor(std::uint16_t structure_id, OctetView data) {
  monitoring_.monitoring().on_sample(structure_id, data, clock_.tai_at(now_), now_);
  report_transitions();
}

void TtcCore::report_transitions() {
  const auto transitions = monitoring_.monitoring().take_transitions();
  for (const Monitoring::Transition& transition : transitions) monitoring_.on_transition(transition, now_);
  for (const Report& report : monitoring_.take_reports(now_)) send(report);
  for (const Monitoring::Transition& transition : transitions) {
    mission::MonitorSoftLimitEvent content;  // all events of monitors have the same
    content.definition = transition.definition;
    content.parameter = transition.parameter;
    content.value = transition.value;
    content.limit = transition.limit;
    send_monitor_event(transition.event, content.encoded());
  }
  for (const auto& failure : monitoring_.monitoring().take_functional_failures()) {
    mission::MonitorFunctionalEvent content;  // the same holds for those of functional monitors
    content.functional = failure.definition;
    content.failing = failure.failing;
    content.monitors = failure.monitors;
    send_monitor_event(failure.event, content.encoded());
  }
}

void TtcCore::send_monitor_event(std::uint16_t id, OctetView content) {
  const mission::Event* event = dictionary_.event(id);
  if (event == nullptr) return;
  if (const auto report = own_event(event->severity, event->id, content)) send(*report);
}

void TtcCore::run_monitoring() {
  monitoring_.monitoring().on_time(clock_.tai_at(now_), now_);
  report_transitions();
  monitoring_.go_on(downlink_.room_octets(DownlinkChannel::live), now_);
}

void TtcCore::send_monitoring_housekeeping(MonotonicTime now) {
  mission::TtcMonitoringHousekeeping h;
  monitoring_.fill(h);
  event_actions_.fill(h);
  send_housekeeping(h, now);
}

// ---- event-action

void TtcCore::run_event_actions() {
  event_actions_.go_on(downlink_.room_octets(DownlinkChannel::live), now_);
  for (const auto& event : event_actions_.drop_overdue(now_)) raise(event);
  // One whose node has no room does not hold up the others.
  for (const EventActionService::Due& due : event_actions_.due(now_)) {
    if (event_actions_.may_release(now_)) static_cast<void>(release_action(due));
  }
  for (const auto& event : event_actions_.take_delayed()) raise(event);
  for (const auto& event : event_actions_.take_unusable()) send_event(event);
}

/// In the form of an activity of the schedule: one record accepts it, and nothing is done before that is on
/// disk.
bool TtcCore::release_action(const EventActionService::Due& due) {
  if (!gate_.has_room() || !journal_.has_room()) return false;
  const auto sequence = static_cast<std::uint16_t>(journal_.next_id() & 0x3FFF);
  const Octets request = EventActionService::request_of(due.packet, sequence);
  if (const auto code = why_no_action(due.packet)) {
    event_actions_.on_forbidden(due.key, *code, now_);
    return true;
  }
  JudgedTelecommand judged = router_.judge(request, now_);
  if (!judged.refusal) {
    report_contradiction(due, judged.telecommand);
    const UplinkedPacket packet{.frame = {}, .packet = request, .link = uplink_.state()};
    judged.telecommand.origin.id = journal_.accept(judged.telecommand, packet, now_);
    event_actions_.on_accepted(due.key, judged.telecommand.origin.id, now_);
  } else if (judged.refusal->code == mission::failure::queue_full) {
    return false;
  } else {
    record_refusal(judged, journal_.link());
    event_actions_.on_refused(due.key, now_);
  }
  gate_.enter(std::move(judged), journal_.revision(), now_);
  return true;
}

/// One whose record did not get on disk is not executed: its action waits again.
void TtcCore::settle_action(const JudgedTelecommand& judged) {
  if (judged.refusal) return;
  const mission::Command& command = *judged.telecommand.command;
  const std::uint64_t id = judged.telecommand.origin.id;
  const auto released = event_actions_.on_passed(id, judged.durable || command.recovery);
  if (!released) return;
  mission::EventActionReleasedEvent event;
  event.event = released->key.event;
  event.apid = released->raised_by;
  event.telecommand = id;
  event.command = command.name;
  raise(event);
}

void TtcCore::report_contradiction(const EventActionService::Due& due, const Telecommand& released) {
  const mission::Command& command = *released.command;
  for (const AcceptedTelecommand* other : journal_.known()) {
    if (other->end) continue;
    const auto packet = wire::parse_tc_packet(other->packet);
    if (!packet || packet->apid != command.apid || packet->service != command.service ||
        packet->subtype != command.subtype)
      continue;
    OctetReader in(packet->application);
    if (command.is_function() && in.u16() != command.function_id) continue;
    const OctetView arguments = in.rest();
    if (std::equal(arguments.begin(), arguments.end(), released.arguments.begin(), released.arguments.end()))
      continue;
    mission::EventActionContradictionEvent event;
    event.event = due.key.event;
    event.apid = due.raised_by;
    event.command = command.name;
    event.telecommand = other->origin.id;
    raise(event);
  }
}

std::optional<std::uint16_t> TtcCore::why_no_action(OctetView packet) const {
  if (const auto error = router_.check_scheduled(packet)) return error->first;
  const auto parsed = wire::parse_tc_packet(packet);
  const bool is_function = parsed && parsed->service == 8;
  const mission::Command* command =
      !parsed       ? nullptr
      : is_function ? dictionary_.function(parsed->apid, OctetReader(parsed->application).u16())
                    : dictionary_.request(parsed->apid, parsed->service, parsed->subtype);
  if (command == nullptr || command->hazardous || event_actions_.provides(*command))
    return mission::failure::none;
  // Nothing on board arms, and what a packet in it does is not judged here.
  const bool carries_packets =
      std::any_of(command->arguments.begin(), command->arguments.end(),
                  [](const mission::Field& argument) { return argument.type == mission::FieldType::packet; });
  const bool allowed = command->name != mission::TtcArm::name && !carries_packets;
  return allowed ? std::nullopt : std::optional<std::uint16_t>(mission::failure::none);
}

// ---- tables that last

void TtcCore::store_tables() {
  if (auto change = monitoring_.take_change(now_))
    act(WriteTable{std::string(MonitoringService::table_name), std::move(*change)});
  if (auto change = event_actions_.take_change(now_))
    act(WriteTable{std::string(EventActionService::table_name), std::move(*change)});
}

void TtcCore::on_table_written(const std::string& name, const TableChange& change, bool stored) {
  if (name == MonitoringService::table_name) return monitoring_.on_stored(change, stored, now_);
  event_actions_.on_stored(change, stored, now_);
}

void TtcCore::report_damaged_tables() {
  for (const std::string_view table : std::exchange(damaged_tables_, {})) {
    log(LogLine::Level::error, fmt::format("the stored {} are damaged: the factory set is used", table));
    mission::MonitorTableDamagedEvent event;
    event.table = table;
    send_event(event);
  }
}

}  // namespace srfs
