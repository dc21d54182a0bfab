// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <filesystem>

namespace srfs::testing_support {

enum class DiskFault : std::uint8_t {
  none,
  full,       ///< ENOSPC when a file grows or is created; writes in place succeed
  read_only,  ///< EROFS at every open for writing, write and rename
  failing,    ///< EIO at every write and sync
};

/// Applies the fault to the regular files below @p folder, for this whole process.
void set_disk_fault(DiskFault fault, const std::filesystem::path& folder);

}  // namespace srfs::testing_support
