// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>
#include <array>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

namespace srfs::ros {

/// Layout of the messages of the ROS graph: they differ between ROS 2 releases.
enum class GraphDialect : std::uint8_t { off, humble, iron };

/// Name of an endpoint or a participant in the ROS graph: GUID prefix, then entity id.
using Gid = std::array<std::uint8_t, 16>;

/// rmw_dds_common/msg/{Gid, NodeEntitiesInfo, ParticipantEntitiesInfo} in the two layouts that ROS 2 sends
/// under one DDS type name: char[24] until Humble (the rest zero), char[16] from Iron on. Not .msg files,
/// which cannot say that.
template <std::size_t gid_octets>
struct GraphGid {
  std::array<std::uint8_t, gid_octets> data{};
  template <class Self, class V>
  static void visit(Self& s, V& v) {
    v.array(s.data);
  }
  friend bool operator==(const GraphGid&, const GraphGid&) = default;
};

template <std::size_t gid_octets>
struct GraphNode {
  std::string node_namespace;
  std::string node_name;
  std::vector<GraphGid<gid_octets>> reader_gid_seq;
  std::vector<GraphGid<gid_octets>> writer_gid_seq;
  template <class Self, class V>
  static void visit(Self& s, V& v) {
    v.string(s.node_namespace, 256);
    v.string(s.node_name, 256);
    v.sequence(s.reader_gid_seq, 0, 0);
    v.sequence(s.writer_gid_seq, 0, 0);
  }
  friend bool operator==(const GraphNode&, const GraphNode&) = default;
};

template <std::size_t gid_octets>
struct GraphMessage {
  static constexpr const char* dds_type_name = "rmw_dds_common::msg::dds_::ParticipantEntitiesInfo_";
  GraphGid<gid_octets> gid;
  std::vector<GraphNode<gid_octets>> node_entities_info_seq;
  template <class Self, class V>
  static void visit(Self& s, V& v) {
    v.value(s.gid);
    v.sequence(s.node_entities_info_seq, 0, 0);
  }
  friend bool operator==(const GraphMessage&, const GraphMessage&) = default;
};

using HumbleGraphMessage = GraphMessage<24>;
using IronGraphMessage = GraphMessage<16>;

/// Where participants publish it (DDS name).
inline constexpr const char* graph_topic = "ros_discovery_info";

/// One participant's entry in the ROS graph: its node, and the node's readers and writers. A process of the
/// suite is one node, so every endpoint under ROS 2's names is that node's.
class ParticipantGraph {
 public:
  void set_participant(const Gid& gid) { participant_ = gid; }
  /// @param name without slash; nullopt: the process is no node. @param name_space "/" or "/a/b"
  void set_node(std::optional<std::string> name, std::string name_space = "/") {
    node_ = std::move(name);
    name_space_ = std::move(name_space);
  }

  // Adding twice and removing what is not there change nothing. @return true when something changed
  bool add_reader(const Gid& gid) { return add(readers_, gid); }
  bool add_writer(const Gid& gid) { return add(writers_, gid); }
  bool remove_reader(const Gid& gid) { return std::erase(readers_, gid) > 0; }
  bool remove_writer(const Gid& gid) { return std::erase(writers_, gid) > 0; }

  /// The whole state, in the order of making: a reader of the graph replaces what it knew.
  template <std::size_t gid_octets>
  [[nodiscard]] GraphMessage<gid_octets> message() const {
    GraphMessage<gid_octets> m;
    m.gid = padded<gid_octets>(participant_);
    if (!node_) return m;
    auto& node = m.node_entities_info_seq.emplace_back();
    node.node_namespace = name_space_;
    node.node_name = *node_;
    for (const Gid& gid : readers_) node.reader_gid_seq.push_back(padded<gid_octets>(gid));
    for (const Gid& gid : writers_) node.writer_gid_seq.push_back(padded<gid_octets>(gid));
    return m;
  }

 private:
  static bool add(std::vector<Gid>& gids, const Gid& gid);
  template <std::size_t gid_octets>
  static GraphGid<gid_octets> padded(const Gid& gid) {
    GraphGid<gid_octets> out;
    std::copy(gid.begin(), gid.end(), out.data.begin());
    return out;
  }

  Gid participant_{};
  std::optional<std::string> node_;
  std::string name_space_ = "/";
  std::vector<Gid> readers_;
  std::vector<Gid> writers_;
};

/// Endpoints that ROS 2 attributes to nodes: topics (rt/) and both halves of services (rq/, rr/). The graph's
/// own topic belongs to no node.
[[nodiscard]] bool belongs_to_a_node(const std::string& dds_topic);

}  // namespace srfs::ros
