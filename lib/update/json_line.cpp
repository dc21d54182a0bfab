// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "update/json_line.hpp"

#include <algorithm>

#include <fmt/format.h>

#include "base/crc32c.hpp"
#include "base/text.hpp"

namespace srfs::update {
namespace {

std::string checksum(std::string_view text) {
  return fmt::format("{:08x}", crc32c(as_octets(text)));
}

}  // namespace

std::string to_checked_line(const Json& json) {
  const std::string text = json.dump(-1, ' ', false, Json::error_handler_t::replace);
  return fmt::format("{}\n{}\n", text, checksum(text));
}

std::optional<Json> from_checked_line(std::string_view text) {
  const std::size_t end = text.find('\n');
  if (end == std::string_view::npos) return std::nullopt;
  const std::string_view line = text.substr(0, end);
  if (text.substr(end) != fmt::format("\n{}\n", checksum(line))) return std::nullopt;
  Json json = Json::parse(line, nullptr, false);
  if (!json.is_object()) return std::nullopt;
  return json;
}

std::string plain_text(std::string_view text, std::size_t longest) {
  std::string kept(text.substr(0, longest));
  std::replace_if(
      kept.begin(), kept.end(), [](char c) { return c < ' ' || c > '~'; }, '?');
  return kept;
}

}  // namespace srfs::update
