// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <map>
#include <optional>

#include "base/octets.hpp"
#include "base/result.hpp"
#include "base/time.hpp"
#include "nodes/ttc/services/pus_service.hpp"

namespace srfs {

struct EventRateLimit {
  std::uint32_t burst = 5;    ///< reports of one event at once
  milliseconds refill{2000};  ///< one more after each of these
};

struct EventCounters {
  std::uint64_t reported = 0;    ///< sent live
  std::uint64_t disabled = 0;    ///< stored only, because the event is disabled
  std::uint64_t suppressed = 0;  ///< neither stored nor sent, because of the rate limit
  std::uint64_t unknown = 0;     ///< not in the dictionary, or with a severity other than 1-4
};

/// PUS 5 (ECSS-E-ST-70-41C 6.5): which events become reports. One event id that floods costs only itself.
class EventReporter final : public PusService {
 public:
  static constexpr std::uint8_t service_type = 5;

  explicit EventReporter(ReportQueue& report_queue, EventRateLimit limit = {})
      : report_queue_(report_queue), limit_(limit) {}

  [[nodiscard]] bool provides(const mission::Command& command) const override {
    return command.service == service_type;
  }
  void execute(const Telecommand& telecommand, MonotonicTime now) override;

  /// Event ids are unique in the whole dictionary. @param apid of the node that raises it
  void add_event(std::uint16_t event_id, bool enabled = true);

  void remove_event(std::uint16_t event_id) { events_.erase(event_id); }

  /// One that the ground needs to finish something: no rate limit, and 5,6 on it is refused.
  void add_essential_event(std::uint16_t event_id);

  /// @param data the event's parameters, encoded
  /// @return 5,1 to 5,4: stored, and sent live when the event is enabled
  [[nodiscard]] std::optional<Report> on_event(std::uint16_t apid, std::uint16_t event_id,
                                               std::uint8_t severity, OctetView data, MonotonicTime now);
  [[nodiscard]] bool knows(std::uint16_t event_id) const { return events_.contains(event_id); }
  /// It is known, and @p severity is one.
  [[nodiscard]] bool takes(std::uint16_t event_id, std::uint8_t severity) const;
  /// 5,5 and 5,6. @return false: unknown event, or an essential one that would be disabled
  bool set_enabled(std::uint16_t event_id, bool enabled);
  [[nodiscard]] const EventCounters& counters() const { return counters_; }

 private:
  struct Event {
    bool enabled = true;
    bool essential = false;
    std::uint32_t tokens = 0;
    MonotonicTime refilled;
    bool seen = false;
  };
  [[nodiscard]] bool take_token(Event& event, MonotonicTime now) const;
  void report_disabled(const TelecommandOrigin& origin);  // 5,7

  ReportQueue& report_queue_;
  EventRateLimit limit_;
  std::map<std::uint16_t, Event> events_;
  EventCounters counters_;
};

}  // namespace srfs
