// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <string_view>

namespace srfs::cfdp {

/// The name of a file that came, in letters, digits and `._-+=,@~` alone: other octets are written as %1B,
/// a minus at the beginning of a part and the dot of a library's name (libx.so) too. '/' parts folders, as
/// ever. Different names stay different.
[[nodiscard]] std::string safe_name(std::string_view name);

}  // namespace srfs::cfdp
