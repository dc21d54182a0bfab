// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <limits>
#include <optional>
#include <string>
#include <string_view>
#include <type_traits>

#include <nlohmann/json.hpp>

namespace srfs::update {

/// Small tables as files: one line of JSON and a line with its CRC-32C. Of the library alone.
using Json = nlohmann::ordered_json;

[[nodiscard]] std::string to_checked_line(const Json& json);
/// nullopt: torn, damaged, or no object.
[[nodiscard]] std::optional<Json> from_checked_line(std::string_view text);

/// Plain ASCII of bounded length: it goes into logs, events and onto terminals.
[[nodiscard]] std::string plain_text(std::string_view text, std::size_t longest);

/// A text, a bool, or a number that is not negative and fits. @return false: missing, or something else
template <class T>
[[nodiscard]] bool get(const Json& json, const char* key, T& value) {
  const auto found = json.find(key);
  if (found == json.end()) return false;
  if constexpr (std::is_same_v<T, std::string>) {
    if (!found->is_string()) return false;
  } else if constexpr (std::is_same_v<T, bool>) {
    if (!found->is_boolean()) return false;
  } else {
    if (!found->is_number_unsigned()) return false;
    if (found->template get<std::uint64_t>() > std::numeric_limits<T>::max()) return false;
  }
  value = found->template get<T>();
  return true;
}

}  // namespace srfs::update
