// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "ground/archive/minutes.hpp"

#include <algorithm>
#include <cmath>

namespace srfs::ground {

void Aggregate::add(double value, mission::LimitState limit) {
  add(Aggregate{.count = 1, .min = value, .mean = value, .max = value, .worst = limit});
}

void Aggregate::add(const Aggregate& other) {
  if (other.count == 0) return;
  if (count == 0) {
    *this = other;
    return;
  }
  min = std::min(min, other.min);
  max = std::max(max, other.max);
  const double all = static_cast<double>(count + other.count);
  mean += (other.mean - mean) * static_cast<double>(other.count) / all;
  count += other.count;
  worst = std::max(worst, other.worst);
}

std::optional<double> number_in(const mission::DecodedField& field) {
  if (!field.known) return std::nullopt;
  if (const auto* u = std::get_if<std::uint64_t>(&field.value)) return static_cast<double>(*u);
  if (const auto* i = std::get_if<std::int64_t>(&field.value)) return static_cast<double>(*i);
  if (const auto* b = std::get_if<bool>(&field.value)) return *b ? 1.0 : 0.0;
  if (const auto* d = std::get_if<double>(&field.value); d != nullptr && std::isfinite(*d)) return *d;
  return std::nullopt;
}

std::string parameter_name(const TelemetryReport& report, const mission::DecodedField& field) {
  return report.name + "." + field.name;
}

std::map<std::string, Aggregate> aggregate(const std::vector<TelemetryReport>& reports) {
  std::map<std::string, Aggregate> all;
  for (const TelemetryReport& report : reports) {
    for (const auto& field : report.fields) {
      if (const auto number = number_in(field)) all[parameter_name(report, field)].add(*number, field.limit);
    }
  }
  return all;
}

std::vector<Point> thinned(const std::vector<Point>& points, std::size_t most) {
  if (points.size() <= most || most == 0) return points;
  const UtcTime begin = points.front().time;
  const auto span = (points.back().time - begin).count() / static_cast<std::int64_t>(most) + 1;
  std::vector<Point> thin;
  std::int64_t current = -1;
  for (const Point& point : points) {
    const std::int64_t index = (point.time - begin).count() / span;
    if (index != current) thin.push_back({begin + nanoseconds(index * span), {}});
    current = index;
    thin.back().values.add(point.values);
  }
  return thin;
}

}  // namespace srfs::ground
