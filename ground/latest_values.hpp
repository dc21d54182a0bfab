// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <map>
#include <optional>
#include <string>
#include <vector>

#include "base/time.hpp"
#include "ground/telemetry.hpp"

namespace srfs::ground {

/// The newest packet of each housekeeping structure. Pure; memory: one packet a structure.
class LatestValues {
 public:
  struct Entry {
    TelemetryReport report;
    UtcTime received;
  };
  /// A live packet; others are ignored, and so is one that is older than the one that is known.
  void take(const TelemetryReport& report, UtcTime received);
  [[nodiscard]] const Entry* structure(const std::string& name) const;
  [[nodiscard]] const std::map<std::string, Entry>& all() const { return entries_; }

  struct Row {
    std::string parameter;  ///< STRUCTURE.FIELD
    mission::DecodedField field;
    UtcTime received;
  };
  /// @param filter  empty: all; a structure, or the beginning of a parameter
  /// @param out_alone  values outside their limits alone
  [[nodiscard]] std::vector<Row> rows(const std::string& filter, bool out_alone) const;

 private:
  std::map<std::string, Entry> entries_;
};

/// A screen of values with their age, at most so many lines: what does not fit is counted in the last one.
[[nodiscard]] std::string to_screen(const std::vector<LatestValues::Row>& rows, UtcTime now,
                                    std::size_t lines, bool colour);

/// "12 s", "3 min", "5 h", "2 d"
[[nodiscard]] std::string age_text(nanoseconds age);

}  // namespace srfs::ground
