// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>
#include <string>
#include <string_view>

namespace srfs {

/// A small state file: a text that says whether it is whole. CRC-32C behind it, one line more.
[[nodiscard]] std::string with_check(const std::string& text);
/// The text; nullopt: damaged, cut or empty.
[[nodiscard]] std::optional<std::string> without_check(std::string_view stored);

}  // namespace srfs
