// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>

#include <nlohmann/json.hpp>

#include "image/detections.hpp"
#include "image/file/calibrator.hpp"
#include "image/frame.hpp"
#include "image/tracklet_linker.hpp"

/// Findings as JSON: what srfs-detect prints and what goes down from a task have the same names (README.md).
namespace srfs::image {

using Json = nlohmann::ordered_json;

[[nodiscard]] Json to_json(const Star& star, int frame);
[[nodiscard]] Json to_json(const Streak& streak, int frame);
[[nodiscard]] Json to_json(const Tracklet& tracklet);
/// Of pixel (x, y): X = dx + a x - b y, Y = dy + b x + a y in the reference frame; null where there is none.
[[nodiscard]] Json to_json(const FrameRegistration& registration);
[[nodiscard]] Json to_json(const std::optional<Attitude>& attitude);
[[nodiscard]] Json to_json(const Defect& defect);
[[nodiscard]] Json to_json(const StoredMaster& master);

/// @param file  as it is named in the report
[[nodiscard]] Json frame_summary(const std::string& file, const Frame& frame, const FrameFindings& found);

/// Adds the generations of the masters to a frame's summary.
void name_masters(const Calibrator::Applied& applied, Json& summary);

}  // namespace srfs::image
