// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "ground/latest_values.hpp"

#include <fmt/format.h>

#include "ground/terminal_text.hpp"

namespace srfs::ground {

void LatestValues::take(const TelemetryReport& report, UtcTime received) {
  const bool known = report.kind == TelemetryKind::housekeeping || report.kind == TelemetryKind::beacon;
  if (!known || report.vc != tm_channel::live) return;
  const auto found = entries_.find(report.name);
  if (found == entries_.end()) {
    entries_.emplace(report.name, Entry{report, received});
  } else if (found->second.received <= received) {
    found->second = {report, received};
  }
}

const LatestValues::Entry* LatestValues::structure(const std::string& name) const {
  const auto found = entries_.find(name);
  return found == entries_.end() ? nullptr : &found->second;
}

std::vector<LatestValues::Row> LatestValues::rows(const std::string& filter, bool out_alone) const {
  std::vector<Row> rows;
  for (const auto& [name, entry] : entries_) {
    for (const auto& field : entry.report.fields) {
      std::string parameter = name + "." + field.name;
      if (!filter.empty() && name != filter && !parameter.starts_with(filter)) continue;
      const bool out = field.limit == mission::LimitState::yellow || field.limit == mission::LimitState::red;
      if (out_alone && !out) continue;
      rows.push_back({std::move(parameter), field, entry.received});
    }
  }
  return rows;
}

std::string age_text(nanoseconds age) {
  constexpr std::int64_t minute = 60;
  constexpr std::int64_t hour = 3600;
  constexpr std::int64_t day = 86400;
  const std::int64_t whole = age / seconds(1);
  if (whole < 2 * minute) return fmt::format("{} s", whole);
  if (whole < 2 * hour) return fmt::format("{} min", whole / minute);
  if (whole < 2 * day) return fmt::format("{} h", whole / hour);
  return fmt::format("{} d", whole / day);
}

std::string to_screen(const std::vector<LatestValues::Row>& rows, UtcTime now, std::size_t lines,
                      bool colour) {
  std::string screen;
  std::size_t shown = 0;
  for (const LatestValues::Row& row : rows) {
    if (rows.size() > lines && shown + 1 >= lines) break;
    ++shown;
    const bool out =
        row.field.limit == mission::LimitState::yellow || row.field.limit == mission::LimitState::red;
    const std::string value = for_terminal(row.field.text) +
                              (row.field.unit.empty() || !row.field.known ? "" : " " + row.field.unit);
    std::string line = fmt::format("{:<46} {:<28} {:>8}", row.parameter, value, age_text(now - row.received));
    if (out) line += fmt::format("  {}", to_text(row.field.limit));
    if (out && colour) line = "\033[31;1m" + line + "\033[0m";
    screen += line + "\n";
  }
  if (shown < rows.size()) screen += fmt::format("... and {} more\n", rows.size() - shown);
  return screen;
}

}  // namespace srfs::ground
