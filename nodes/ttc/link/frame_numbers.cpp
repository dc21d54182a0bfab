// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "nodes/ttc/link/frame_numbers.hpp"

#include <algorithm>
#include <string>

#include <fmt/format.h>

#include "base/checked_text.hpp"
#include "base/text.hpp"
#include "wire/tm_sdls.hpp"

namespace srfs {
namespace {

std::string encode_reserve(const std::uint64_t& reserved) {
  return with_check(fmt::format("{}", reserved));
}

std::optional<std::uint64_t> decode_reserve(std::string_view text) {
  const auto body = without_check(text);
  const auto number = body ? to_number<std::uint64_t>(*body) : std::nullopt;
  return number && *number <= wire::tm_sdls_number_max ? number : std::nullopt;
}

}  // namespace

std::uint64_t frame_number_of(UtcTime utc) {
  const std::int64_t milliseconds_utc = std::max<std::int64_t>(utc.ns() / 1'000'000, 0);
  return 2 * static_cast<std::uint64_t>(milliseconds_utc) + 1;
}

std::uint64_t FrameNumbers::take(std::optional<UtcTime> utc) {
  const std::uint64_t clock = utc ? frame_number_of(*utc) : 0;
  const bool follows = clock >= next_ && clock < reserved_;
  const bool is_clock = follows || (utc && clock < next_ && next_ - clock <= clock_slack);
  const std::uint64_t least = follows ? clock : next_;
  const std::uint64_t parity = is_clock ? 1 : 0;
  const std::uint64_t number = least % 2 == parity ? least : least + 1;
  next_ = std::min(number + 1, wire::tm_sdls_number_max);
  return number;
}

std::optional<std::uint64_t> FrameNumbers::wanted(std::optional<UtcTime> utc) const {
  const std::uint64_t due = std::max(next_, utc ? frame_number_of(*utc) : 0);
  if (reserved_ > due + reserved_ahead / 2) return std::nullopt;
  return std::min(due + reserved_ahead, wire::tm_sdls_number_max);
}

std::uint64_t first_frame_number(std::optional<std::uint64_t> in_memory,
                                 std::optional<std::uint64_t> reserved, UtcTime clock) {
  // Someone else (srfs_rescue) went on from the reserve when it is further ahead than the process before left
  // it.
  const bool is_newest = in_memory && (!reserved || *in_memory + FrameNumbers::reserved_ahead > *reserved);
  if (is_newest) return *in_memory;
  return reserved.value_or(frame_number_of(clock));
}

StateFile<std::uint64_t> frame_number_file(const std::filesystem::path& path) {
  constexpr StateCodec<std::uint64_t> codec{
      .encode = encode_reserve,
      .decode = decode_reserve,
      .is_newer = [](const std::uint64_t& reserved, const std::uint64_t& than) { return reserved > than; }};
  return {path.string() + ".0", path.string() + ".1", codec};
}

}  // namespace srfs
