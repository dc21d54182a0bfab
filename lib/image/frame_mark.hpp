#pragma once

#include <filesystem>

#include "base/file.hpp"

namespace srfs::image {

/// What is known of a stored frame: an empty file beside it (0001.fits, 0001.detected). image_processing says
/// detected or nothing, ttc says sent. The frame store removes what has a detection that was not sent last.
enum class FrameMark { detected, nothing, sent };

/// Marks a stored frame, for good also across power loss. Blocks on the disk.
/// @return why it could not be written; a frame that is gone takes no mark, which is no error
[[nodiscard]] Result<void, FileError> mark_frame(const std::filesystem::path& frame, FrameMark mark);

[[nodiscard]] bool has_mark(const std::filesystem::path& frame, FrameMark mark);

/// The file that is the mark.
[[nodiscard]] std::filesystem::path mark_path(const std::filesystem::path& frame, FrameMark mark);

}  // namespace srfs::image
