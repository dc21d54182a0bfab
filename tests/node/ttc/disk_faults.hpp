// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <filesystem>

namespace srfs::testing_support {

enum class DiskFault : std::uint8_t {
  none,
  full,       ///< ENOSPC where a file would grow or begin; in place is written
  read_only,  ///< EROFS at every opening for writing, writing and renaming
  failing,    ///< EIO at every write and sync
};

/// From now on the regular files below @p folder are on such a disk, for this whole process.
void set_disk_fault(DiskFault fault, const std::filesystem::path& folder);

}  // namespace srfs::testing_support
