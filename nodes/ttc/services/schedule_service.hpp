// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <deque>
#include <functional>
#include <optional>
#include <utility>
#include <vector>

#include <mission/structures.hpp>

#include "base/result.hpp"
#include "msgs/mission/dictionary.hpp"
#include "nodes/ttc/command/acceptance_journal.hpp"
#include "nodes/ttc/services/pus_service.hpp"
#include "nodes/ttc/services/time_schedule.hpp"

namespace srfs {

struct ScheduleCounters {
  std::uint32_t inserted = 0;
  std::uint32_t released = 0;
  std::uint32_t late = 0;
  std::uint32_t disabled = 0;
  std::uint32_t refused = 0;
};

/// PUS service 11, time-based scheduling (ECSS-E-ST-70-41C 6.11, 8.11): carries out its requests on the
/// schedule in the journal, and says what is due. A change is reported complete (1,7) when it is on disk.
/// Nothing is due while the time is not valid, and nothing while a change waits for the disk. Pure.
class ScheduleService final : public PusService {
 public:
  static constexpr std::uint8_t service_type = 11;
  /// Source data of one report; longer lists come in several.
  static constexpr std::size_t report_octets = 1000;

  /// @param late_max an activity that is later than this is dropped
  ScheduleService(AcceptanceJournal& journal, ReportQueue& report_queue, nanoseconds late_max)
      : journal_(journal), report_queue_(report_queue), late_max_(late_max) {}

  /// The time of everything that follows, until the next call.
  void on_time(TaiTime now, bool valid) {
    now_ = now;
    time_valid_ = valid;
  }

  // ---- requests

  /// Whether a packet is a telecommand of the dictionary with good arguments; else the code and the argument.
  /// 11,4 is refused (1,2) with the first of its requests that could not be accepted.
  using RequestError = std::pair<std::uint16_t, std::uint8_t>;
  using RequestCheck = std::function<std::optional<RequestError>(OctetView packet)>;
  void set_request_check(RequestCheck check) { request_check_ = std::move(check); }
  [[nodiscard]] std::optional<Refusal> why_refused(const Telecommand& telecommand) const override;

  [[nodiscard]] bool provides(const mission::Command& command) const override {
    return command.service == service_type;
  }
  void execute(const Telecommand& telecommand, MonotonicTime now) override;
  /// One that is on disk was carried out.
  [[nodiscard]] bool restore(const Telecommand& telecommand, const TelecommandProgress& progress,
                             MonotonicTime now) override;
  /// What of the journal was written, or could not be.
  void on_written(std::uint64_t revision, bool success);

  // ---- release

  /// Drops what is due and disabled, or late.
  void drop_overdue();
  /// The activity to release next, if one is due. nullptr: none now.
  [[nodiscard]] const ScheduledActivity* due() const;
  /// Its request was accepted, and with the same record it left the schedule.
  void on_released() { ++counters_.released; }
  /// Its request was refused.
  void on_refused(const ScheduledActivity& activity);
  /// An event for each activity that was dropped since the last call.
  [[nodiscard]] std::vector<mission::ScheduleActivityDroppedEvent> take_dropped() {
    return std::exchange(dropped_, {});
  }

  // ---- what others want to know

  /// Time until something becomes due; nullopt: nothing does by itself.
  [[nodiscard]] std::optional<nanoseconds> next_due_in() const;
  /// The next activity that will be released, and in how long; nullopt there: the time is not valid.
  struct Next {
    const ScheduledActivity* activity = nullptr;
    std::optional<nanoseconds> in;
  };
  [[nodiscard]] std::optional<Next> next() const;
  [[nodiscard]] const TimeSchedule& schedule() const { return journal_.schedule(); }
  [[nodiscard]] const ScheduleCounters& counters() const { return counters_; }

 private:
  using Selected = std::vector<const ScheduledActivity*>;
  struct Failure {
    std::uint16_t code = 0;
    Octets parameter;
  };
  /// What is reported once the journal with this revision is on disk.
  struct Held {
    std::uint64_t revision = 0;
    TelecommandOrigin origin;
    std::uint16_t refusal = 0;  ///< 0: 1,7, or 1,8 without a disk; else 1,2 with this code
  };
  [[nodiscard]] Result<ScheduleChange, Failure> insert(OctetReader& reader) const;
  [[nodiscard]] Result<ScheduleChange, Failure> remove(const Selected& selected) const;
  [[nodiscard]] Result<ScheduleChange, Failure> shift(const Selected& selected, seconds offset) const;
  [[nodiscard]] ScheduleChange reset() const;
  [[nodiscard]] Result<ScheduleChange, Failure> change_groups(std::uint8_t subtype,
                                                              OctetReader& reader) const;
  [[nodiscard]] Result<Selected, Failure> select_by_request(OctetReader& reader) const;
  [[nodiscard]] Result<Selected, Failure> select_by_filter(OctetReader& reader) const;
  [[nodiscard]] Result<ScheduleChange, Failure> change_asked_for(std::uint8_t subtype,
                                                                 OctetReader& reader) const;
  [[nodiscard]] Result<Selected, Failure> selection_asked_for(std::uint8_t subtype,
                                                              OctetReader& reader) const;
  void report(const TelecommandOrigin& origin, const Selected& selected, bool detail);
  void report_groups(const TelecommandOrigin& origin);
  void fail(const TelecommandOrigin& origin, const Failure& failure);
  [[nodiscard]] bool fits_the_link(TaiTime release) const;

  AcceptanceJournal& journal_;
  ReportQueue& report_queue_;
  nanoseconds late_max_;
  RequestCheck request_check_;
  TaiTime now_;
  bool time_valid_ = false;
  std::deque<Held> held_;
  std::vector<mission::ScheduleActivityDroppedEvent> dropped_;
  ScheduleCounters counters_;
};

}  // namespace srfs
