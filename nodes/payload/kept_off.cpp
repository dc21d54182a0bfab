// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "nodes/payload/kept_off.hpp"

#include <fmt/format.h>

#include "base/text.hpp"

namespace srfs {

std::string kept_off_text(MonotonicTime until, std::string_view boot_id) {
  return fmt::format("{} {}\n", until.ns(), boot_id);
}

std::optional<MonotonicTime> kept_off_until(std::string_view text, std::string_view boot_id) {
  const std::size_t space = text.find(' ');
  if (space == std::string_view::npos || text.substr(space + 1) != fmt::format("{}\n", boot_id))
    return std::nullopt;
  const auto ns = to_number<std::int64_t>(text.substr(0, space));
  return ns ? std::optional(MonotonicTime(nanoseconds(*ns))) : std::nullopt;
}

}  // namespace srfs
