// The graph publisher over real DDS: when it publishes and what.

#include <gtest/gtest.h>

#include "ros/graph_publisher.hpp"
#include "ros/publisher.hpp"
#include "tests/dds_domain.hpp"

namespace srfs::ros {
namespace {

class GraphPublisherTest : public testing::Test {
 protected:
  GraphPublisherTest()
      : here_(Participant::create({testing_support::own_domain(), {"127.0.0.1"}}).value()),
        there_(Participant::create({testing_support::own_domain(), {"127.0.0.1"}}).value()),
        reader_(TypedReader<HumbleGraphMessage>::create(
            executor_, *there_, "ros_discovery_info", {.depth = 100, .transient_local = true},
            Priority::normal,
            [this](const HumbleGraphMessage& m, const MessageInfo&) { got_.push_back(m); })) {}
  ~GraphPublisherTest() override { reader_->close(); }

  /// The next message after those seen so far.
  HumbleGraphMessage next() {
    EXPECT_TRUE(executor_.spin_until([&] { return got_.size() > seen_; }, monotonic_now() + seconds(20)));
    return got_.size() > seen_ ? got_[seen_++] : HumbleGraphMessage{};
  }
  std::unique_ptr<Publisher<srfs_msgs::msg::TaskFlags>> make(int i) {
    const Topic<srfs_msgs::msg::TaskFlags> topic{"/topic" + std::to_string(i), {}};
    return std::make_unique<Publisher<srfs_msgs::msg::TaskFlags>>(*here_, topic);
  }

  Executor executor_;
  std::unique_ptr<Participant> here_;
  std::unique_ptr<Participant> there_;
  std::vector<HumbleGraphMessage> got_;
  std::size_t seen_ = 0;
  std::shared_ptr<TypedReader<HumbleGraphMessage>> reader_;
};

TEST_F(GraphPublisherTest, WhatIsMadeInOneTurnIsToldOnce) {
  std::vector<std::unique_ptr<Publisher<srfs_msgs::msg::TaskFlags>>> publishers;
  publishers.push_back(make(0));  // before the node: belongs to it too
  const GraphPublisher graph(executor_, *here_, RosGraph::humble, "probe");
  for (int i = 1; i < 40; ++i) publishers.push_back(make(i));

  const HumbleGraphMessage first = next();
  ASSERT_EQ(first.node_entities_info_seq.size(), 1U);
  EXPECT_EQ(first.node_entities_info_seq[0].node_name, "probe");
  EXPECT_EQ(first.node_entities_info_seq[0].writer_gid_seq.size(), 40U);

  publishers.pop_back();
  publishers.pop_back();
  EXPECT_EQ(next().node_entities_info_seq.at(0).writer_gid_seq.size(), 38U) << "no message in between";
}

TEST_F(GraphPublisherTest, ANodeThatEndsBeforeItsParticipantIsTakenOut) {
  auto graph = std::make_unique<GraphPublisher>(executor_, *here_, RosGraph::humble, "probe");
  EXPECT_EQ(next().node_entities_info_seq.size(), 1U);
  const auto endpoint = make(0);
  EXPECT_EQ(next().node_entities_info_seq.size(), 1U);
  graph.reset();
  EXPECT_EQ(next().node_entities_info_seq.size(), 0U);
}

TEST_F(GraphPublisherTest, WhoComesLateGetsTheLatest) {
  const GraphPublisher graph(executor_, *here_, RosGraph::humble, "probe");
  (void)next();
  const auto endpoint = make(0);
  (void)next();

  std::vector<HumbleGraphMessage> late;
  const auto late_participant = Participant::create({testing_support::own_domain(), {"127.0.0.1"}}).value();
  const auto reader = TypedReader<HumbleGraphMessage>::create(
      executor_, *late_participant, "ros_discovery_info", {.depth = 100, .transient_local = true},
      Priority::normal, [&](const HumbleGraphMessage& m, const MessageInfo&) { late.push_back(m); });
  EXPECT_TRUE(executor_.spin_until([&] { return !late.empty(); }, monotonic_now() + seconds(20)));
  ASSERT_FALSE(late.empty());
  EXPECT_EQ(late[0], got_.back());
  reader->close();
}

}  // namespace
}  // namespace srfs::ros
