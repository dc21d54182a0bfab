// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "base/result.hpp"
#include "base/time.hpp"

namespace srfs::ground {

/// "5", "5s", "200ms", "2min" or "2m", "1h": seconds without a unit, at most a week. nullopt: anything else.
[[nodiscard]] std::optional<milliseconds> parse_duration(std::string_view text);

/// When a telecommand is to be released on board: "2026-11-22T10:00:00Z", or "+30s" from when it is sent.
struct TimeTag {
  std::optional<UtcTime> absolute;
  milliseconds after{0};  ///< without an absolute time

  [[nodiscard]] UtcTime at(UtcTime now) const { return absolute.value_or(now + after); }
};
[[nodiscard]] std::optional<TimeTag> parse_time_tag(std::string_view text);
inline constexpr std::string_view time_tag_forms =
    "a UTC time like 2026-11-22T10:00:00Z, or +200ms, +30s, +10m, +2h";

using Words = std::vector<std::string>;
/// What stands between spaces in a line; in "quotes" a space belongs to the word.
[[nodiscard]] Words words_of(std::string_view line);
/// Takes "--timeout DURATION" out of the words. @return what it says, if it is there; the error is a message
[[nodiscard]] Result<std::optional<milliseconds>, std::string> take_timeout(Words& words);
/// Takes "--at TIME" out, likewise.
[[nodiscard]] Result<std::optional<TimeTag>, std::string> take_time_tag(Words& words);

}  // namespace srfs::ground
