// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "nodes/ttc/link/key_selection.hpp"

#include <charconv>

#include <fmt/format.h>

#include "base/checked_text.hpp"

namespace srfs {
namespace {

constexpr std::size_t channels_max = 64;

/// Takes digits off the front. nullopt: there are none, or too many.
template <class Number>
std::optional<Number> take_number(std::string_view& text) {
  Number number = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), number);
  if (error != std::errc()) return std::nullopt;
  text.remove_prefix(static_cast<std::size_t>(end - text.data()));
  return number;
}

}  // namespace

std::string encode_key_selection(const KeySelection& selection) {
  std::string text = fmt::format("{}", selection.generation);
  for (const auto& [vc, set] : selection.sets) text += fmt::format(" {}:{}", vc, to_text(set));
  return with_check(text);
}

std::optional<KeySelection> decode_key_selection(std::string_view text) {
  const auto whole_text = without_check(text);
  if (!whole_text) return std::nullopt;
  std::string_view body = *whole_text;
  KeySelection selection;
  const auto generation = take_number<std::uint64_t>(body);
  if (!generation) return std::nullopt;
  selection.generation = *generation;
  while (!body.empty()) {
    if (body.front() != ' ') return std::nullopt;
    body.remove_prefix(1);
    const auto vc = take_number<std::uint8_t>(body);
    const bool whole = vc && *vc < channels_max && (body.starts_with(":a") || body.starts_with(":b"));
    if (!whole) return std::nullopt;
    selection.sets[*vc] = body[1] == 'a' ? KeySet::a : KeySet::b;
    body.remove_prefix(2);
  }
  return selection;
}

StateFile<KeySelection> key_selection_file(const std::filesystem::path& path) {
  constexpr StateCodec<KeySelection> codec{
      .encode = encode_key_selection,
      .decode = decode_key_selection,
      .is_newer = [](const KeySelection& selection,
                     const KeySelection& than) { return selection.generation > than.generation; },
  };
  return {path.string() + ".0", path.string() + ".1", codec};
}

}  // namespace srfs
