// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "nodes/ttc/services/monitoring_service.hpp"

#include <algorithm>

#include "base/saturate.hpp"

namespace srfs {
namespace {

// Requests and reports of service 12 (ECSS-E-ST-70-41C 8.12.2).
enum Subtype : std::uint8_t {
  enable = 1,
  disable = 2,
  delete_all = 4,
  add = 5,
  delete_definitions = 6,
  modify = 7,
  report_definitions = 8,
  definition_report_subtype = 9,
  report_out_of_limits = 10,
  out_of_limits_report = 11,
  transition_report = 12,
  enable_function = 15,
  disable_function = 16,
  restore_factory_set = 0,  ///< a function of service 8
};

constexpr std::size_t report_octets = 128;  ///< of one packet at most

std::vector<std::uint16_t> ids_of(OctetView arguments) {
  OctetReader reader(arguments);
  std::vector<std::uint16_t> ids(reader.u16());
  for (std::uint16_t& id : ids) id = reader.u16();
  return ids;
}

template <class ReportStructure>
Octets report_data(const Monitoring::Transition& transition) {
  ReportStructure report;
  report.transitions = 1;
  report.definition = transition.definition;
  report.parameter = transition.parameter;
  report.check = transition.check;
  report.value = transition.value;
  report.limit = transition.limit;
  report.previous = transition.previous;
  report.state = transition.state;
  report.since = transition.since;
  return report.encoded();
}

}  // namespace

MonitoringService::MonitoringService(const mission::Dictionary& dictionary, const FoundTable& found,
                                     ReportQueue& report_queue)
    : StoredTableService(report_queue), dictionary_(dictionary), monitoring_(dictionary) {
  load(found);
}

// ---- table on disk

void MonitoringService::load(const FoundTable& found) {
  if (!read(found)) monitoring_.set_table(factory_monitors(dictionary_));
}

bool MonitoringService::read_table(OctetReader& in) {
  MonitorTable table;
  const std::uint8_t flags = in.u8();
  for (std::size_t count = in.u16(); count > 0; --count) {
    const bool enabled = in.u8() != 0;
    const auto what = mission::MonitorAdd::decode_one(in);
    if (!what) return false;
    table[what->id] = {.what = *what, .enabled = enabled};
  }
  if (!in.ok() || in.remaining() != 0 || table.size() > Monitoring::max_definitions) return false;
  factory_ = (flags & factory_flag) != 0;
  monitoring_.set_table(factory_ ? factory_monitors(dictionary_) : std::move(table));
  monitoring_.set_enabled((flags & function_flag) != 0);
  return true;
}

void MonitoringService::write_table(OctetWriter& out) const {
  out.u8(
      static_cast<std::uint8_t>((monitoring_.enabled() ? function_flag : 0) | (factory_ ? factory_flag : 0)));
  const MonitorTable none;
  const MonitorTable& table = factory_ ? none : monitoring_.table();
  out.u16(static_cast<std::uint16_t>(table.size()));
  for (const auto& [id, definition] : table) {
    out.u8(definition.enabled ? 1 : 0);
    definition.what.encode(out);
  }
}

// ---- requests

bool MonitoringService::provides(const mission::Command& command) const {
  return command.service == service_type || command.name == mission::MonitorRestore::name;
}

void MonitoringService::execute(const Telecommand& telecommand, MonotonicTime /*now*/) {
  const mission::Command& command = *telecommand.command;
  const std::uint8_t subtype =
      command.is_function() ? std::uint8_t{Subtype::restore_factory_set} : command.subtype;
  if (subtype == Subtype::report_definitions || subtype == Subtype::report_out_of_limits)
    return begin_report(telecommand);
  if (const auto failure = change(subtype, telecommand.arguments)) return fail(telecommand.origin, *failure);
  on_changed(telecommand.origin);
}

std::optional<MonitoringService::Failure> MonitoringService::change(std::uint8_t subtype,
                                                                    OctetView arguments) {
  switch (subtype) {
    case Subtype::enable_function:
    case Subtype::disable_function:
      monitoring_.set_enabled(subtype == Subtype::enable_function);
      return std::nullopt;
    case Subtype::restore_factory_set:
      monitoring_.set_table(factory_monitors(dictionary_));
      monitoring_.set_enabled(true);
      factory_ = true;
      return std::nullopt;
    case Subtype::delete_all:
      if (monitoring_.enabled()) return Failure{mission::failure::still_enabled, std::uint16_t{0}};
      monitoring_.set_table({});
      factory_ = false;
      return std::nullopt;
    case Subtype::add:
    case Subtype::modify:
      return define(arguments, subtype == Subtype::modify);
    default:
      return change_named(subtype, arguments);
  }
}

/// @param known  the definitions are there already
std::optional<MonitoringService::Failure> MonitoringService::define(OctetView arguments, bool known) {
  const auto definitions = mission::MonitorAdd::decode(arguments);
  if (!definitions)
    return Failure{mission::failure::bad_argument, std::nullopt};  // the dictionary checked it
  MonitorTable table = monitoring_.table();
  for (const mission::MonitorAdd& what : *definitions) {
    if (table.contains(what.id) != known)
      return Failure{known ? mission::failure::unknown_identifier : mission::failure::monitor_exists,
                     what.id};
    if (const auto refusal = why_not_taken(what, dictionary_))
      return Failure{refusal->code, refusal->parameter};
    table[what.id] = {.what = what, .enabled = known && table[what.id].enabled};
  }
  if (table.size() > Monitoring::max_definitions) return Failure{mission::failure::table_full, {}};
  monitoring_.set_table(std::move(table));
  factory_ = false;
  return std::nullopt;
}

std::optional<MonitoringService::Failure> MonitoringService::change_named(std::uint8_t subtype,
                                                                          OctetView arguments) {
  MonitorTable table = monitoring_.table();
  for (const std::uint16_t id : ids_of(arguments)) {
    const auto found = table.find(id);
    if (found == table.end()) return Failure{mission::failure::unknown_identifier, id};
    if (subtype != Subtype::delete_definitions) {
      found->second.enabled = subtype == Subtype::enable;
    } else if (found->second.enabled) {
      return Failure{mission::failure::still_enabled, id};
    } else {
      table.erase(found);
    }
  }
  monitoring_.set_table(std::move(table));
  factory_ = false;
  return std::nullopt;
}

void MonitoringService::fail(const TelecommandOrigin& origin, const Failure& failure) {
  report_queue().failure(origin, Stage::start, failure.code,
                         failure.parameter ? octets_of_u16(*failure.parameter) : Octets{});
}

// ---- reports

void MonitoringService::begin_report(const Telecommand& telecommand) {
  if (listing_) return fail(telecommand.origin, {mission::failure::busy, {}});
  Listing listing{.origin = telecommand.origin,
                  .expiry = telecommand.expiry,
                  .ids = {},
                  .next = 0,
                  .out_of_limits = false};
  if (telecommand.command->subtype == Subtype::report_out_of_limits) {
    listing.out_of_limits = true;
    for (const auto& transition : monitoring_.out_of_limits()) listing.ids.push_back(transition.definition);
  } else {
    listing.ids = ids_of(telecommand.arguments);
    for (const std::uint16_t id : listing.ids) {
      if (!monitoring_.table().contains(id))
        return fail(telecommand.origin, {mission::failure::unknown_identifier, id});
    }
    if (listing.ids.empty()) {
      for (const auto& [id, definition] : monitoring_.table()) listing.ids.push_back(id);
    }
  }
  report_queue().success(telecommand.origin, Stage::start);
  listing_ = std::move(listing);
}

void MonitoringService::go_on(std::size_t room_octets, MonotonicTime now) {
  if (!listing_) return;
  const auto transitions =
      listing_->out_of_limits ? monitoring_.out_of_limits() : std::vector<Monitoring::Transition>{};
  for (; listing_->next < listing_->ids.size(); ++listing_->next) {
    if (room_octets < room_kept_octets + report_octets) {
      if (now < listing_->expiry) return;
      report_queue().failure(listing_->origin, Stage::completion, mission::failure::interrupted);
      return listing_.reset();
    }
    room_octets -= report_octets;
    const std::uint16_t id = listing_->ids[listing_->next];
    if (!listing_->out_of_limits) {
      // What was deleted meanwhile is left out, as what came back within its limits.
      if (monitoring_.table().contains(id))
        put(listing_->origin, Subtype::definition_report_subtype, definition_report(id));
      continue;
    }
    const auto found = std::find_if(transitions.begin(), transitions.end(),
                                    [id](const auto& transition) { return transition.definition == id; });
    if (found != transitions.end())
      put(listing_->origin, Subtype::out_of_limits_report, report_data<mission::MonitorOutOfLimits>(*found));
  }
  report_queue().success(listing_->origin, Stage::completion);
  listing_.reset();
}

Octets MonitoringService::definition_report(std::uint16_t id) const {
  const MonitorDefinition& definition = monitoring_.table().at(id);
  OctetWriter out;
  out.u16(1);
  out.u8(definition.enabled ? 1 : 0);
  out.u8(static_cast<std::uint8_t>(monitoring_.state(id)));
  definition.what.encode(out);
  return out.take();
}

void MonitoringService::put(const TelecommandOrigin& origin, std::uint8_t subtype, Octets data) {
  report_queue().put(Report{.apid = origin.apid,
                            .service = service_type,
                            .subtype = subtype,
                            .destination_id = origin.source_id,
                            .data = std::move(data),
                            .stored = false});
}

std::optional<Report> MonitoringService::report_of(const Monitoring::Transition& transition,
                                                   MonotonicTime now) {
  if (!reports_filled_) reports_filled_ = now;
  const std::int64_t refills = (now - *reports_filled_) / nanoseconds(report_period);
  reports_left_ = static_cast<std::uint32_t>(std::min<std::int64_t>(report_burst, reports_left_ + refills));
  *reports_filled_ += refills * nanoseconds(report_period);
  if (reports_left_ == 0) {
    ++unreported_;
    return std::nullopt;
  }
  --reports_left_;
  return Report{.apid = mission::apid::ttc,
                .service = service_type,
                .subtype = Subtype::transition_report,
                .data = report_data<mission::MonitorTransition>(transition)};
}

void MonitoringService::fill(mission::TtcMonitoringHousekeeping& h) const {
  const MonitorTable& table = monitoring_.table();
  h.monitoring = monitoring_.enabled() ? mission::FunctionStatus::enabled : mission::FunctionStatus::disabled;
  h.definitions = static_cast<std::uint16_t>(table.size());
  h.enabled = static_cast<std::uint16_t>(
      std::count_if(table.begin(), table.end(), [](const auto& entry) { return entry.second.enabled; }));
  h.unresolved = static_cast<std::uint16_t>(monitoring_.unresolved());
  h.out_of_limits = static_cast<std::uint16_t>(monitoring_.out_of_limits_count());
  h.table_generation = factory_ ? 0 : as_u32(generation());
  h.checks = monitoring_.counters().checks;
  h.transitions = monitoring_.counters().transitions;
  h.unreported = unreported_;
}

}  // namespace srfs
