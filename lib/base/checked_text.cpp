// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "base/checked_text.hpp"

#include <fmt/format.h>

#include "base/crc32c.hpp"
#include "base/text.hpp"

namespace srfs {

std::string with_check(const std::string& text) {
  const std::uint32_t check = crc32c(as_octets(text));
  return fmt::format("{} {:08x}\n", text, check);
}

std::optional<std::string> without_check(std::string_view stored) {
  const std::size_t end = stored.rfind(' ');
  if (end == std::string_view::npos) return std::nullopt;
  std::string text(stored.substr(0, end));
  if (with_check(text) != stored) return std::nullopt;
  return text;
}

}  // namespace srfs
