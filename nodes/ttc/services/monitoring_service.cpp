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
  set_reporting_delay = 3,
  delete_all_definitions = 4,
  add = 5,
  delete_definitions = 6,
  modify = 7,
  report_definitions = 8,
  definition_report_subtype = 9,
  report_out_of_limits = 10,
  out_of_limits_report = 11,
  transition_report = 12,
  report_all_status = 13,
  status_report = 14,
  enable_function = 15,
  disable_function = 16,
  enable_functional_function = 17,
  disable_functional_function = 18,
  enable_functional = 19,
  disable_functional = 20,
  protect_functional = 21,
  unprotect_functional = 22,
  add_functional_definition = 23,
  delete_functional = 24,
  report_functional = 25,
  functional_definition_report = 26,
  report_functional_status = 27,
  functional_status_report = 28,
  restore_factory_set = 0,  ///< a function of service 8
};

static_assert(mission::FunctionalMonitorAdd::max_groups == Monitoring::max_monitors);
constexpr std::size_t report_octets = 128;  ///< of one packet at most

// Flags of a functional monitor on disk.
constexpr std::uint8_t enabled_flag = 1;
constexpr std::uint8_t protected_flag = 2;

bool is_report(std::uint8_t subtype) {
  switch (subtype) {
    case Subtype::report_definitions:
    case Subtype::report_out_of_limits:
    case Subtype::report_all_status:
    case Subtype::report_functional:
    case Subtype::report_functional_status:
      return true;
    default:
      return false;
  }
}

bool is_of_functional(std::uint8_t subtype) {
  return subtype >= Subtype::enable_functional_function;
}

mission::FunctionStatus status_of(bool enabled) {
  return enabled ? mission::FunctionStatus::enabled : mission::FunctionStatus::disabled;
}
mission::ProtectionStatus protection_of(const FunctionalDefinition& definition) {
  return definition.is_protected ? mission::ProtectionStatus::protected_
                                 : mission::ProtectionStatus::unprotected;
}

/// What stands behind the definitions on disk. Nothing stands there while all is as at first: so a table
/// without functional monitors is that of an earlier version.
struct FunctionalPart {
  milliseconds reporting_delay = MonitoringService::default_reporting_delay;
  bool enabled = true;
  FunctionalTable table = {};
  friend bool operator==(const FunctionalPart&, const FunctionalPart&) = default;
};

void write(OctetWriter& out, const FunctionalPart& part) {
  if (part == FunctionalPart{}) return;
  out.u32(static_cast<std::uint32_t>(part.reporting_delay.count()));
  out.u8(part.enabled ? function_flag : 0);
  out.u16(static_cast<std::uint16_t>(part.table.size()));
  for (const auto& [id, definition] : part.table) {
    out.u16(id);
    out.u8(static_cast<std::uint8_t>((definition.enabled ? enabled_flag : 0) |
                                     (definition.is_protected ? protected_flag : 0)));
    out.u32(definition.condition);
    out.u32(definition.condition_mask);
    out.f64(definition.condition_value);
    out.u16(definition.event);
    out.u8(definition.minimum_failing);
    out.u8(static_cast<std::uint8_t>(definition.monitors.size()));
    for (const std::uint16_t monitor : definition.monitors) out.u16(monitor);
  }
}

/// @return nullopt: not whole
std::optional<FunctionalPart> read_functional_part(OctetReader& in) {
  FunctionalPart part;
  if (in.remaining() == 0) return part;
  part.reporting_delay = milliseconds(in.u32());
  part.enabled = (in.u8() & function_flag) != 0;
  for (std::size_t count = in.u16(); count > 0 && in.ok(); --count) {
    FunctionalDefinition& definition = part.table[in.u16()];
    const std::uint8_t flags = in.u8();
    definition.enabled = (flags & enabled_flag) != 0;
    definition.is_protected = (flags & protected_flag) != 0;
    definition.condition = in.u32();
    definition.condition_mask = in.u32();
    definition.condition_value = in.f64();
    definition.event = in.u16();
    definition.minimum_failing = in.u8();
    for (std::size_t left = in.u8(); left > 0; --left) definition.monitors.push_back(in.u16());
    if (definition.monitors.size() > Monitoring::max_monitors) return std::nullopt;
  }
  const bool whole = in.ok() && in.remaining() == 0 && part.table.size() <= Monitoring::max_functional;
  return whole ? std::optional(std::move(part)) : std::nullopt;
}

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
  if (!in.ok() || table.size() > Monitoring::max_definitions) return false;
  auto functional = read_functional_part(in);
  if (!functional) return false;
  factory_ = (flags & factory_flag) != 0;
  reporting_delay_ = functional->reporting_delay;
  monitoring_.set_table(factory_ ? factory_monitors(dictionary_) : std::move(table));
  monitoring_.set_functional_table(std::move(functional->table));
  monitoring_.set_functional_enabled(functional->enabled);
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
  write(out, FunctionalPart{.reporting_delay = reporting_delay_,
                            .enabled = monitoring_.functional_enabled(),
                            .table = monitoring_.functional_table()});
}

