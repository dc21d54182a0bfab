// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "image/file/frame_mark.hpp"
#include "image/method.hpp"

namespace srfs {

/// What a goal of /image/process asks for, as it came.
struct ProcessRequest {
  std::uint32_t task = 0;
  std::vector<std::string> files;  ///< below the folder of images
  std::string method;
  std::string parameters;  ///< "name=value", separated by commas
  std::uint32_t budget_octets = 0;
  bool full_frames = false;
  image::ProcessingRun run = 0;  ///< for the frames' marks
};

/// The same, checked.
struct TaskOrder {
  ProcessRequest request;
  const image::MethodEntry* method = nullptr;  ///< nullptr: full frames only
  image::Parameters parameters;
};

/// Why a goal is not begun, or ended without its products.
struct TaskRefusal {
  std::uint16_t failure_code = 0;  ///< of the mission dictionary
  std::string reason;
};

/// A goal without a method is one for full frames. Pure.
[[nodiscard]] Result<TaskOrder, TaskRefusal> check_request(ProcessRequest request);

/// Where a stored frame is. Refused: names that lead out of the folder, by links too, or to hidden files.
/// Reads the disk.
[[nodiscard]] Result<std::filesystem::path, image::Refusal> frame_path(const std::filesystem::path& images,
                                                                       const std::string& file);

/// Does the method look for debris? The others leave the frames' marks as they are.
[[nodiscard]] bool looks_for_debris(std::string_view method);

}  // namespace srfs
