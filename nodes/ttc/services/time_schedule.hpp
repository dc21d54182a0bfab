// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <vector>

#include "base/octets.hpp"
#include "base/time.hpp"
#include "wire/pus.hpp"

namespace srfs {

/// How service 11 names a request (ECSS-E-ST-70-41C 6.11.4.2): source, application process, sequence count.
struct ScheduledRequestId {
  std::uint16_t source = 0;
  std::uint16_t apid = 0;
  std::uint16_t sequence = 0;
  friend bool operator==(const ScheduledRequestId&, const ScheduledRequestId&) = default;
};
[[nodiscard]] ScheduledRequestId scheduled_request_id(const wire::TcPacket& packet);

/// A telecommand packet and when it is released.
struct ScheduledActivity {
  std::uint64_t id = 0;    ///< of this schedule, from 1, never used twice
  std::uint8_t group = 0;  ///< 0: none
  TaiTime release;
  ScheduledRequestId request;
  Octets packet;
  friend bool operator==(const ScheduledActivity&, const ScheduledActivity&) = default;
};

/// A change as it is written down: it holds as a whole or not at all.
struct ScheduleChange {
  enum class GroupState : std::uint8_t { disabled = 0, enabled = 1, deleted = 2 };
  std::uint64_t requested_by = 0;  ///< id of the telecommand; 0: none, an activity was dropped
  std::optional<bool> enabled;
  std::vector<std::uint64_t> removed;
  std::vector<std::pair<std::uint64_t, TaiTime>> moved;  ///< their new release times
  std::vector<ScheduledActivity> inserted;
  std::vector<std::pair<std::uint8_t, GroupState>> groups;

  /// Whether it changes anything.
  [[nodiscard]] bool empty() const {
    return !enabled && removed.empty() && moved.empty() && inserted.empty() && groups.empty();
  }
  friend bool operator==(const ScheduleChange&, const ScheduleChange&) = default;
};
void write_schedule_change(OctetWriter& writer, const ScheduleChange& change);
/// nullopt: not one, or beyond the bounds of a schedule.
[[nodiscard]] std::optional<ScheduleChange> read_schedule_change(OctetReader& reader);

/// The time-based schedule as it is on disk: activities, groups, execution function. It is modified by whole
/// changes only, so that a process that finds them again has the same schedule. The maker of a change keeps
/// the bounds; apply() ignores what does not fit the state (an earlier part was lost).
class TimeSchedule {
 public:
  static constexpr std::size_t max_activities = 256;
  static constexpr std::size_t max_octets = 32U << 10;  ///< of all packets
  static constexpr std::size_t max_groups = 32;

  using Activities = std::map<std::uint64_t, ScheduledActivity>;  ///< by id
  using Groups = std::map<std::uint8_t, bool>;                    ///< whether each is enabled

  void apply(const ScheduleChange& change);

  [[nodiscard]] const Activities& activities() const { return activities_; }
  [[nodiscard]] const Groups& groups() const { return groups_; }
  [[nodiscard]] std::size_t octets() const { return octets_; }
  [[nodiscard]] bool enabled() const { return enabled_; }
  /// Of an activity, by function and group.
  [[nodiscard]] bool enabled(const ScheduledActivity& activity) const;
  /// Of the next activity that is inserted.
  [[nodiscard]] std::uint64_t next_id() const { return next_id_; }
  /// Whether the change that a telecommand asked for was made: they come in the order of their ids.
  [[nodiscard]] bool has_applied(std::uint64_t request) const { return request <= last_request_; }
  /// In the order of release; those of one time in the order of insertion.
  [[nodiscard]] std::vector<const ScheduledActivity*> in_order() const;
  /// Of those that are not disabled, the first one.
  [[nodiscard]] const ScheduledActivity* next_enabled() const;
  [[nodiscard]] bool empty() const { return activities_.empty(); }

  void write(OctetWriter& writer) const;
  [[nodiscard]] static std::optional<TimeSchedule> read(OctetReader& reader);

  friend bool operator==(const TimeSchedule&, const TimeSchedule&) = default;

 private:
  void remove(std::uint64_t id);

  Activities activities_;
  Groups groups_;
  std::size_t octets_ = 0;
  bool enabled_ = true;
  std::uint64_t next_id_ = 1;
  std::uint64_t last_request_ = 0;
};

}  // namespace srfs