// ---- requests

bool MonitoringService::provides(const mission::Command& command) const {
  return command.service == service_type || command.name == mission::MonitorRestore::name;
}

void MonitoringService::execute(const Telecommand& telecommand, MonotonicTime /*now*/) {
  const mission::Command& command = *telecommand.command;
  const std::uint8_t subtype =
      command.is_function() ? std::uint8_t{Subtype::restore_factory_set} : command.subtype;
  if (is_report(subtype)) return begin_report(telecommand);
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
    case Subtype::enable_functional_function:
    case Subtype::disable_functional_function:
      monitoring_.set_functional_enabled(subtype == Subtype::enable_functional_function);
      return std::nullopt;
    case Subtype::set_reporting_delay:
      reporting_delay_ = milliseconds(OctetReader(arguments).u32());
      return std::nullopt;
    case Subtype::restore_factory_set:
      restore_factory_set();
      return std::nullopt;
    case Subtype::delete_all_definitions:
      return delete_all();
    case Subtype::add:
    case Subtype::modify:
      return define(arguments, subtype == Subtype::modify);
    case Subtype::add_functional_definition:
      return add_functional(arguments);
    default:
      return is_of_functional(subtype) ? change_functional(subtype, arguments)
                                       : change_named(subtype, arguments);
  }
}

/// Whatever is protected: it is what helps when nothing else does.
void MonitoringService::restore_factory_set() {
  monitoring_.set_functional_table({});
  monitoring_.set_functional_enabled(true);
  monitoring_.set_table(factory_monitors(dictionary_));
  monitoring_.set_enabled(true);
  reporting_delay_ = default_reporting_delay;
  factory_ = true;
}

std::optional<MonitoringService::Failure> MonitoringService::delete_all() {
  if (monitoring_.enabled()) return Failure{mission::failure::still_enabled, std::uint16_t{0}};
  const FunctionalTable& functional = monitoring_.functional_table();
  if (!functional.empty()) return Failure{mission::failure::monitor_in_use, functional.begin()->first};
  monitoring_.set_table({});
  factory_ = false;
  return std::nullopt;
}

