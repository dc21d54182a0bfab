// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "cfdp/safe_name.hpp"

#include <fmt/format.h>

namespace srfs::cfdp {
namespace {

constexpr std::string_view safe_marks = "._-+=,@~/";

bool is_safe(char c) {
  return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9') ||
         safe_marks.find(c) != std::string_view::npos;
}

/// A shared library's name, "libx.so" or "libx.so.1": a program that is run beside it might load it. Its dot
/// is written like an unsafe octet.
void hide_library(std::string& name) {
  constexpr std::string_view suffix = ".so";
  constexpr std::string_view hidden = "%2Eso";
  for (auto at = name.find(suffix); at != std::string::npos; at = name.find(suffix, at + 1)) {
    const auto end = at + suffix.size();
    if (end == name.size() || name[end] == '.' || name[end] == '/') name.replace(at, suffix.size(), hidden);
  }
}

}  // namespace

std::string safe_name(std::string_view name) {
  std::string safe;
  for (const char c : name) {
    const bool begins_part = safe.empty() || safe.back() == '/';
    if (is_safe(c) && !(begins_part && c == '-')) {
      safe += c;
    } else {
      safe += fmt::format("%{:02X}", static_cast<unsigned char>(c));
    }
  }
  hide_library(safe);
  return safe;
}

}  // namespace srfs::cfdp
