// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "ground/terminal_text.hpp"

#include <cstddef>
#include <cstdint>

#include <fmt/format.h>

namespace srfs::ground {
namespace {

struct Character {
  std::uint32_t code = 0;
  std::size_t octets = 0;  ///< 0: no UTF-8
};

/// The first character of a text that is not empty.
Character first_of(std::string_view text) {
  const auto octet = [&](std::size_t i) { return static_cast<std::uint8_t>(text[i]); };
  const std::uint8_t lead = octet(0);
  if (lead < 0x80) return {lead, 1};
  const std::size_t octets = lead >= 0xF0 ? 4 : lead >= 0xE0 ? 3 : 2;
  if (lead < 0xC2 || lead > 0xF4 || text.size() < octets) return {};
  std::uint32_t code = lead & (0x7FU >> octets);
  for (std::size_t i = 1; i < octets; ++i) {
    if ((octet(i) & 0xC0U) != 0x80) return {};
    code = code << 6U | (octet(i) & 0x3FU);
  }
  const bool overlong = (octets == 3 && code < 0x800) || (octets == 4 && code < 0x10000);
  const bool is_character = code <= 0x10FFFF && (code < 0xD800 || code > 0xDFFF);
  return overlong || !is_character ? Character{} : Character{code, octets};
}

bool is_plain(std::uint32_t code) {
  const auto within = [code](std::uint32_t first, std::uint32_t last) {
    return code >= first && code <= last;
  };
  if (code < 0x20 || within(0x7F, 0x9F)) return false;
  // Of no width, or turning the direction of writing; separators of lines.
  return !(code == 0xAD || code == 0x61C || code == 0x180E || within(0x200B, 0x200F) ||
           within(0x2028, 0x202E) || within(0x2060, 0x206F) || code == 0xFEFF || within(0xFFF9, 0xFFFB) ||
           within(0xE0000, 0xE0FFF));
}

}  // namespace

std::string for_terminal(std::string_view text) {
  std::string shown;
  while (!text.empty()) {
    const Character character = first_of(text);
    if (character.octets == 0 || (character.octets == 1 && !is_plain(character.code))) {
      shown += fmt::format("\\x{:02x}", static_cast<std::uint8_t>(text.front()));
    } else if (!is_plain(character.code)) {
      shown += fmt::format("\\u{:04x}", character.code);
    } else if (character.code == '\\') {
      shown += "\\\\";
    } else {
      shown += text.substr(0, character.octets);
    }
    text.remove_prefix(character.octets == 0 ? 1 : character.octets);
  }
  return shown;
}

std::string valid_utf8(std::string_view text) {
  std::string valid;
  while (!text.empty()) {
    const Character character = first_of(text);
    const bool stays = character.octets > 0 && character.code != 0;
    valid += stays ? text.substr(0, character.octets) : std::string_view("\uFFFD");
    text.remove_prefix(stays ? character.octets : 1);
  }
  return valid;
}

}  // namespace srfs::ground
