// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <deque>
#include <functional>
#include <map>
#include <optional>
#include <set>
#include <string_view>
#include <utility>
#include <vector>

#include <mission/structures.hpp>

#include "msgs/mission/dictionary.hpp"
#include "nodes/ttc/command/acceptance_journal.hpp"
#include "nodes/ttc/services/pus_service.hpp"
#include "nodes/ttc/services/stored_table.hpp"

namespace srfs {

/// The event of an event-action: its id, and the application process that raises it, 0: any.
struct ActionKey {
  std::uint16_t apid = 0;
  std::uint16_t event = 0;
  friend auto operator<=>(const ActionKey&, const ActionKey&) = default;
};

struct EventAction {
  Octets packet;  ///< the telecommand, as it was defined
  bool enabled = false;
  friend bool operator==(const EventAction&, const EventAction&) = default;
};
using ActionTable = std::map<ActionKey, EventAction>;

/// Events of monitors and of event-action come from ttc alone.
[[nodiscard]] bool may_raise(std::uint16_t apid, const mission::Event& event);

/// So many at once, and one more after each period.
class ReleaseRate {
 public:
  ReleaseRate(std::uint32_t burst, milliseconds period) : burst_(burst), period_(period) {}
  void take(MonotonicTime now);
  /// When the next may be taken: @p now or later.
  [[nodiscard]] MonotonicTime ready_at(MonotonicTime now) const;

