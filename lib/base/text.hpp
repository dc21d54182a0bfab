// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <charconv>
#include <optional>
#include <string_view>
#include <type_traits>

#include "base/octets.hpp"

namespace srfs {

/// The same memory seen as octets. @pre it outlives the view
[[nodiscard]] inline OctetView as_octets(std::string_view text) {
  return {reinterpret_cast<const std::uint8_t*>(text.data()), text.size()};
}

/// The same memory seen as text. @pre it outlives the view
[[nodiscard]] inline std::string_view as_text(OctetView octets) {
  return {reinterpret_cast<const char*>(octets.data()), octets.size()};
}

/// The number that the whole of a text is; without spaces and plus sign. Real numbers may be infinite or NaN.
/// @return nullopt: it is none, or beyond what T holds
template <class T>
[[nodiscard]] std::optional<T> to_number(std::string_view text, int base = 10) {
  T value{};
  const char* const end = text.data() + text.size();
  std::from_chars_result read{};
  if constexpr (std::is_floating_point_v<T>)
    read = std::from_chars(text.data(), end, value);
  else
    read = std::from_chars(text.data(), end, value, base);
  return read.ec == std::errc() && read.ptr == end ? std::optional(value) : std::nullopt;
}

}  // namespace srfs
