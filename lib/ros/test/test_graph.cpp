// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include "ros/graph.hpp"
#include "ros/type_support.hpp"

namespace srfs::ros {
namespace {

Gid gid(std::uint8_t last) {
  return {1, 15, 0xaa, 0xbb, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, last, 4};
}

template <class M>
std::string octets_of(const M& message) {
  Octets out(encoded_size(message));
  encode_into(message, reinterpret_cast<char*>(out.data()), out.size());
  return to_hex(out);
}

ParticipantGraph example() {
  ParticipantGraph graph;
  graph.set_participant(gid(0xc1));
  graph.set_node("eps");
  graph.add_reader(gid(1));
  graph.add_writer(gid(2));
  return graph;
}

const std::string prefix = "010faabb0000000000000000";

TEST(ParticipantGraph, IsLaidOutForHumbleWithGidsOf24Octets) {
  const std::string rest = "0000000000000000";
  EXPECT_EQ(octets_of(example().message<24>()),
            "00010000" + prefix + "0000c104" + rest +  // participant
                "01000000"                             // one node
                "020000002f000000"                     // "/", padded to the next length
                "0400000065707300"                     // "eps"
                "01000000" +
                prefix + "00000104" + rest +               // readers
                "01000000" + prefix + "00000204" + rest);  // writers
}

TEST(ParticipantGraph, IsLaidOutForIronWithGidsOf16Octets) {
  EXPECT_EQ(octets_of(example().message<16>()), "00010000" + prefix + "0000c104" +
                                                    "01000000"
                                                    "020000002f000000"
                                                    "0400000065707300"
                                                    "01000000" +
                                                    prefix + "00000104" + "01000000" + prefix + "00000204");
}

TEST(ParticipantGraph, BothDialectsGoUnderOneTypeName) {
  EXPECT_STREQ(HumbleGraphMessage::dds_type_name, IronGraphMessage::dds_type_name);
}

TEST(ParticipantGraph, AProcessThatIsNoNodeTellsOnlyItself) {
  ParticipantGraph graph = example();
  graph.set_node(std::nullopt);
  EXPECT_TRUE(graph.message<24>().node_entities_info_seq.empty());
}

TEST(ParticipantGraph, EndpointsCountOnceAndLeaveWhenRemoved) {
  ParticipantGraph graph = example();
  EXPECT_FALSE(graph.add_reader(gid(1)));
  EXPECT_TRUE(graph.add_reader(gid(3)));
  EXPECT_FALSE(graph.remove_reader(gid(2))) << "a writer's";
  EXPECT_TRUE(graph.remove_reader(gid(1)));
  EXPECT_TRUE(graph.remove_writer(gid(2)));
  const auto node = graph.message<16>().node_entities_info_seq.at(0);
  ASSERT_EQ(node.reader_gid_seq.size(), 1U);
  EXPECT_EQ(node.reader_gid_seq[0].data, gid(3));
  EXPECT_TRUE(node.writer_gid_seq.empty());
}

TEST(ParticipantGraph, OnlyTopicsAndServicesBelongToNodes) {
  EXPECT_TRUE(belongs_to_a_node("rt/timing/tick"));
  EXPECT_TRUE(belongs_to_a_node("rq/timing/get_stateRequest"));
  EXPECT_TRUE(belongs_to_a_node("rr/timing/get_stateReply"));
  EXPECT_FALSE(belongs_to_a_node("ros_discovery_info"));
}

}  // namespace
}  // namespace srfs::ros
