// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "ros/node_directory.hpp"

#include <algorithm>
#include <string_view>

#include "ros/serialized.hpp"

namespace srfs::ros {
namespace {

/// @return whether the text ended so
bool take_end(std::string& text, std::string_view end) {
  if (!text.ends_with(end)) return false;
  text.resize(text.size() - end.size());
  return true;
}

/// An endpoint of an action, by the one topic or service of it that tells server from client.
/// @return whether it belongs to an action
bool add_of_action(NodeEnds& ends, std::string name, std::string type, bool is_service, bool is_server) {
  const std::size_t part = name.find("/_action/");
  if (part == std::string::npos) return false;
  const bool tells = is_service && name.substr(part) == "/_action/send_goal" && take_end(type, "_SendGoal");
  name.resize(part);
  if (tells) (is_server ? ends.action_servers : ends.action_clients).push_back({.name = name, .type = type});
  return true;
}

void add(NodeEnds& ends, const TopicDirectory::Endpoint& endpoint) {
  if (!belongs_to_a_node(endpoint.topic)) return;
  std::string name = endpoint.topic.substr(2);
  std::string type = ros_type_name(endpoint.type);
  if (type.empty()) return;
  if (endpoint.topic.starts_with("rt/")) {
    if (!add_of_action(ends, name, type, false, endpoint.is_publisher))
      (endpoint.is_publisher ? ends.publishers : ends.subscriptions)
          .push_back({name, type, endpoint.best_effort, endpoint.transient_local});
  } else if (endpoint.topic.starts_with("rq/") && take_end(name, "Request") && take_end(type, "_Request")) {
    const bool is_server = !endpoint.is_publisher;  // it reads the requests
    if (!add_of_action(ends, name, type, true, is_server))
      (is_server ? ends.services : ends.clients).push_back({.name = name, .type = type});
  }
}

bool is_empty(const NodeEnds& ends) {
  return ends.publishers.empty() && ends.subscriptions.empty() && ends.services.empty() &&
         ends.clients.empty() && ends.action_servers.empty() && ends.action_clients.empty();
}

void sort(NodeEnds& ends) {
  for (auto* list : {&ends.publishers, &ends.subscriptions, &ends.services, &ends.clients,
                     &ends.action_servers, &ends.action_clients}) {
    std::sort(list->begin(), list->end());
    list->erase(std::unique(list->begin(), list->end()), list->end());
  }
}

}  // namespace

void NodeDirectory::keep(const Gid& participant, Nodes nodes) {
  if (participants_.size() >= most && !participants_.contains(participant)) {
    ++forgotten_;
    return;
  }
  participants_[participant] = std::move(nodes);
}

std::vector<NodeEnds> NodeDirectory::nodes(const std::vector<TopicDirectory::Endpoint>& endpoints) const {
  std::map<Gid, const TopicDirectory::Endpoint*> left;
  for (const TopicDirectory::Endpoint& endpoint : endpoints) left.emplace(endpoint.gid, &endpoint);
  std::map<std::string, NodeEnds> found;  // two nodes of one name are shown as one
  for (const auto& [participant, nodes] : participants_) {
    for (const Node& node : nodes) {
      NodeEnds& ends = found[node.name];
      ends.node = node.name;
      for (const Gid& gid : node.endpoints) {
        const auto endpoint = left.find(gid);
        if (endpoint == left.end()) continue;
        add(ends, *endpoint->second);
        left.erase(endpoint);
      }
    }
  }
  std::vector<NodeEnds> nodes;
  for (auto& [name, ends] : found) nodes.push_back(std::move(ends));
  NodeEnds nobodys;
  for (const auto& [gid, endpoint] : left) add(nobodys, *endpoint);
  if (!is_empty(nobodys)) nodes.push_back(std::move(nobodys));
  for (NodeEnds& ends : nodes) sort(ends);
  return nodes;
}

}  // namespace srfs::ros
