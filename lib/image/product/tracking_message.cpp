// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "image/product/tracking_message.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

#include <fmt/format.h>

#include "image/frame.hpp"

namespace srfs::image {
namespace {

constexpr std::size_t line_most = 254;  ///< section 4.2.1 of the standard

std::string printable(const std::string& text) {
  std::string line = text.substr(0, line_most / 2);
  for (char& c : line) {
    if (c < ' ' || c > '~') c = '_';
  }
  return line.empty() ? "UNKNOWN" : line;
}

std::string utc(UtcTime time) {
  return to_iso8601(time, 6);
}

using TimedPoint = std::pair<UtcTime, const SkyPoint*>;

void append_segment(std::string& text, const TrackingHeader& header, const TrackedObject& object,
                    const std::vector<TimedPoint>& points) {
  text += fmt::format(
      "META_START\nTIME_SYSTEM = UTC\nSTART_TIME = {}\nSTOP_TIME = {}\nPARTICIPANT_1 = {}\n"
      "PARTICIPANT_2 = {}\nMODE = SEQUENTIAL\nPATH = 2,1\nANGLE_TYPE = RADEC\nREFERENCE_FRAME = EME2000\n"
      "META_STOP\nDATA_START\n",
      utc(points.front().first), utc(points.back().first), printable(header.observer),
      printable(object.name));
  for (const std::string& comment : object.comments) text += "COMMENT " + printable(comment) + "\n";
  for (const auto& [time, point] : points) {
    text += fmt::format("COMMENT {}: 1 sigma {:.3f} arcsec east, {:.3f} north, correlation {:.3f}", utc(time),
                        point->place.sigma_east_arcsec, point->place.sigma_north_arcsec,
                        point->place.correlation);
    if (point->magnitude) text += fmt::format("; magnitude V_T, 1 sigma {:.3f}", point->magnitude->sigma);
    text += "\n";
  }
  for (const auto& [time, point] : points) {
    text += fmt::format("ANGLE_1 = {} {:.7f}\nANGLE_2 = {} {:.7f}\n", utc(time), point->place.ra_deg,
                        utc(time), point->place.dec_deg);
    if (point->magnitude) text += fmt::format("MAG = {} {:.3f}\n", utc(time), point->magnitude->value);
  }
  text += "DATA_STOP\n";
}

}  // namespace

std::optional<UtcTime> time_of(const SkyPoint& point) {
  if (!point.begin_s) return std::nullopt;
  return utc_of(*point.begin_s + point.exposure_s.value_or(0) / 2);
}

std::string tracking_message(const TrackingHeader& header, const std::vector<TrackedObject>& objects) {
  const std::string head = fmt::format("CCSDS_TDM_VERS = 2.0\nCREATION_DATE = {}\nORIGINATOR = {}\n",
                                       utc(header.created), printable(header.originator));
  std::string segments;
  for (const TrackedObject& object : objects) {
    std::vector<TimedPoint> points;
    for (const SkyPoint& p : object.points) {
      if (const auto time = time_of(p)) points.emplace_back(*time, &p);
    }
    std::stable_sort(points.begin(), points.end(),
                     [](const TimedPoint& a, const TimedPoint& b) { return a.first < b.first; });
    if (!points.empty()) append_segment(segments, header, object, points);
  }
  return segments.empty() ? "" : head + segments;
}

}  // namespace srfs::image
