// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "nodes/ttc/services/schedule_service.hpp"

#include <algorithm>
#include <set>

#include <mission/structures.hpp>

#include "wire/cuc.hpp"

namespace srfs {
namespace {

// Requests and reports of service 11 (ECSS-E-ST-70-41C 8.11.2).
enum Subtype : std::uint8_t {
  enable = 1,
  disable = 2,
  reset_schedule = 3,
  insert_activities = 4,
  delete_by_request = 5,
  delete_by_filter = 6,
  shift_by_request = 7,
  shift_by_filter = 8,
  detail_by_request = 9,
  detail_report = 10,
  detail_by_filter = 11,
  summary_by_request = 12,
  summary_report = 13,
  summary_by_filter = 14,
  shift_all = 15,
  detail_all = 16,
  summary_all = 17,
  create_groups = 22,
  delete_groups = 23,
  enable_groups = 24,
  disable_groups = 25,
  report_group_status = 26,
  group_status_report = 27,
};

/// CUC holds seconds of 32 bits.
constexpr seconds link_time_end{std::int64_t{1} << 32};

/// @return the packet whose header stands next, empty if it is not whole
OctetView read_packet(OctetReader& reader) {
  OctetReader ahead = reader;
  const OctetView header = ahead.bytes(wire::packet_header_octets);
  if (!ahead.ok()) return reader.bytes(reader.remaining() + 1);
  return reader.bytes(wire::packet_octets(header));
}

ScheduledRequestId read_request(OctetReader& reader) {
  ScheduledRequestId request;
  request.source = reader.u16();
  request.apid = reader.u16();
  request.sequence = reader.u16();
  return request;
}

void write_request(OctetWriter& writer, const ScheduledRequestId& request) {
  writer.u16(request.source);
  writer.u16(request.apid);
  writer.u16(request.sequence);
}

TelecommandOrigin origin_of(const ScheduledActivity& activity) {
  TelecommandOrigin origin;
  origin.request = wire::peek_request_id(activity.packet).value_or(wire::RequestId{});
  origin.apid = activity.request.apid;
  origin.source_id = activity.request.source;
  return origin;
}

bool is_insertion(const wire::TcPacket& packet) {
  return packet.service == ScheduleService::service_type && packet.subtype == Subtype::insert_activities;
}

bool is_report(std::uint8_t subtype) {
  switch (subtype) {
    case Subtype::detail_by_request:
    case Subtype::detail_by_filter:
    case Subtype::detail_all:
    case Subtype::summary_by_request:
    case Subtype::summary_by_filter:
    case Subtype::summary_all:
      return true;
    default:
      return false;
  }
}

}  // namespace

// ---- requests

std::optional<Refusal> ScheduleService::why_refused(const Telecommand& telecommand) const {
  if (telecommand.command->subtype != Subtype::insert_activities) return std::nullopt;
  OctetReader reader(telecommand.arguments);
  const unsigned count = reader.u16();
  for (unsigned number = 1; number <= count; ++number) {
    reader.u8();
    reader.bytes(wire::cuc_octets);
    const OctetView packet = read_packet(reader);
    std::optional<RequestError> error = request_check_(packet);
    const auto parsed = wire::parse_tc_packet(packet);
    if (!error && parsed && is_insertion(*parsed))
      error = {mission::failure::not_schedulable, std::uint8_t{0}};
    if (!error) continue;
    OctetWriter parameter;
    parameter.u8(static_cast<std::uint8_t>(number));
    parameter.u16(error->first);
    parameter.u8(error->second);
    return Refusal{mission::failure::scheduled_request_refused, parameter.take()};
  }
  return std::nullopt;
}

bool ScheduleService::restore(const Telecommand& telecommand, const TelecommandProgress& progress,
                              MonotonicTime /*now*/) {
  if (!journal_.schedule().has_applied(telecommand.origin.id)) return false;
  if (!progress.started) report_queue_.success(telecommand.origin, Stage::start);
  report_queue_.success(telecommand.origin, Stage::completion);
  return true;
}

void ScheduleService::execute(const Telecommand& telecommand, MonotonicTime /*now*/) {
  const TelecommandOrigin& origin = telecommand.origin;
  const std::uint8_t subtype = telecommand.command->subtype;
  OctetReader reader(telecommand.arguments);
  if (is_report(subtype)) {
    const auto selected = selection_asked_for(subtype, reader);
    if (!selected) return fail(origin, selected.error());
    report_queue_.success(origin, Stage::start);
    report(origin, *selected,
           subtype == Subtype::detail_by_request || subtype == Subtype::detail_by_filter ||
               subtype == Subtype::detail_all);
    return report_queue_.success(origin, Stage::completion);
  }
  if (subtype == Subtype::report_group_status) {
    report_queue_.success(origin, Stage::start);
    report_groups(origin);
    return report_queue_.success(origin, Stage::completion);
  }
  auto change = change_asked_for(subtype, reader);
  if (!change) return fail(origin, change.error());
  report_queue_.success(origin, Stage::start);
  if (change->empty()) return report_queue_.success(origin, Stage::completion);
  change->requested_by = origin.id;
  counters_.inserted += static_cast<std::uint32_t>(change->inserted.size());
  held_.push_back({.revision = journal_.change_schedule(*change), .origin = origin, .refusal = 0});
}

Result<ScheduleService::Selected, ScheduleService::Failure> ScheduleService::selection_asked_for(
    std::uint8_t subtype, OctetReader& reader) const {
  switch (subtype) {
    case Subtype::delete_by_request:
    case Subtype::shift_by_request:
    case Subtype::detail_by_request:
    case Subtype::summary_by_request:
      return select_by_request(reader);
    case Subtype::delete_by_filter:
    case Subtype::shift_by_filter:
    case Subtype::detail_by_filter:
    case Subtype::summary_by_filter:
      return select_by_filter(reader);
    default:
      return schedule().in_order();
  }
}

Result<ScheduleChange, ScheduleService::Failure> ScheduleService::change_asked_for(
    std::uint8_t subtype, OctetReader& reader) const {
  ScheduleChange change;
  switch (subtype) {
    case Subtype::enable:
    case Subtype::disable:
      change.enabled = subtype == Subtype::enable;
      return change;
    case Subtype::reset_schedule:
      return reset();
    case Subtype::insert_activities:
      return insert(reader);
    case Subtype::delete_by_request:
    case Subtype::delete_by_filter: {
      const auto selected = selection_asked_for(subtype, reader);
      return selected ? remove(*selected) : Err(selected.error());
    }
    case Subtype::shift_by_request:
    case Subtype::shift_by_filter:
    case Subtype::shift_all: {
      const seconds offset(static_cast<std::int32_t>(reader.u32()));
      const auto selected = selection_asked_for(subtype, reader);
      return selected ? shift(*selected, offset) : Err(selected.error());
    }
    default:
      return change_groups(subtype, reader);
  }
}

ScheduleChange ScheduleService::reset() const {
  ScheduleChange change;
  change.enabled = false;
  for (const auto& [id, activity] : schedule().activities()) change.removed.push_back(id);
  for (const auto& [group, enabled] : schedule().groups())
    change.groups.emplace_back(group, ScheduleChange::GroupState::enabled);
  return change;
}

Result<ScheduleChange, ScheduleService::Failure> ScheduleService::insert(OctetReader& reader) const {
  ScheduleChange change;
  const unsigned count = reader.u16();
  std::size_t octets = schedule().octets();
  const auto is_there = [&](const ScheduledRequestId& request) {
    const auto same = [&](const ScheduledActivity& a) { return a.request == request; };
    return std::any_of(change.inserted.begin(), change.inserted.end(), same) ||
           std::any_of(schedule().activities().begin(), schedule().activities().end(),
                       [&](const auto& entry) { return same(entry.second); });
  };
  for (unsigned number = 1; number <= count; ++number) {
    ScheduledActivity activity;
    activity.id = schedule().next_id() + number - 1;
    activity.group = reader.u8();
    activity.release = read_cuc(reader);
    const OctetView packet = read_packet(reader);
    const auto parsed = wire::parse_tc_packet(packet);
    if (!reader.ok() || !parsed) return Err(Failure{mission::failure::scheduled_request_refused, {}});
    activity.request = scheduled_request_id(*parsed);
    activity.packet.assign(packet.begin(), packet.end());
    octets += packet.size();
    if (activity.group != 0 && !schedule().groups().contains(activity.group))
      return Err(Failure{mission::failure::unknown_identifier, octets_of_u16(activity.group)});
    if (time_valid_ && activity.release <= now_) return Err(Failure{mission::failure::release_time_past, {}});
    if (is_there(activity.request))
      return Err(Failure{mission::failure::already_there, octets_of_u16(static_cast<std::uint16_t>(number))});
    change.inserted.push_back(std::move(activity));
  }
  const bool fits = schedule().activities().size() + change.inserted.size() <= TimeSchedule::max_activities &&
                    octets <= TimeSchedule::max_octets;
  if (!fits) return Err(Failure{mission::failure::schedule_full, {}});
  return change;
}

Result<ScheduleChange, ScheduleService::Failure> ScheduleService::remove(const Selected& selected) const {
  ScheduleChange change;
  for (const ScheduledActivity* activity : selected) change.removed.push_back(activity->id);
  return change;
}

Result<ScheduleChange, ScheduleService::Failure> ScheduleService::shift(const Selected& selected,
                                                                        seconds offset) const {
  ScheduleChange change;
  for (const ScheduledActivity* activity : selected) {
    const TaiTime release = activity->release + offset;
    const bool past = time_valid_ && release <= now_;
    if (past || !fits_the_link(release)) return Err(Failure{mission::failure::release_time_past, {}});
    change.moved.emplace_back(activity->id, release);
  }
  return change;
}

bool ScheduleService::fits_the_link(TaiTime release) const {
  return release.since_epoch() >= seconds(0) && release.since_epoch() < link_time_end;
}

Result<ScheduleChange, ScheduleService::Failure> ScheduleService::change_groups(std::uint8_t subtype,
                                                                                OctetReader& reader) const {
  using GroupState = ScheduleChange::GroupState;
  const TimeSchedule::Groups& known = schedule().groups();
  ScheduleChange change;
  const unsigned count = reader.u16();
  if (subtype == Subtype::create_groups) {
    std::set<std::uint8_t> created;
    for (unsigned i = 0; i < count; ++i) {
      const std::uint8_t group = reader.u8();
      const GroupState state = reader.u8() == 0 ? GroupState::disabled : GroupState::enabled;
      if (known.contains(group) || !created.insert(group).second)
        return Err(Failure{mission::failure::already_there, octets_of_u16(group)});
      change.groups.emplace_back(group, state);
    }
    if (known.size() + created.size() > TimeSchedule::max_groups)
      return Err(Failure{mission::failure::schedule_full, {}});
    return change;
  }
  std::set<std::uint8_t> named;
  for (unsigned i = 0; i < count; ++i) named.insert(reader.u8());
  if (count == 0) {
    for (const auto& [group, enabled] : known) named.insert(group);
  }
  for (const std::uint8_t group : named) {
    if (!known.contains(group))
      return Err(Failure{mission::failure::unknown_identifier, octets_of_u16(group)});
    if (subtype != Subtype::delete_groups) {
      change.groups.emplace_back(
          group, subtype == Subtype::enable_groups ? GroupState::enabled : GroupState::disabled);
      continue;
    }
    const bool in_use =
        std::any_of(schedule().activities().begin(), schedule().activities().end(),
                    [group = group](const auto& entry) { return entry.second.group == group; });
    if (in_use) return Err(Failure{mission::failure::group_in_use, octets_of_u16(group)});
    change.groups.emplace_back(group, GroupState::deleted);
  }
  return change;
}

Result<ScheduleService::Selected, ScheduleService::Failure> ScheduleService::select_by_request(
    OctetReader& reader) const {
  Selected selected;
  const unsigned count = reader.u16();
  for (unsigned i = 0; i < count; ++i) {
    const ScheduledRequestId request = read_request(reader);
    const auto found = std::find_if(schedule().activities().begin(), schedule().activities().end(),
                                    [&](const auto& entry) { return entry.second.request == request; });
    if (found == schedule().activities().end())
      return Err(Failure{mission::failure::unknown_identifier, octets_of_u16(request.sequence)});
    const ScheduledActivity* activity = &found->second;
    if (std::find(selected.begin(), selected.end(), activity) == selected.end()) selected.push_back(activity);
  }
  return selected;
}

Result<ScheduleService::Selected, ScheduleService::Failure> ScheduleService::select_by_filter(
    OctetReader& reader) const {
  reader.u8();  // from ... to: the dictionary has no other type
  const TaiTime from = read_cuc(reader);
  const TaiTime to = read_cuc(reader);
  if (to < from) return Err(Failure{mission::failure::bad_time_range, {}});
  std::set<std::uint8_t> groups;
  for (unsigned count = reader.u16(); count > 0 && reader.ok(); --count) groups.insert(reader.u8());
  for (const std::uint8_t group : groups) {
    if (group != 0 && !schedule().groups().contains(group))
      return Err(Failure{mission::failure::unknown_identifier, octets_of_u16(group)});
  }
  Selected selected = schedule().in_order();
  std::erase_if(selected, [&](const ScheduledActivity* a) {
    return a->release < from || a->release > to || (!groups.empty() && !groups.contains(a->group));
  });
  return selected;
}

void ScheduleService::report(const TelecommandOrigin& origin, const Selected& selected, bool detail) {
  std::size_t next = 0;
  do {
    OctetWriter entries(report_octets - 2);
    std::uint16_t count = 0;
    for (; next < selected.size(); ++next, ++count) {
      const ScheduledActivity& activity = *selected[next];
      OctetWriter entry;
      entry.u8(activity.group);
      entry.bytes(wire::encode_cuc(activity.release));
      if (detail) {
        entry.bytes(activity.packet);
      } else {
        write_request(entry, activity.request);
      }
      if (entries.size() + entry.size() > report_octets - 2) break;
      entries.bytes(entry.view());
    }
    OctetWriter data;
    data.u16(count);
    data.bytes(entries.view());
    report_queue_.put(Report{.apid = origin.apid,
                             .service = service_type,
                             .subtype = detail ? Subtype::detail_report : Subtype::summary_report,
                             .destination_id = origin.source_id,
                             .data = data.take()});
  } while (next < selected.size());
}

void ScheduleService::report_groups(const TelecommandOrigin& origin) {
  OctetWriter data;
  data.u16(static_cast<std::uint16_t>(schedule().groups().size()));
  for (const auto& [group, enabled] : schedule().groups()) {
    data.u8(group);
    data.u8(enabled ? 1 : 0);
  }
  report_queue_.put(Report{.apid = origin.apid,
                           .service = service_type,
                           .subtype = Subtype::group_status_report,
                           .destination_id = origin.source_id,
                           .data = data.take()});
}

void ScheduleService::fail(const TelecommandOrigin& origin, const Failure& failure) {
  report_queue_.failure(origin, Stage::start, failure.code, failure.parameter);
}

void ScheduleService::on_written(std::uint64_t revision, bool success) {
  while (!held_.empty() && held_.front().revision <= revision) {
    const Held held = held_.front();
    held_.pop_front();
    if (held.refusal != 0) {
      report_queue_.failure(held.origin, Stage::acceptance, held.refusal);
    } else if (success) {
      report_queue_.success(held.origin, Stage::completion);
    } else {  // it holds until the end of the process, and is written when the disk works again
      report_queue_.failure(held.origin, Stage::completion, mission::failure::storage_unavailable);
    }
  }
}

// ---- release

void ScheduleService::drop_overdue() {
  if (!time_valid_) return;
  ScheduleChange change;
  std::vector<Held> held;
  for (const ScheduledActivity* activity : schedule().in_order()) {
    if (activity->release > now_) break;
    const bool disabled = !schedule().enabled(*activity);
    if (!disabled && now_ - activity->release <= late_max_) continue;
    change.removed.push_back(activity->id);
    held.push_back({.revision = 0,
                    .origin = origin_of(*activity),
                    .refusal = disabled ? mission::failure::schedule_disabled : mission::failure::expired});
    mission::ScheduleActivityDroppedEvent event;
    event.apid = activity->request.apid;
    event.sequence = activity->request.sequence;
    event.release = activity->release;
    event.reason = disabled ? mission::ScheduleDrop::disabled : mission::ScheduleDrop::late;
    dropped_.push_back(event);
    ++(disabled ? counters_.disabled : counters_.late);
  }
  if (change.empty()) return;
  const std::uint64_t revision = journal_.change_schedule(change);
  for (Held& one : held) {
    one.revision = revision;
    held_.push_back(one);
  }
}

const ScheduledActivity* ScheduleService::due() const {
  if (!time_valid_ || !held_.empty()) return nullptr;
  const ScheduledActivity* next = schedule().next_enabled();
  return next != nullptr && next->release <= now_ ? next : nullptr;
}

void ScheduleService::on_refused(const ScheduledActivity& activity) {
  ++counters_.refused;
  ScheduleChange change;
  change.removed.push_back(activity.id);
  journal_.change_schedule(change);
}

std::optional<nanoseconds> ScheduleService::next_due_in() const {
  if (!time_valid_ || !held_.empty() || schedule().empty()) return std::nullopt;
  TaiTime first(nanoseconds::max());
  for (const auto& [id, activity] : schedule().activities()) first = std::min(first, activity.release);
  return std::max(first - now_, nanoseconds(0));
}

std::optional<ScheduleService::Next> ScheduleService::next() const {
  const ScheduledActivity* activity = schedule().next_enabled();
  if (activity == nullptr) return std::nullopt;
  Next next{.activity = activity, .in = std::nullopt};
  if (time_valid_) next.in = std::max(activity->release - now_, nanoseconds(0));
  return next;
}

}  // namespace srfs
