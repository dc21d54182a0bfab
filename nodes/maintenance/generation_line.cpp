// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "nodes/maintenance/generation_line.hpp"

namespace srfs {
namespace {

constexpr std::size_t longest_name = 32;
constexpr std::size_t longest_time = 24;
constexpr std::size_t longest_origin = 60;
constexpr std::size_t longest_content = 200;

}  // namespace

std::vector<mission::ParameterGenerationHousekeeping> to_mission(
    const std::string& node, const srfs_msgs::srv::SaveParameters_Response& said) {
  mission::ParameterGenerationHousekeeping line;
  line.node = node.substr(0, longest_name);
  line.trial_left_s = (said.trial_left_ms + 999) / 1000;
  line.current = true;
  if (said.history.empty()) return {line};
  std::vector<mission::ParameterGenerationHousekeeping> lines;
  for (const auto& generation : said.history) {
    line.current = lines.empty();
    line.number = generation.number;
    line.values = generation.count;
    line.saved = generation.saved.substr(0, longest_time);
    line.origin = generation.origin.substr(0, longest_origin);
    line.content = generation.values.substr(0, longest_content);
    lines.push_back(line);
  }
  return lines;
}

}  // namespace srfs
