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

/// How one structure is reported live.
struct HousekeepingPlan {
  bool enabled = true;
  milliseconds interval{0};  ///< 0: every sample
};

enum class HousekeepingError : std::uint8_t { unknown_structure, no_value_yet };

struct HousekeepingCounters {
  std::uint64_t samples = 0;  ///< received for known structures; each becomes one stored 3,25
  std::uint64_t live = 0;     ///< of them sent at once
  std::uint64_t unknown = 0;  ///< samples the dictionary does not have: structure, source or length
};

/// PUS 3 (ECSS-E-ST-70-41C 6.3): which samples of the housekeeping structures go down at once, and the newest
/// of each. Reports are made when a sample arrives, so that a report never shows an old value as new; over
/// time they are as many as the interval says.
class HousekeepingScheduler final : public PusService {
 public:
  static constexpr std::uint8_t service_type = 3;
  static constexpr std::uint8_t parameter_report = 25;

  explicit HousekeepingScheduler(ReportQueue& report_queue) : report_queue_(report_queue) {}

  [[nodiscard]] bool provides(const mission::Command& command) const override {
    return command.service == service_type;
  }
  void execute(const Telecommand& telecommand, MonotonicTime now) override;

  /// @param apid of the node whose structure it is. @param octets smallest and largest length of its
  /// parameters
  void add_structure(std::uint16_t structure_id, std::uint16_t apid, std::size_t min_octets,
                     std::size_t max_octets, HousekeepingPlan plan);

  void remove_structure(std::uint16_t structure_id) { structures_.erase(structure_id); }

  /// A new sample. @return 3,25: stored, and sent live when its structure is enabled and due; nullopt: not in
  /// the dictionary (counted)
  [[nodiscard]] std::optional<Report> on_sample(std::uint16_t apid, std::uint16_t structure_id,
                                                OctetView parameters, MonotonicTime now);

  Result<void, HousekeepingError> set_enabled(std::uint16_t structure_id, bool enabled);  // 3,5 and 3,6
  Result<void, HousekeepingError> set_interval(std::uint16_t structure_id, milliseconds interval);  // 3,31
  /// The newest sample again, now (3,27).
  [[nodiscard]] Result<Report, HousekeepingError> one_shot(std::uint16_t structure_id) const;
  /// nullopt: unknown structure
  [[nodiscard]] std::optional<HousekeepingPlan> plan(std::uint16_t structure_id) const;
  [[nodiscard]] const HousekeepingCounters& counters() const { return counters_; }

 private:
  struct Structure {
    std::uint16_t apid = 0;
    std::size_t min_octets = 0;
    std::size_t max_octets = 0;
    HousekeepingPlan plan;
    Octets newest;  ///< empty: none yet
    MonotonicTime next;
  };
  [[nodiscard]] Result<void, HousekeepingError> execute_one(const Telecommand& telecommand,
                                                            std::uint16_t structure_id, OctetReader& reader);

  ReportQueue& report_queue_;
  std::map<std::uint16_t, Structure> structures_;
  HousekeepingCounters counters_;
};

}  // namespace srfs
