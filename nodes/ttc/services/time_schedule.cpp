// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "nodes/ttc/services/time_schedule.hpp"

#include <algorithm>
#include <cassert>

namespace srfs {
namespace {

void write_time(OctetWriter& writer, TaiTime time) {
  writer.u64(static_cast<std::uint64_t>(time.ns()));
}

TaiTime read_time(OctetReader& reader) {
  return TaiTime(nanoseconds(static_cast<std::int64_t>(reader.u64())));
}

void write_activity(OctetWriter& writer, const ScheduledActivity& activity) {
  writer.u64(activity.id);
  writer.u8(activity.group);
  write_time(writer, activity.release);
  writer.u16(activity.request.source);
  writer.u16(activity.request.apid);
  writer.u16(activity.request.sequence);
  writer.u16(static_cast<std::uint16_t>(activity.packet.size()));
  writer.bytes(activity.packet);
}

ScheduledActivity read_activity(OctetReader& reader) {
  ScheduledActivity activity;
  activity.id = reader.u64();
  activity.group = reader.u8();
  activity.release = read_time(reader);
  activity.request.source = reader.u16();
  activity.request.apid = reader.u16();
  activity.request.sequence = reader.u16();
  const OctetView packet = reader.bytes(reader.u16());
  activity.packet.assign(packet.begin(), packet.end());
  return activity;
}

/// What the link can say: CUC holds seconds of 32 bits.
bool is_release_time(TaiTime time) {
  return time.since_epoch() >= seconds(0) && time.since_epoch() < seconds(std::int64_t{1} << 32);
}

/// @return false: more than @p bound
bool read_count(OctetReader& reader, std::size_t bound, std::size_t& count) {
  count = reader.u16();
  return reader.ok() && count <= bound;
}

}  // namespace

ScheduledRequestId scheduled_request_id(const wire::TcPacket& packet) {
  return {.source = packet.source_id, .apid = packet.apid, .sequence = packet.sequence_count};
}

void write_schedule_change(OctetWriter& writer, const ScheduleChange& change) {
  writer.u64(change.requested_by);
  writer.u8(!change.enabled ? 2 : *change.enabled ? 1 : 0);
  writer.u16(static_cast<std::uint16_t>(change.removed.size()));
  for (const std::uint64_t id : change.removed) writer.u64(id);
  writer.u16(static_cast<std::uint16_t>(change.moved.size()));
  for (const auto& [id, release] : change.moved) {
    writer.u64(id);
    write_time(writer, release);
  }
  writer.u16(static_cast<std::uint16_t>(change.inserted.size()));
  for (const ScheduledActivity& activity : change.inserted) write_activity(writer, activity);
  writer.u16(static_cast<std::uint16_t>(change.groups.size()));
  for (const auto& [group, state] : change.groups) {
    writer.u8(group);
    writer.u8(static_cast<std::uint8_t>(state));
  }
}

std::optional<ScheduleChange> read_schedule_change(OctetReader& reader) {
  ScheduleChange change;
  change.requested_by = reader.u64();
  const std::uint8_t enabled = reader.u8();
  if (enabled > 2) return std::nullopt;
  if (enabled < 2) change.enabled = enabled == 1;
  std::size_t count = 0;
  if (!read_count(reader, TimeSchedule::max_activities, count)) return std::nullopt;
  for (; count > 0; --count) change.removed.push_back(reader.u64());
  if (!read_count(reader, TimeSchedule::max_activities, count)) return std::nullopt;
  for (; count > 0; --count) {
    const std::uint64_t id = reader.u64();
    change.moved.emplace_back(id, read_time(reader));
    if (!is_release_time(change.moved.back().second)) return std::nullopt;
  }
  if (!read_count(reader, TimeSchedule::max_activities, count)) return std::nullopt;
  for (; count > 0; --count) {
    change.inserted.push_back(read_activity(reader));
    if (!is_release_time(change.inserted.back().release)) return std::nullopt;
  }
  if (!read_count(reader, UINT8_MAX, count)) return std::nullopt;
  for (; count > 0; --count) {
    const std::uint8_t group = reader.u8();
    const std::uint8_t state = reader.u8();
    if (state > static_cast<std::uint8_t>(ScheduleChange::GroupState::deleted)) return std::nullopt;
    change.groups.emplace_back(group, static_cast<ScheduleChange::GroupState>(state));
  }
  if (!reader.ok()) return std::nullopt;
  return change;
}

void TimeSchedule::remove(std::uint64_t id) {
  const auto found = activities_.find(id);
  if (found == activities_.end()) return;
  octets_ -= found->second.packet.size();
  activities_.erase(found);
}

void TimeSchedule::apply(const ScheduleChange& change) {
  for (const std::uint64_t id : change.removed) remove(id);
  for (const auto& [id, release] : change.moved) {
    if (const auto found = activities_.find(id); found != activities_.end()) found->second.release = release;
  }
  for (const ScheduledActivity& activity : change.inserted) {
    next_id_ = std::max(next_id_, activity.id + 1);
    const bool room = activities_.size() < max_activities && octets_ + activity.packet.size() <= max_octets;
    if (!room || !activities_.emplace(activity.id, activity).second) continue;
    octets_ += activity.packet.size();
  }
  for (const auto& [group, state] : change.groups) {
    if (state == ScheduleChange::GroupState::deleted) {
      groups_.erase(group);
    } else if (groups_.size() < max_groups || groups_.contains(group)) {
      groups_[group] = state == ScheduleChange::GroupState::enabled;
    }
  }
  enabled_ = change.enabled.value_or(enabled_);
  last_request_ = std::max(last_request_, change.requested_by);
}

bool TimeSchedule::enabled(const ScheduledActivity& activity) const {
  const auto group = groups_.find(activity.group);
  return enabled_ && (group == groups_.end() || group->second);
}

std::vector<const ScheduledActivity*> TimeSchedule::in_order() const {
  std::vector<const ScheduledActivity*> all;
  all.reserve(activities_.size());
  for (const auto& [id, activity] : activities_) all.push_back(&activity);
  std::stable_sort(all.begin(), all.end(),
                   [](const auto* a, const auto* b) { return a->release < b->release; });
  return all;
}

const ScheduledActivity* TimeSchedule::next_enabled() const {
  const ScheduledActivity* next = nullptr;
  for (const auto& [id, activity] : activities_) {
    if (enabled(activity) && (next == nullptr || activity.release < next->release)) next = &activity;
  }
  return next;
}

void TimeSchedule::write(OctetWriter& writer) const {
  writer.u64(next_id_);
  ScheduleChange whole;
  whole.requested_by = last_request_;
  whole.enabled = enabled_;
  for (const auto& [id, activity] : activities_) whole.inserted.push_back(activity);
  using GroupState = ScheduleChange::GroupState;
  for (const auto& [group, enabled] : groups_)
    whole.groups.emplace_back(group, enabled ? GroupState::enabled : GroupState::disabled);
  write_schedule_change(writer, whole);
}

std::optional<TimeSchedule> TimeSchedule::read(OctetReader& reader) {
  TimeSchedule schedule;
  const std::uint64_t next_id = reader.u64();
  const auto whole = read_schedule_change(reader);
  if (!whole) return std::nullopt;
  schedule.apply(*whole);
  schedule.next_id_ = std::max(schedule.next_id_, next_id);
  // A schedule that was written within its bounds is read as a whole.
  if (schedule.activities_.size() != whole->inserted.size() ||
      schedule.groups_.size() != whole->groups.size())
    return std::nullopt;
  return schedule;
}

}  // namespace srfs
