// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <vector>

#include "base/time.hpp"
#include "image/detections.hpp"

/// Measured angles as a tracking data message: CCSDS 503.0-B-2, keyword = value notation.
namespace srfs::image {

struct TrackedObject {
  std::string name;
  std::vector<std::string> comments;
  std::vector<SkyPoint> points;  ///< those without a time are left out
};

struct TrackingHeader {
  UtcTime created;
  std::string originator;
  std::string observer;
};

/// The middle of the exposure; its begin where the exposure is not known; nothing without a time.
[[nodiscard]] std::optional<UtcTime> time_of(const SkyPoint& point);

/// One segment for each object that has a point, its points by time: right ascension and declination of
/// J2000, magnitude, and the uncertainties as comments. Characters that the standard has not become '_'.
/// @return empty where no object has a point
[[nodiscard]] std::string tracking_message(const TrackingHeader& header,
                                           const std::vector<TrackedObject>& objects);

}  // namespace srfs::image
