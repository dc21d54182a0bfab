// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstdint>
#include <filesystem>
#include <optional>
#include <string_view>

#include "base/file.hpp"

namespace srfs::image {

/// What is known of a stored frame: a small file beside it (0001.fits, 0001.detected). image_processing says
/// detected or nothing, ttc says sent. The frame store never removes what has a detection that was not sent.
///
///   detected  a line "METHOD RUN" for each method that found something, of its latest run that did
///   sent      a line "RUN" for each of these runs whose products are on the ground
///
/// An empty mark is of no run, such as a person's: an empty `detected` is a detection, an empty `sent` says
/// that all that was found until then is sent.
enum class FrameMark { detected, nothing, sent };

/// One run of the processing, in the marks as eight hexadecimal digits. 0: not known.
using ProcessingRun = std::uint32_t;
/// The run that a goal of /image/process is. Never 0.
[[nodiscard]] ProcessingRun run_of_goal(const std::array<std::uint8_t, 16>& goal_id);

// All block on the disk. The writing ones hold across power loss; a frame that is gone takes no mark, which
// is no error.

/// An empty mark.
[[nodiscard]] Result<void, FileError> mark_frame(const std::filesystem::path& frame, FrameMark mark);
/// A run found something: instead of what an earlier run of the method found. Another process may mark the
/// frame as sent at the same time.
[[nodiscard]] Result<void, FileError> mark_detected(const std::filesystem::path& frame,
                                                    std::string_view method, ProcessingRun run);
/// The ground has the products of a run; nothing: it has the frame as it is, so all that is in it.
[[nodiscard]] Result<void, FileError> mark_sent(const std::filesystem::path& frame,
                                                std::optional<ProcessingRun> run);

[[nodiscard]] bool has_mark(const std::filesystem::path& frame, FrameMark mark);
/// Whether mark_sent() would say something new: of a run only where this frame's detection is of it, or where
/// nothing was found.
[[nodiscard]] bool lacks_sent_mark(const std::filesystem::path& frame, std::optional<ProcessingRun> run);
/// Whether a detection is in it that the ground has not. A mark that cannot be read counts as one.
[[nodiscard]] bool has_unsent_detection(const std::filesystem::path& frame);

/// The file that is the mark.
[[nodiscard]] std::filesystem::path mark_path(const std::filesystem::path& frame, FrameMark mark);

}  // namespace srfs::image
