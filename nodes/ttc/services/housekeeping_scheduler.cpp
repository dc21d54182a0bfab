// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "nodes/ttc/services/housekeeping_scheduler.hpp"

namespace srfs {
namespace {

Report parameter_report_of(std::uint16_t apid, std::uint16_t structure_id, OctetView parameters) {
  OctetWriter writer;
  writer.u16(structure_id);
  writer.bytes(parameters);
  return Report{.apid = apid,
                .service = HousekeepingScheduler::service_type,
                .subtype = HousekeepingScheduler::parameter_report,
                .destination_id = 0,
                .data = writer.take()};
}

// Requests of service 3 (ECSS-E-ST-70-41C 8.3.2).
constexpr std::uint8_t enable = 5;
constexpr std::uint8_t disable = 6;
constexpr std::uint8_t one_shot_report = 27;
constexpr std::uint8_t modify_interval = 31;

}  // namespace

void HousekeepingScheduler::execute(const Telecommand& telecommand, MonotonicTime /*now*/) {
  OctetReader reader(telecommand.arguments);
  const unsigned count = reader.u16();
  for (unsigned i = 0; i < count; ++i) {
    const std::uint16_t structure_id = reader.u16();
    if (execute_one(telecommand, structure_id, reader)) continue;
    report_queue_.failure(telecommand.origin, Stage::start, mission::failure::unknown_identifier,
                          octets_of_u16(structure_id));
    return;
  }
  report_queue_.done(telecommand.origin);
}

Result<void, HousekeepingError> HousekeepingScheduler::execute_one(const Telecommand& telecommand,
                                                                   std::uint16_t structure_id,
                                                                   OctetReader& reader) {
  const std::uint8_t subtype = telecommand.command->subtype;
  if (subtype == enable || subtype == disable) return set_enabled(structure_id, subtype == enable);
  if (subtype == modify_interval) return set_interval(structure_id, milliseconds(reader.u32()));
  if (subtype != one_shot_report) return {};
  auto report = one_shot(structure_id);
  if (!report) return Err(report.error());
  report->destination_id = telecommand.origin.source_id;
  report_queue_.put(std::move(*report));
  return {};
}

void HousekeepingScheduler::add_structure(std::uint16_t structure_id, std::uint16_t apid,
                                          std::size_t min_octets, std::size_t max_octets,
                                          HousekeepingPlan plan) {
  structures_[structure_id] = Structure{.apid = apid,
                                        .min_octets = min_octets,
                                        .max_octets = max_octets,
                                        .plan = plan,
                                        .newest = {},
                                        .next = {}};
}

std::optional<Report> HousekeepingScheduler::on_sample(std::uint16_t apid, std::uint16_t structure_id,
                                                       OctetView parameters, MonotonicTime now) {
  const auto found = structures_.find(structure_id);
  if (found == structures_.end() || found->second.apid != apid ||
      parameters.size() < found->second.min_octets || parameters.size() > found->second.max_octets) {
    ++counters_.unknown;
    return std::nullopt;
  }
  Structure& structure = found->second;
  ++counters_.samples;
  structure.newest.assign(parameters.begin(), parameters.end());
  // A sample that comes as often as its interval may be a little early; the rate stays the interval's all the
  // same.
  const nanoseconds slack = structure.plan.interval / 8;
  const bool live = structure.plan.enabled && now + slack >= structure.next;
  if (live) {
    ++counters_.live;
    structure.next += structure.plan.interval;
    if (structure.next <= now)
      structure.next = now + structure.plan.interval;  // a silence is not caught up with
  }
  Report report = parameter_report_of(apid, structure_id, parameters);
  report.live = live;
  return report;
}

Result<void, HousekeepingError> HousekeepingScheduler::set_enabled(std::uint16_t structure_id, bool enabled) {
  const auto found = structures_.find(structure_id);
  if (found == structures_.end()) return Err(HousekeepingError::unknown_structure);
  found->second.plan.enabled = enabled;
  return {};
}

Result<void, HousekeepingError> HousekeepingScheduler::set_interval(std::uint16_t structure_id,
                                                                    milliseconds interval) {
  const auto found = structures_.find(structure_id);
  if (found == structures_.end()) return Err(HousekeepingError::unknown_structure);
  found->second.plan.interval = interval;
  found->second.next = {};
  return {};
}

Result<Report, HousekeepingError> HousekeepingScheduler::one_shot(std::uint16_t structure_id) const {
  const auto found = structures_.find(structure_id);
  if (found == structures_.end()) return Err(HousekeepingError::unknown_structure);
  if (found->second.newest.empty()) return Err(HousekeepingError::no_value_yet);
  return parameter_report_of(found->second.apid, structure_id, found->second.newest);
}

std::optional<HousekeepingPlan> HousekeepingScheduler::plan(std::uint16_t structure_id) const {
  const auto found = structures_.find(structure_id);
  if (found == structures_.end()) return std::nullopt;
  return found->second.plan;
}

}  // namespace srfs
