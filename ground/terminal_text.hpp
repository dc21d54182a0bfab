// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <string_view>

namespace srfs::ground {

/// Text that came down, as it may stand on a terminal: what would steer that (control characters, C1 too) or
/// make a line look like another one (directions, invisible characters) and what is no UTF-8 is written as
/// \x1b or \u202e, a backslash as \\. One line stays one line.
[[nodiscard]] std::string for_terminal(std::string_view text);

/// Text that a database or a JSON reader takes: U+FFFD for each octet that is no UTF-8, and for U+0000.
[[nodiscard]] std::string valid_utf8(std::string_view text);

}  // namespace srfs::ground
