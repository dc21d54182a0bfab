// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "ros/graph.hpp"

namespace srfs::ros {

bool ParticipantGraph::add(std::vector<Gid>& gids, const Gid& gid) {
  if (std::find(gids.begin(), gids.end(), gid) != gids.end()) return false;
  gids.push_back(gid);
  return true;
}

bool belongs_to_a_node(const std::string& dds_topic) {
  return dds_topic.starts_with("rt/") || dds_topic.starts_with("rq/") || dds_topic.starts_with("rr/");
}

}  // namespace srfs::ros
