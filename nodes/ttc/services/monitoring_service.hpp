// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <deque>
#include <optional>
#include <string_view>
#include <utility>
#include <vector>

#include <mission/structures.hpp>

#include "nodes/ttc/services/monitoring.hpp"
#include "nodes/ttc/services/pus_service.hpp"
#include "nodes/ttc/services/stored_table.hpp"

namespace srfs {

/// PUS service 12, on-board monitoring (ECSS-E-ST-70-41C 6.12, 8.12): its requests, the table on disk, its
/// reports. A change holds at once as a whole, and is reported complete (1,7) when the table is on disk.
/// Pure.
class MonitoringService final : public StoredTableService {
 public:
  static constexpr std::uint8_t service_type = 12;
  static constexpr std::string_view table_name = "monitors";
  /// Transitions reported at once, and one more after each period; others wait.
  static constexpr std::uint32_t report_burst = 64;
  static constexpr milliseconds report_period{125};
  /// What waited longer (12,3), or finds no room, is counted and not reported.
  static constexpr milliseconds default_reporting_delay{10'000};
  static constexpr std::size_t max_waiting = 1000;

  /// @param found  on disk: none or damaged means the factory set
  MonitoringService(const mission::Dictionary& dictionary, const FoundTable& found,
                    ReportQueue& report_queue);

  // ---- requests

  [[nodiscard]] bool provides(const mission::Command& command) const override;
  void execute(const Telecommand& telecommand, MonotonicTime now) override;
  /// Goes on with a long report as the line has room; at the request's expiry it ends as interrupted.
  void go_on(std::size_t room_octets, MonotonicTime now);
  [[nodiscard]] bool is_reporting() const { return listing_.has_value(); }

  // ---- checks

  [[nodiscard]] Monitoring& monitoring() { return monitoring_; }
  [[nodiscard]] const Monitoring& monitoring() const { return monitoring_; }
  /// It is to be reported (12,12).
  void on_transition(const Monitoring::Transition& transition, MonotonicTime now);
  /// The reports that may go now. To be called about each second while transitions wait.
  [[nodiscard]] std::vector<Report> take_reports(MonotonicTime now);
  /// What of the table's state is for the housekeeping.
  void fill(mission::TtcMonitoringHousekeeping& h) const;

  [[nodiscard]] bool is_factory() const { return factory_; }

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
    std::uint8_t subtype = 0;  ///< of the request
    std::vector<std::uint16_t> ids;
    std::size_t next = 0;
  };
  struct Waiting {
    Monitoring::Transition transition;
    MonotonicTime since;
  };
  void load(const FoundTable& found);
  [[nodiscard]] std::optional<Failure> change(std::uint8_t subtype, OctetView arguments);
  [[nodiscard]] std::optional<Failure> define(OctetView arguments, bool known);
  [[nodiscard]] std::optional<Failure> change_named(std::uint8_t subtype, OctetView arguments);
  [[nodiscard]] std::optional<Failure> delete_all();
  void restore_factory_set();
  [[nodiscard]] std::optional<Failure> add_functional(OctetView arguments);
  [[nodiscard]] std::optional<Failure> change_functional(std::uint8_t subtype, OctetView arguments);
  /// Why a monitor that functional monitors have cannot be deleted, or changed.
  [[nodiscard]] std::optional<Failure> why_bound(std::uint16_t monitor, bool to_be_deleted) const;
  void begin_report(const Telecommand& telecommand);
  [[nodiscard]] bool is_known(std::uint8_t subtype, std::uint16_t id) const;
  [[nodiscard]] std::vector<std::uint16_t> all_ids(std::uint8_t subtype) const;
  /// nullopt: there is nothing to say of it now.
  [[nodiscard]] std::optional<std::pair<std::uint8_t, Octets>> report_of(std::uint8_t subtype,
                                                                         std::uint16_t id) const;
  void fail(const TelecommandOrigin& origin, const Failure& failure);
  void put(const TelecommandOrigin& origin, std::uint8_t subtype, Octets data);
  [[nodiscard]] Octets definition_report(std::uint16_t id) const;
  [[nodiscard]] Octets functional_report(std::uint16_t id) const;
  [[nodiscard]] Octets functional_status(std::uint16_t id) const;

  const mission::Dictionary& dictionary_;
  Monitoring monitoring_;
  bool factory_ = true;  ///< the table is the factory set, whatever that is in the dictionary of now
  milliseconds reporting_delay_ = default_reporting_delay;
  std::optional<Listing> listing_;
  std::deque<Waiting> waiting_;  ///< to be reported
  std::uint32_t reports_left_ = report_burst;
  std::optional<MonotonicTime> reports_filled_;
  std::uint32_t unreported_ = 0;
};

}  // namespace srfs
