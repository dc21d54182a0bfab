// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "ground/report_order.hpp"

#include <fmt/format.h>

namespace srfs::ground {
namespace {

/// The argument as text, of the one group that stands in the telecommand; empty: it has no group.
std::string argument_text(const mission::Dictionary& dictionary, const mission::EncodedCommand& encoded,
                          const std::string& name) {
  OctetReader in(encoded.data);
  if (encoded.command->is_function()) static_cast<void>(in.u16());
  if (encoded.command->repeated) static_cast<void>(in.u16());
  const auto fields = dictionary.decode(encoded.command->arguments, in.rest());
  if (!fields) return "";
  for (const mission::DecodedField& field : *fields) {
    if (field.name == name) return field.text;
  }
  return "";
}

}  // namespace

std::optional<ReportOrder> ReportOrder::of(const mission::Dictionary& dictionary,
                                           const mission::EncodedCommand& command) {
  if (!command.command->reports) return std::nullopt;
  mission::OrderedReports ordered = *command.command->reports;
  if (!ordered.argument.empty()) ordered.structure = argument_text(dictionary, command, ordered.argument);
  return ReportOrder(std::move(ordered));
}

ReportOrder ReportOrder::of_structure(const mission::Structure& structure) {
  const bool is_report = structure.kind == mission::StructureKind::report;
  return ReportOrder({.service = is_report ? structure.service : mission::housekeeping_report.first,
                      .subtype = is_report ? structure.subtype : mission::housekeeping_report.second,
                      .structure = structure.name,
                      .argument = "",
                      .several = true});
}

bool ReportOrder::take(const TelemetryReport& report, MonotonicTime now) {
  const bool is_one = report.vc == tm_channel::live && report.service == ordered_.service &&
                      report.subtype == ordered_.subtype &&
                      (ordered_.structure.empty() || report.name == ordered_.structure);
  if (is_one) last_ = now;
  return is_one;
}

bool ReportOrder::is_over(MonotonicTime now) const {
  if (!completed_) return false;
  if (last_ && !ordered_.several) return true;
  return now >= *deadline();
}

std::optional<MonotonicTime> ReportOrder::deadline() const {
  if (!completed_) return std::nullopt;
  if (last_) return *last_ + gap;
  return *completed_ + (ordered_.may_be_none ? patience_with_none : patience);
}

std::string ReportOrder::what() const {
  if (!ordered_.structure.empty()) return fmt::format("packet of structure {}", ordered_.structure);
  return fmt::format("TM {},{}", ordered_.service, ordered_.subtype);
}

}  // namespace srfs::ground
