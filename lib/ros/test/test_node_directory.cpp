// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include "ros/node_directory.hpp"

namespace srfs::ros {
namespace {

Gid gid_of(std::uint8_t participant, std::uint8_t number) {
  Gid gid{};
  gid[0] = participant;
  gid[15] = number;
  return gid;
}

template <std::size_t octets>
GraphGid<octets> graph_gid(const Gid& gid) {
  GraphGid<octets> out;
  std::copy(gid.begin(), gid.end(), out.data.begin());
  return out;
}

/// What participant @p participant says of its one node; the endpoints' numbers.
template <std::size_t octets>
GraphMessage<octets> message_of(std::uint8_t participant, const std::string& name_space,
                                const std::string& name, const std::vector<std::uint8_t>& readers,
                                const std::vector<std::uint8_t>& writers) {
  GraphMessage<octets> message;
  message.gid = graph_gid<octets>(gid_of(participant, 0xc1));
  auto& node = message.node_entities_info_seq.emplace_back();
  node.node_namespace = name_space;
  node.node_name = name;
  for (const auto number : readers)
    node.reader_gid_seq.push_back(graph_gid<octets>(gid_of(participant, number)));
  for (const auto number : writers)
    node.writer_gid_seq.push_back(graph_gid<octets>(gid_of(participant, number)));
  return message;
}

std::vector<TopicDirectory::Endpoint> example_endpoints() {
  TopicDirectory directory;
  directory.add(gid_of(1, 1), true, "rt/timing/tick", "srfs_msgs::msg::dds_::TimeTick_", {});
  directory.add(gid_of(1, 2), false, "rq/timing/set_timeRequest", "srfs_msgs::srv::dds_::SetTime_Request_",
                {});
  directory.add(gid_of(1, 3), true, "rr/timing/set_timeReply", "srfs_msgs::srv::dds_::SetTime_Response_", {});
  directory.add(gid_of(2, 1), false, "rt/timing/tick", "srfs_msgs::msg::dds_::TimeTick_", {});
  directory.add(gid_of(2, 2), true, "rq/timing/set_timeRequest", "srfs_msgs::srv::dds_::SetTime_Request_",
                {});
  directory.add(gid_of(2, 3), false, "rq/go/_action/send_goalRequest",
                "example_interfaces::action::dds_::Fibonacci_SendGoal_Request_", {});
  directory.add(gid_of(2, 4), true, "rt/go/_action/status", "action_msgs::msg::dds_::GoalStatusArray_", {});
  directory.add(gid_of(3, 1), true, "rt/raw", "std_msgs::msg::dds_::String_", {});
  directory.add(gid_of(3, 2), true, "not_of_ros", "Some", {});
  directory.add(gid_of(3, 3), true, "x", "Some", {});
  return directory.endpoints();
}

TEST(NodeDirectory, ShowsTheEndsOfEachNodeByName) {
  NodeDirectory directory;
  directory.on_graph(message_of<24>(2, "/bus_b", "user", {1, 3}, {2, 4}));
  directory.on_graph(message_of<16>(1, "/", "timing", {2}, {1, 3}));
  const auto nodes = directory.nodes(example_endpoints());
  ASSERT_EQ(nodes.size(), 3U);
  const NamedEnd tick{.name = "/timing/tick", .type = "srfs_msgs/msg/TimeTick"};
  const NamedEnd set_time{.name = "/timing/set_time", .type = "srfs_msgs/srv/SetTime"};
  const NodeEnds& user = nodes[0];
  EXPECT_EQ(user.node, "/bus_b/user");
  EXPECT_EQ(user.subscriptions, std::vector{tick});
  EXPECT_EQ(user.clients, std::vector{set_time});
  EXPECT_EQ(user.action_servers,
            (std::vector{NamedEnd{.name = "/go", .type = "example_interfaces/action/Fibonacci"}}));
  EXPECT_TRUE(user.publishers.empty()) << "the topics of an action are the action's";
  const NodeEnds& server_node = nodes[1];
  EXPECT_EQ(server_node.node, "/timing");
  EXPECT_EQ(server_node.publishers, std::vector{tick});
  EXPECT_EQ(server_node.services, std::vector{set_time});
  const NodeEnds& nobodys = nodes[2];
  EXPECT_EQ(nobodys.node, "");
  EXPECT_EQ(nobodys.publishers, (std::vector{NamedEnd{.name = "/raw", .type = "std_msgs/msg/String"}}));
}

TEST(NodeDirectory, StatesTheQosOfEachEndOfATopic) {
  TopicDirectory topics;
  topics.add(gid_of(1, 1), true, "rt/mode", "srfs_msgs::msg::dds_::SystemMode_", {.transient_local = true});
  topics.add(gid_of(2, 1), false, "rt/mode", "srfs_msgs::msg::dds_::SystemMode_", {.best_effort = true});
  NodeDirectory directory;
  directory.on_graph(message_of<24>(1, "/", "ttc", {}, {1}));
  directory.on_graph(message_of<24>(2, "/", "viewer", {1}, {}));

  const auto nodes = directory.nodes(topics.endpoints());

  ASSERT_EQ(nodes.size(), 2U);
  ASSERT_EQ(nodes[0].publishers.size(), 1U);
  EXPECT_TRUE(nodes[0].publishers[0].transient_local);
  EXPECT_FALSE(nodes[0].publishers[0].best_effort);
  ASSERT_EQ(nodes[1].subscriptions.size(), 1U);
  EXPECT_FALSE(nodes[1].subscriptions[0].transient_local);
  EXPECT_TRUE(nodes[1].subscriptions[0].best_effort);
}

TEST(NodeDirectory, ShowsANodeWhoseEndsAreNotKnownYet) {
  NodeDirectory directory;
  directory.on_graph(message_of<24>(1, "/", "early", {1}, {2}));
  const auto nodes = directory.nodes({});
  ASSERT_EQ(nodes.size(), 1U);
  EXPECT_EQ(nodes[0].node, "/early");
  EXPECT_TRUE(nodes[0].subscriptions.empty());
}

TEST(NodeDirectory, KeepsTheLatestStateOfAParticipant) {
  NodeDirectory directory;
  directory.on_graph(message_of<24>(1, "/", "old", {}, {1}));
  directory.on_graph(message_of<24>(1, "/", "new", {}, {}));
  const auto nodes = directory.nodes(example_endpoints());
  ASSERT_EQ(nodes.size(), 2U) << "the second has the ends of no node";
  EXPECT_EQ(nodes[0].node, "/new");
  EXPECT_TRUE(nodes[0].publishers.empty());
}

TEST(NodeDirectory, RemembersABoundedNumberOfParticipants) {
  NodeDirectory directory;
  for (std::size_t i = 0; i < NodeDirectory::most + 2; ++i) {
    HumbleGraphMessage message;
    message.gid.data[0] = static_cast<std::uint8_t>(i);
    message.gid.data[1] = static_cast<std::uint8_t>(i >> 8U);
    message.node_entities_info_seq.emplace_back().node_name = "n" + std::to_string(i);
    directory.on_graph(message);
  }
  EXPECT_EQ(directory.forgotten(), 2U);
  EXPECT_EQ(directory.nodes({}).size(), NodeDirectory::most);
}

}  // namespace
}  // namespace srfs::ros
