// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "nodes/ttc/link/key_selection.hpp"

#include <array>
#include <charconv>

#include <fmt/format.h>

#include "nodes/ttc/checked_text.hpp"

namespace srfs {
namespace {

constexpr std::size_t channels_max = 64;
constexpr std::size_t copy_octets_max = 1024;

/// Takes digits off the front. nullopt: there are none, or too many.
template <class Number>
std::optional<Number> take_number(std::string_view& text) {
  Number number = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), number);
  if (error != std::errc()) return std::nullopt;
  text.remove_prefix(static_cast<std::size_t>(end - text.data()));
  return number;
}

std::array<std::filesystem::path, 2> copies_of(const std::filesystem::path& path) {
  return {path.string() + ".0", path.string() + ".1"};
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

FoundKeySelection load_key_selection(const std::filesystem::path& path) {
  FoundKeySelection found;
  for (const auto& copy : copies_of(path)) {
    const auto text = read_file(copy, copy_octets_max);
    std::error_code ec;
    if (!text && !std::filesystem::exists(copy, ec)) continue;
    found.existed = true;
    const auto selection = text ? decode_key_selection(*text) : std::nullopt;
    if (!selection) {
      ++found.damaged_copies;
    } else if (selection->generation >= found.selection.generation) {
      found.selection = *selection;
    }
  }
  return found;
}

Result<void, FileError> store_key_selection(const std::filesystem::path& path,
                                            const KeySelection& selection) {
  const std::string text = encode_key_selection(selection);
  Result<void, FileError> outcome;
  bool one_is_durable = false;
  for (const auto& copy : copies_of(path)) {
    auto written = write_file_atomically(copy, text);
    one_is_durable = one_is_durable || written.has_value();
    if (!written) outcome = std::move(written);
  }
  return one_is_durable ? Result<void, FileError>{} : outcome;
}

}  // namespace srfs
