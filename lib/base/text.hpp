// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string_view>

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

}  // namespace srfs
