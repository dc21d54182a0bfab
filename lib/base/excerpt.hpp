// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <string_view>

namespace srfs {

/// Foreign text for a message of ours: whole up to @p longest octets, else its begin and "...", together
/// @p longest at most (at least 3), never cut within a UTF-8 character.
[[nodiscard]] inline std::string excerpt(std::string_view text, std::size_t longest = 64) {
  constexpr std::string_view more = "...";
  if (text.size() <= longest) return std::string(text);
  std::size_t end = longest - more.size();
  constexpr unsigned char continues = 0x80;  // 10xxxxxx
  while (end > 0 && (static_cast<unsigned char>(text[end]) & 0xC0U) == continues) --end;
  return std::string(text.substr(0, end)).append(more);
}

}  // namespace srfs