std::optional<MonitoringService::Failure> MonitoringService::why_bound(std::uint16_t monitor,
                                                                       bool to_be_deleted) const {
  for (const auto& [id, functional] : monitoring_.functional_table()) {
    const auto& monitors = functional.monitors;
    if (std::find(monitors.begin(), monitors.end(), monitor) == monitors.end()) continue;
    if (functional.is_protected) return Failure{mission::failure::monitor_protected, id};
    if (to_be_deleted) return Failure{mission::failure::monitor_in_use, id};
  }
  return std::nullopt;
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
    if (auto bound = why_bound(what.id, false)) return bound;
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
    if (auto bound =
            subtype == Subtype::enable ? std::nullopt : why_bound(id, subtype == Subtype::delete_definitions))
      return bound;
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

/// Its arguments: functional_monitor.add.
std::optional<MonitoringService::Failure> MonitoringService::add_functional(OctetView arguments) {
  OctetReader in(arguments);
  in.u16();  // one definition
  const std::uint16_t id = in.u16();
  FunctionalDefinition definition;
  definition.condition = in.u32();
  definition.condition_mask = in.u32();
  definition.condition_value = in.f64();
  definition.event = in.u16();
  definition.minimum_failing = in.u8();
  for (std::size_t left = in.u16(); left > 0; --left) definition.monitors.push_back(in.u16());
  FunctionalTable table = monitoring_.functional_table();
  if (table.contains(id)) return Failure{mission::failure::monitor_exists, id};
  if (const auto refusal = why_not_taken(id, definition, monitoring_.table(), dictionary_))
    return Failure{refusal->code, refusal->parameter};
  if (table.size() == Monitoring::max_functional) return Failure{mission::failure::table_full, {}};
  table[id] = std::move(definition);
  monitoring_.set_functional_table(std::move(table));
  return std::nullopt;
}

std::optional<MonitoringService::Failure> MonitoringService::change_functional(std::uint8_t subtype,
                                                                               OctetView arguments) {
  FunctionalTable table = monitoring_.functional_table();
  for (const std::uint16_t id : ids_of(arguments)) {
    const auto found = table.find(id);
    if (found == table.end()) return Failure{mission::failure::unknown_identifier, id};
    FunctionalDefinition& definition = found->second;
    const bool weakens = subtype == Subtype::disable_functional || subtype == Subtype::delete_functional;
    if (weakens && definition.is_protected) return Failure{mission::failure::monitor_protected, id};
    if (subtype == Subtype::protect_functional || subtype == Subtype::unprotect_functional) {
      definition.is_protected = subtype == Subtype::protect_functional;
    } else if (subtype != Subtype::delete_functional) {
      definition.enabled = subtype == Subtype::enable_functional;
    } else if (definition.enabled) {
      return Failure{mission::failure::still_enabled, id};
    } else {
      table.erase(found);
    }
  }
  monitoring_.set_functional_table(std::move(table));
  return std::nullopt;
}

void MonitoringService::fail(const TelecommandOrigin& origin, const Failure& failure) {
  report_queue().failure(origin, Stage::start, failure.code,
                         failure.parameter ? octets_of_u16(*failure.parameter) : Octets{});
}

// ---- reports

void MonitoringService::begin_report(const Telecommand& telecommand) {
  if (listing_) return fail(telecommand.origin, {mission::failure::busy, {}});
  const std::uint8_t subtype = telecommand.command->subtype;
  Listing listing{
      .origin = telecommand.origin, .expiry = telecommand.expiry, .subtype = subtype, .ids = {}, .next = 0};
  if (subtype == Subtype::report_definitions || subtype == Subtype::report_functional)
    listing.ids = ids_of(telecommand.arguments);
  for (const std::uint16_t id : listing.ids) {
    if (!is_known(subtype, id)) return fail(telecommand.origin, {mission::failure::unknown_identifier, id});
  }
  if (listing.ids.empty()) listing.ids = all_ids(subtype);
  report_queue().success(telecommand.origin, Stage::start);
  listing_ = std::move(listing);
}

bool MonitoringService::is_known(std::uint8_t subtype, std::uint16_t id) const {
  return is_of_functional(subtype) ? monitoring_.functional_table().contains(id)
                                   : monitoring_.table().contains(id);
}

std::vector<std::uint16_t> MonitoringService::all_ids(std::uint8_t subtype) const {
  std::vector<std::uint16_t> ids;
  if (subtype == Subtype::report_out_of_limits) {
    for (const auto& transition : monitoring_.out_of_limits()) ids.push_back(transition.definition);
  } else if (is_of_functional(subtype)) {
    for (const auto& [id, definition] : monitoring_.functional_table()) ids.push_back(id);
  } else {
    for (const auto& [id, definition] : monitoring_.table()) ids.push_back(id);
  }
  return ids;
}

void MonitoringService::go_on(std::size_t room_octets, MonotonicTime now) {
  if (!listing_) return;
  for (; listing_->next < listing_->ids.size(); ++listing_->next) {
    if (room_octets < room_kept_octets + report_octets) {
      if (now < listing_->expiry) return;
      report_queue().failure(listing_->origin, Stage::completion, mission::failure::interrupted);
      return listing_.reset();
    }
    room_octets -= report_octets;
    auto report = report_of(listing_->subtype, listing_->ids[listing_->next]);
    if (report) put(listing_->origin, report->first, std::move(report->second));
  }
  report_queue().success(listing_->origin, Stage::completion);
  listing_.reset();
}

/// What was deleted meanwhile is left out, as what came back within its limits.
std::optional<std::pair<std::uint8_t, Octets>> MonitoringService::report_of(std::uint8_t subtype,
                                                                            std::uint16_t id) const {
  if (!is_known(subtype, id)) return std::nullopt;
  switch (subtype) {
    case Subtype::report_definitions:
      return std::pair(Subtype::definition_report_subtype, definition_report(id));
    case Subtype::report_functional:
      return std::pair(Subtype::functional_definition_report, functional_report(id));
    case Subtype::report_functional_status:
      return std::pair(Subtype::functional_status_report, functional_status(id));
    case Subtype::report_all_status: {
      mission::MonitorStatus report;
      report.definitions = 1;
      report.id = id;
      report.status = status_of(monitoring_.table().at(id).enabled);
      return std::pair(Subtype::status_report, report.encoded());
    }
    default:
      break;
  }
  const auto transition = monitoring_.out_of_limits(id);
  if (!transition) return std::nullopt;
  return std::pair(Subtype::out_of_limits_report, report_data<mission::MonitorOutOfLimits>(*transition));
}

Octets MonitoringService::definition_report(std::uint16_t id) const {
  const MonitorDefinition& definition = monitoring_.table().at(id);
  OctetWriter out;
  out.u32(static_cast<std::uint32_t>(reporting_delay_.count()));
  out.u16(1);
  out.u8(definition.enabled ? 1 : 0);
  out.u8(static_cast<std::uint8_t>(monitoring_.state(id)));
  definition.what.encode(out);
  return out.take();
}

Octets MonitoringService::functional_report(std::uint16_t id) const {
  const FunctionalDefinition& definition = monitoring_.functional_table().at(id);
  mission::FunctionalMonitorDefinition report;
  report.definitions = 1;
  report.id = id;
  report.condition = definition.condition;
  report.condition_mask = definition.condition_mask;
  report.condition_value = definition.condition_value;
  report.protection = protection_of(definition);
  report.status = status_of(definition.enabled);
  report.event = definition.event;
  report.minimum_failing = definition.minimum_failing;
  report.monitors = static_cast<std::uint16_t>(definition.monitors.size());
  std::copy(definition.monitors.begin(), definition.monitors.end(), report.monitor.begin());
  return report.encoded();
}

Octets MonitoringService::functional_status(std::uint16_t id) const {
  const FunctionalDefinition& definition = monitoring_.functional_table().at(id);
  mission::FunctionalMonitorStatus report;
  report.definitions = 1;
  report.id = id;
  report.protection = protection_of(definition);
  report.status = status_of(definition.enabled);
  report.state = monitoring_.functional_state(id);
  return report.encoded();
}

void MonitoringService::put(const TelecommandOrigin& origin, std::uint8_t subtype, Octets data) {
  report_queue().put(Report{.apid = origin.apid,
                            .service = service_type,
                            .subtype = subtype,
                            .destination_id = origin.source_id,
                            .data = std::move(data),
                            .stored = false});
}

void MonitoringService::on_transition(const Monitoring::Transition& transition, MonotonicTime now) {
  if (waiting_.size() == max_waiting) {
    ++unreported_;
  } else {
    waiting_.push_back({transition, now});
  }
}

std::vector<Report> MonitoringService::take_reports(MonotonicTime now) {
  if (!reports_filled_) reports_filled_ = now;
  const std::int64_t refills = (now - *reports_filled_) / nanoseconds(report_period);
  reports_left_ = static_cast<std::uint32_t>(std::min<std::int64_t>(report_burst, reports_left_ + refills));
  *reports_filled_ += refills * nanoseconds(report_period);
  std::vector<Report> reports;
  for (; !waiting_.empty() && reports_left_ > 0; --reports_left_, waiting_.pop_front()) {
    reports.push_back({.apid = mission::apid::ttc,
                       .service = service_type,
                       .subtype = Subtype::transition_report,
                       .data = report_data<mission::MonitorTransition>(waiting_.front().transition)});
  }
  for (; !waiting_.empty() && now - waiting_.front().since >= nanoseconds(reporting_delay_); ++unreported_)
    waiting_.pop_front();
  return reports;
}

void MonitoringService::fill(mission::TtcMonitoringHousekeeping& h) const {
  const MonitorTable& table = monitoring_.table();
  h.monitoring = status_of(monitoring_.enabled());
  h.definitions = static_cast<std::uint16_t>(table.size());
  h.enabled = static_cast<std::uint16_t>(
      std::count_if(table.begin(), table.end(), [](const auto& entry) { return entry.second.enabled; }));
  h.unresolved = static_cast<std::uint16_t>(monitoring_.unresolved());
  h.out_of_limits = static_cast<std::uint16_t>(monitoring_.out_of_limits_count());
  const FunctionalPart functional{reporting_delay_, monitoring_.functional_enabled(),
                                  monitoring_.functional_table()};
  h.table_generation = factory_ && functional == FunctionalPart{} ? 0 : as_u32(generation());
  h.checks = monitoring_.counters().checks;
  h.transitions = monitoring_.counters().transitions;
  h.unreported = unreported_;
  h.functional = status_of(functional.enabled);
  h.functional_definitions = static_cast<std::uint16_t>(functional.table.size());
  h.functional_failed = static_cast<std::uint16_t>(monitoring_.functional_failed());
}

}  // namespace srfs
