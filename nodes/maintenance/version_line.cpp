// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "nodes/maintenance/version_line.hpp"

#include "base/saturate.hpp"

#include <algorithm>

namespace srfs {
namespace {

constexpr std::size_t longest_name = 32;
constexpr std::size_t longest_text = 40;

}  // namespace

mission::NodeVersionHousekeeping to_mission(const std::string& node, const update::VersionTable& table,
                                            const update::Version* version) {
  mission::NodeVersionHousekeeping line;
  line.node = node.substr(0, longest_name);
  line.version = version == nullptr ? update::golden : version->number;
  line.active = table.active() == line.version;
  line.last_good = table.last_good() == line.version;
  line.state = mission::VersionState::golden;
  if (version == nullptr) return line;
  line.state = static_cast<mission::VersionState>(version->state);
  line.octets = as_u32(version->octets);
  line.added_s = static_cast<std::uint64_t>(std::max<std::int64_t>(version->added.ns() / 1'000'000'000, 0));
  line.probation_s = static_cast<std::uint32_t>(version->probation / seconds(1));
  line.sha256 = version->sha256;
  line.origin = version->origin.substr(0, longest_text);
  line.reason = version->reason.substr(0, longest_text);
  return line;
}

}  // namespace srfs
