// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <string_view>

#include "base/fd.hpp"
#include "cfdp/file_store.hpp"

namespace srfs::cfdp {

/// Where a name leads: its last part, and the folder that part stands in.
struct Place {
  Fd folder;
  std::string name;
};

/// Follows a relative name below the open folder @p root. Parts that are empty, "." or ".." or begin with a
/// dot are refused, and no symbolic link is followed on the way, so no name leaves the root, whatever is put
/// below it.
[[nodiscard]] FileResult<Place> locate(int root, std::string_view name);
/// The same for a folder; "" is the root itself.
[[nodiscard]] FileResult<Fd> open_folder(int root, std::string_view name);

/// What an errno value means.
[[nodiscard]] FileFault fault_of(int error);

}  // namespace srfs::cfdp
