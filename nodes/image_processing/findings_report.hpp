// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "image/product/findings_json.hpp"

namespace srfs {

/// A streak and the frame it is in.
struct FoundStreak {
  int frame;
  image::Streak streak;
};

/// All that a task found, but for the stars.
struct TaskFindings {
  std::uint32_t task = 0;
  std::string method;
  std::string parameters;
  std::vector<image::Json> frames;  ///< summaries (image/findings_json.hpp), in order
  std::vector<image::Json> refused;
  std::vector<FoundStreak> streaks;  ///< most significant first
  std::vector<image::Tracklet> tracklets;
  std::vector<image::Defect> defects;
  std::optional<image::Attitude> attitude;       ///< of the last frame that has one
  std::vector<image::StoredMaster> calibration;  ///< what the frames were freed of before
  std::optional<image::StoredMaster> master;     ///< that the task made
};

/// findings.json in at most @p budget octets: attitude first, then tracklets, streaks and defects, the most
/// significant of each, then the summaries of the frames in a quarter of the budget. How many had no room
/// stands in `left_out`. Pure.
/// @return nothing where not even the frame of it fits
[[nodiscard]] std::optional<std::string> findings_text(const TaskFindings& findings, std::size_t budget);

}  // namespace srfs
