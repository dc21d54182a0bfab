// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>
#include <array>
#include <map>
#include <string>
#include <vector>

#include "ros/graph.hpp"
#include "ros/topic_directory.hpp"

namespace srfs::ros {

/// What a node has under a name of ROS 2.
struct NamedEnd {
  std::string name;  ///< "/timing/tick"
  std::string type;  ///< "srfs_msgs/msg/TimeTick"
  /// Of a publisher or subscription.
  bool best_effort = false;
  bool transient_local = false;
  friend auto operator<=>(const NamedEnd&, const NamedEnd&) = default;
};

/// A node and its ends, each list by name.
struct NodeEnds {
  std::string node;  ///< "/timing"; empty: of endpoints that no node claims
  std::vector<NamedEnd> publishers;
  std::vector<NamedEnd> subscriptions;
  std::vector<NamedEnd> services;
  std::vector<NamedEnd> clients;
  std::vector<NamedEnd> action_servers;
  std::vector<NamedEnd> action_clients;
};

/// Which node has which endpoint, as participants state it (ros_discovery_info of rmw_dds_common): the latest
/// message of each. Pure; one thread.
class NodeDirectory {
 public:
  /// Remembers this many participants; further ones are counted.
  static constexpr std::size_t most = 512;

  template <std::size_t gid_octets>
  void on_graph(const GraphMessage<gid_octets>& message) {
    Nodes nodes;
    for (const auto& node : message.node_entities_info_seq) {
      Node& known = nodes.emplace_back();
      known.name = (node.node_namespace == "/" ? "" : node.node_namespace) + "/" + node.node_name;
      for (const auto* gids : {&node.reader_gid_seq, &node.writer_gid_seq})
        for (const auto& gid : *gids) known.endpoints.push_back(first_octets(gid.data));
    }
    keep(first_octets(message.gid.data), std::move(nodes));
  }

  /// The nodes with those of their endpoints that discovery knows, by name; then the endpoints of no node.
  [[nodiscard]] std::vector<NodeEnds> nodes(const std::vector<TopicDirectory::Endpoint>& endpoints) const;
  [[nodiscard]] std::uint64_t forgotten() const { return forgotten_; }

 private:
  struct Node {
    std::string name;
    std::vector<Gid> endpoints;
  };
  using Nodes = std::vector<Node>;

  template <std::size_t size>
  static Gid first_octets(const std::array<std::uint8_t, size>& octets) {
    Gid gid;
    std::copy_n(octets.begin(), gid.size(), gid.begin());
    return gid;
  }
  void keep(const Gid& participant, Nodes nodes);

  std::map<Gid, Nodes> participants_;
  std::uint64_t forgotten_ = 0;
};

}  // namespace srfs::ros
