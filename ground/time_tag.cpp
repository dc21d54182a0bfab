// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "ground/time_tag.hpp"

#include <algorithm>
#include <cctype>
#include <cmath>
#include <utility>

#include <fmt/format.h>

#include "base/text.hpp"

namespace srfs::ground {
namespace {

constexpr double longest_s = 7 * 86400.0;

/// @param parse  the word behind the option @return nothing: no such option
template <class Parse>
auto take_option(Words& words, std::string_view name, std::string_view needs, const Parse& parse)
    -> Result<decltype(parse("")), std::string> {
  const auto option = std::find(words.begin(), words.end(), name);
  if (option == words.end()) return std::nullopt;
  const auto value = std::next(option) == words.end() ? std::nullopt : parse(*std::next(option));
  if (!value) return Err(fmt::format("{} needs {}", name, needs));
  words.erase(option, option + 2);
  return value;
}

}  // namespace

std::optional<milliseconds> parse_duration(std::string_view text) {
  double factor_ms = 1000;
  for (const auto& [unit, factor] : {std::pair<std::string_view, double>{"ms", 1},
                                     {"min", 60000},
                                     {"s", 1000},
                                     {"m", 60000},
                                     {"h", 3600000}}) {
    if (text.size() <= unit.size() || !text.ends_with(unit)) continue;
    text.remove_suffix(unit.size());
    factor_ms = factor;
    break;
  }
  const double value = to_number<double>(text).value_or(-1);
  if (!std::isfinite(value) || value < 0 || value * factor_ms > longest_s * 1000) return std::nullopt;
  return milliseconds(static_cast<std::int64_t>(value * factor_ms));
}

std::optional<TimeTag> parse_time_tag(std::string_view text) {
  TimeTag tag;
  if (text.starts_with('+')) {
    const auto after = parse_duration(text.substr(1));
    if (!after) return std::nullopt;
    tag.after = *after;
    return tag;
  }
  tag.absolute = from_iso8601(std::string(text));
  return tag.absolute ? std::optional(tag) : std::nullopt;
}

Words words_of(std::string_view line) {
  Words words;
  std::string word;
  bool begun = false;
  bool quoted = false;
  const auto end = [&] {
    if (begun) words.push_back(std::exchange(word, ""));
    begun = false;
  };
  for (const char c : line) {
    if (c == '"') {
      quoted = !quoted;
      begun = true;
    } else if (!quoted && std::isspace(static_cast<unsigned char>(c)) != 0) {
      end();
    } else {
      word += c;
      begun = true;
    }
  }
  end();
  return words;
}

Result<std::optional<milliseconds>, std::string> take_timeout(Words& words) {
  return take_option(words, "--timeout", "a duration like 5s, 200ms or 2min", [](std::string_view text) {
    const auto duration = parse_duration(text);
    return duration != milliseconds(0) ? duration : std::nullopt;
  });
}

Result<std::optional<TimeTag>, std::string> take_time_tag(Words& words) {
  return take_option(words, "--at", time_tag_forms, parse_time_tag);
}

}  // namespace srfs::ground
