// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
// ros_discovery_info and the participant's USER_DATA, the sources of `ros2 node list` and `ros2 node info`.

#include <algorithm>
#include <set>

#include "tests/conformance/node_process.hpp"

namespace srfs::conformance {
namespace {

constexpr const char* graph_type = "rmw_dds_common::msg::dds_::ParticipantEntitiesInfo_";

/// A ParticipantEntitiesInfo with one node, decoded by the test.
struct GraphOfANode {
  Octets participant;
  std::string node_namespace;
  std::string name;
  std::set<Octets> readers;
  std::set<Octets> writers;
  bool whole = false;  ///< complete, without extra octets
};

GraphOfANode read_graph(const Octets& payload, std::size_t gid_octets) {
  CdrView view(payload);
  GraphOfANode graph;
  graph.participant = view.raw(gid_octets);
  if (view.u32() != 1) return graph;
  graph.node_namespace = view.str();
  graph.name = view.str();
  for (std::uint32_t left = view.u32(); left > 0; --left) graph.readers.insert(view.raw(gid_octets));
  for (std::uint32_t left = view.u32(); left > 0; --left) graph.writers.insert(view.raw(gid_octets));
  graph.whole = view.at_end();
  return graph;
}

Octets padded(Octets gid, std::size_t size) {
  gid.resize(size, 0);
  return gid;
}

class Graph : public ConformanceTest {
 protected:
  /// Compares the latest graph message of a node with the endpoints found by discovery.
  void expect_graph_equals_discovery(const NodeProcess& node, std::size_t gid_octets) {
    const SeenParticipant seen = find(node);
    RawReader reader(peer_, "ros_discovery_info", graph_type, true);
    GraphOfANode graph;
    std::set<Octets> readers;
    std::set<Octets> writers;
    // Discovery announces the endpoints one by one; the graph message is complete from the start.
    ASSERT_TRUE(wait_for([&] {
      if (graph.name.empty()) {
        const auto sample = reader.next([&](const ReceivedSample& s) {
          return s.identity.writer_guid().guidPrefix == seen.guid.guidPrefix;
        });
        if (!sample) return false;
        graph = read_graph(sample->payload, gid_octets);
      }
      readers.clear();
      writers.clear();
      for (const SeenEndpoint& endpoint : peer_.endpoints_of(seen.guid)) {
        if (endpoint.topic == "ros_discovery_info") continue;
        (endpoint.is_reader ? readers : writers).insert(padded(gid_of(endpoint.guid), gid_octets));
      }
      return graph.readers == readers && graph.writers == writers;
    })) << graph.readers.size()
        << " readers and " << graph.writers.size() << " writers in the graph, " << readers.size() << " and "
        << writers.size() << " discovered";
    EXPECT_EQ(hex(graph.participant), hex(padded(gid_of(seen.guid), gid_octets)));
    EXPECT_EQ(graph.node_namespace, "/");
    EXPECT_EQ(graph.name, node.name());
    EXPECT_TRUE(graph.whole);
    EXPECT_GE(graph.readers.size(), 12U) << "11 services and a subscription";
    EXPECT_GE(graph.writers.size(), 15U) << "11 services and 4 topics";
  }
};

TEST_F(Graph, TheParticipantCarriesEnclaveNameAndSuite) {
  const SeenParticipant seen = participant();
  EXPECT_EQ(seen.name, "/");
  EXPECT_EQ(std::string(seen.user_data.begin(), seen.user_data.end()),
            std::string("enclave=/;srfs=conformance/probe/1;\0", 36));
  EXPECT_EQ(hex(gid_of(seen.guid)).substr(24), "000001c1");
}

TEST_F(Graph, HumbleLearnsOfEveryEndpointOfTheNode) {
  expect_graph_equals_discovery(*node_, 24);
}

TEST_F(Graph, IronLearnsOfEveryEndpointOfTheNode) {
  const NodeProcess iron("probe_iron", "{ros_graph: iron, orders: open}");
  expect_graph_equals_discovery(iron, 16);
}

TEST_F(Graph, TheTopicHasTheQosOfRmwFastrtps) {
  const SeenParticipant seen = participant();
  std::optional<SeenEndpoint> graph;
  ASSERT_TRUE(wait_for([&] {
    for (const SeenEndpoint& endpoint : peer_.endpoints_of(seen.guid)) {
      if (endpoint.topic == "ros_discovery_info") graph = endpoint;
    }
    return graph.has_value();
  }));
  EXPECT_EQ(graph->type, graph_type);
  EXPECT_FALSE(graph->is_reader);
  EXPECT_TRUE(graph->reliable && graph->transient_local);
  EXPECT_FALSE(graph->keyed);
}

TEST_F(Graph, ANodeThatStopsIsGoneWithItsParticipant) {
  Octets user_data;
  {
    const NodeProcess brief("brief", "{orders: open}");
    (void)find(brief);
    user_data = brief.user_data();
  }
  EXPECT_TRUE(wait_for([&] {
    const auto all = peer_.participants();
    return std::none_of(all.begin(), all.end(),
                        [&](const SeenParticipant& p) { return p.user_data == user_data; });
  }));
}

TEST_F(Graph, ADeploymentThatWantsNoneHasNone) {
  const NodeProcess quiet("quiet", "{ros_graph: off, orders: open}");
  const SeenParticipant seen = find(quiet);
  ASSERT_TRUE(wait_for([&] { return peer_.endpoints_of(seen.guid).size() >= 27; }));
  for (const SeenEndpoint& endpoint : peer_.endpoints_of(seen.guid)) {
    EXPECT_NE(endpoint.topic, "ros_discovery_info");
  }
}

}  // namespace
}  // namespace srfs::conformance
