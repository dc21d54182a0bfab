// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "base/time.hpp"
#include "ground/telemetry.hpp"

namespace srfs::ground {

/// Values of one parameter in one span of time.
struct Aggregate {
  std::uint64_t count = 0;
  double min = 0;
  double mean = 0;
  double max = 0;
  mission::LimitState worst = mission::LimitState::none;

  void add(double value, mission::LimitState limit);
  void add(const Aggregate& other);
};

/// The number of a field; nullopt: it is no number, or the spacecraft does not know it.
[[nodiscard]] std::optional<double> number_in(const mission::DecodedField& field);

/// "STRUCTURE.FIELD"
[[nodiscard]] std::string parameter_name(const TelemetryReport& report, const mission::DecodedField& field);

/// All parameters of some packets, by name.
[[nodiscard]] std::map<std::string, Aggregate> aggregate(const std::vector<TelemetryReport>& reports);

struct Point {
  UtcTime time;  ///< of the value, or begin of the span
  Aggregate values;
};
/// At most @p most points over the same time: neighbours in spans of equal length become one.
[[nodiscard]] std::vector<Point> thinned(const std::vector<Point>& points, std::size_t most);

}  // namespace srfs::ground
