// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "ground/archive/gap_finder.hpp"

#include <utility>

namespace srfs::ground {

std::optional<GapFinder::Last> GapFinder::last(std::uint16_t apid) const {
  const auto known = last_.find(apid);
  return known == last_.end() ? std::nullopt : std::optional(known->second);
}

std::optional<Gap> GapFinder::on_packet(std::uint16_t apid, std::uint16_t sequence, UtcTime time) {
  const auto known = last_.find(apid);
  if (known == last_.end()) {
    last_[apid] = {sequence, time};
    return std::nullopt;
  }
  const auto before = known->second;
  const auto first = static_cast<std::uint16_t>((before.sequence + 1) % modulus);
  const auto missing = static_cast<std::uint16_t>((sequence + modulus - first) % modulus);
  if (missing >= modulus - late_max && time <= before.time) return std::nullopt;
  known->second = {sequence, time};
  if (missing == 0) return std::nullopt;
  Gap gap{.apid = apid, .first = first, .count = missing, .from = before.time, .to = time};
  if (missing >= modulus / 2) gap.count = std::nullopt;
  if (gap.to < gap.from) std::swap(gap.from, gap.to);
  return gap;
}

}  // namespace srfs::ground