 private:
  std::uint32_t burst_;
  milliseconds period_;
  std::deque<MonotonicTime> taken_;  ///< when each gives its place back; at most burst
};

struct EventActionCounters {
  std::uint32_t released = 0;
  std::uint32_t merged = 0;
  std::uint32_t delayed = 0;
  std::uint32_t dropped = 0;
  std::uint32_t refused = 0;
  std::uint32_t passive = 0;
};

/// PUS service 19, event-action (ECSS-E-ST-70-41C 6.19, 8.19): which telecommand an event releases, and when.
/// An event whose action waits already adds nothing to it. An action, and all of them, are released at a
/// bounded rate; one that has to wait is said and not lost, but for one that waits too long. Who releases it
/// makes it durable. Pure.
class EventActionService final : public StoredTableService {
 public:
  static constexpr std::uint8_t service_type = 19;
  static constexpr std::string_view table_name = "event_actions";
  static constexpr std::size_t max_actions = 64;
  static constexpr std::size_t max_octets = 32U << 10;  ///< of all their telecommands
  /// Of one action.
  static constexpr std::uint32_t burst = 3;
  static constexpr milliseconds period{60'000};
  /// Of all.
  static constexpr std::uint32_t total_burst = 16;
  static constexpr milliseconds total_period{2'000};
  static constexpr seconds longest_wait{600};
  /// Source id of a telecommand that was released: no source on the ground has it.
  static constexpr std::uint16_t on_board_source = 0xFFFF;

  /// Why a packet cannot be an action: a failure code; nullopt: it can.
  using RequestCheck = std::function<std::optional<std::uint16_t>(OctetView packet)>;

  EventActionService(const mission::Dictionary& dictionary, ReportQueue& report_queue)
      : StoredTableService(report_queue), dictionary_(dictionary) {}
  /// @param found  on disk: none or damaged means the factory set
  void load(const FoundTable& found, RequestCheck check);

  /// Judges the actions again: the dictionary is another one.
  void check_again();

  // ---- requests

  [[nodiscard]] bool provides(const mission::Command& command) const override;
  void execute(const Telecommand& telecommand, MonotonicTime now) override;

  /// Goes on with a report of definitions as MonitoringService does.
  void go_on(std::size_t room_octets, MonotonicTime now);
  [[nodiscard]] bool is_reporting() const { return listing_.has_value(); }

  // ---- release

  void on_event(std::uint16_t apid, std::uint16_t event, MonotonicTime now);
  /// An earlier process released this telecommand, ended or not: it counts for the rates.
  void on_known_release(const AcceptedTelecommand& known);
  /// What waited too long is dropped.
  [[nodiscard]] std::vector<mission::EventActionDroppedEvent> drop_overdue(MonotonicTime now);
  struct Due {
    ActionKey key;
    std::uint16_t raised_by = 0;  ///< APID
    Octets packet;
  };
  /// Waits and may be released now by its own rate, in the order of the events.
  [[nodiscard]] std::vector<Due> due(MonotonicTime now);
  /// By the rate of all.
  [[nodiscard]] bool may_release(MonotonicTime now) const { return total_.ready_at(now) <= now; }
  /// It was accepted, and waits for its record.
  void on_accepted(const ActionKey& key, std::uint64_t telecommand, MonotonicTime now);
  /// Its record was waited for. @param runs  it is executed; else it waits again. @return what was released
  std::optional<Due> on_passed(std::uint64_t telecommand, bool runs);
  void on_refused(const ActionKey& key, MonotonicTime now);
  /// The rules of now forbid it.
  void on_forbidden(const ActionKey& key, std::uint16_t code, MonotonicTime now);
  /// The telecommand of @p packet as it is released.
  [[nodiscard]] static Octets request_of(OctetView packet, std::uint16_t sequence);
  /// An event for each action that had to wait since the last call.
  [[nodiscard]] std::vector<mission::EventActionDelayedEvent> take_delayed() {
    return std::exchange(delayed_, {});
  }
  /// Factory actions that were left out, and actions that the rules of now forbid.
  [[nodiscard]] std::vector<mission::EventActionUnusableEvent> take_unusable() {
    return std::exchange(unusable_, {});
  }
  [[nodiscard]] std::optional<MonotonicTime> next_due(MonotonicTime now) const;

  // ---- what others want to know

  [[nodiscard]] const ActionTable& table() const { return table_; }
  [[nodiscard]] bool enabled() const { return enabled_; }
  [[nodiscard]] std::size_t waiting() const { return waiting_.size(); }
  [[nodiscard]] const EventActionCounters& counters() const { return counters_; }
  void fill(mission::TtcMonitoringHousekeeping& h) const;

 private:
  void write_table(OctetWriter& out) const override;
  [[nodiscard]] bool read_table(OctetReader& in) override;
  struct Failure {
    std::uint16_t code = 0;
    std::optional<std::uint16_t> parameter;
  };
  struct Listing {
    TelecommandOrigin origin;
    MonotonicTime expiry;
    std::vector<ActionKey> keys;
    std::size_t next = 0;
  };
  struct Waiting {
    ActionKey key;
    std::uint16_t raised_by = 0;
    MonotonicTime since;
    bool said = false;              ///< that it has to wait
    std::uint64_t telecommand = 0;  ///< accepted, and its record is waited for
  };
  struct Released {
    ReleaseRate rate{burst, period};
    std::uint32_t count = 0;
  };
  [[nodiscard]] ActionTable factory_set();
  [[nodiscard]] std::optional<Failure> change(std::uint8_t subtype, OctetView arguments);
  [[nodiscard]] std::optional<Failure> add(OctetView arguments);
  [[nodiscard]] std::optional<Failure> change_named(std::uint8_t subtype, OctetView arguments);
  void set_table(ActionTable table);
  void report_status(const TelecommandOrigin& origin);
  void report_definitions(const Telecommand& telecommand);
  void fail(const TelecommandOrigin& origin, const Failure& failure);
  void put(const TelecommandOrigin& origin, std::uint8_t subtype, Octets data);
  void count_rates(const ActionKey& key, MonotonicTime now);

  const mission::Dictionary& dictionary_;
  RequestCheck check_;
  ActionTable table_;
  bool enabled_ = true;
  bool factory_ = true;
  std::optional<Listing> listing_;
  std::deque<Waiting> waiting_;             ///< each action once at most
  std::map<ActionKey, Released> released_;  ///< of the actions in the table
  ReleaseRate total_{total_burst, total_period};
  std::vector<mission::EventActionDelayedEvent> delayed_;
  std::vector<mission::EventActionUnusableEvent> unusable_;
  std::set<ActionKey> forbidden_;  ///< of the enabled ones, as was said
  EventActionCounters counters_;
};

}  // namespace srfs
