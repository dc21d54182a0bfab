// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
// The graph publisher over real DDS: time and content of its messages.

#include <gtest/gtest.h>

#include <csignal>

#include <unistd.h>

#include "base/file.hpp"
#include "ros/graph_publisher.hpp"
#include "ros/publisher.hpp"
#include "suite/departures.hpp"
#include "suite/ring/process_cpu.hpp"
#include "tests/dds_domain.hpp"
#include "tests/node/ros/peer_process.hpp"
#include "tests/temporary_folder.hpp"

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

  /// The next message after those already received.
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
  publishers.push_back(make(0));  // created before the graph publisher, but part of the node
  const GraphPublisher graph(executor_, *here_, GraphDialect::humble, NodeNames("probe"));
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
  auto graph = std::make_unique<GraphPublisher>(executor_, *here_, GraphDialect::humble, NodeNames("probe"));
  EXPECT_EQ(next().node_entities_info_seq.size(), 1U);
  const auto endpoint = make(0);
  EXPECT_EQ(next().node_entities_info_seq.size(), 1U);
  graph.reset();
  EXPECT_EQ(next().node_entities_info_seq.size(), 0U);
}

TEST_F(GraphPublisherTest, WhoComesLateGetsTheLatest) {
  const GraphPublisher graph(executor_, *here_, GraphDialect::humble, NodeNames("probe"));
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

/// Upper limit of the time that this process ran: elapsed time minus the time that its threads waited for a
/// CPU and the time that the host took from the virtual machine. All of the time if the kernel reports
/// neither.
class RunningTime {
 public:
  RunningTime() { excused_ = excused(began_); }
  /// Call this at least twice a second.
  nanoseconds passed() {
    const MonotonicTime now = monotonic_now();
    return now - began_ - (excused(now) - excused_);
  }

 private:
  nanoseconds excused(MonotonicTime now) {
    const auto cpu = cpu_ ? cpu_->read(true, now) : std::nullopt;
    const auto machine = read_file("/proc/stat", 1U << 20);
    if (machine) stolen_.on_reading(*machine);
    return (cpu ? cpu->any_waited : nanoseconds(0)) + stolen_.total();
  }
  std::optional<suite::ProcessCpu> cpu_ = suite::ProcessCpu::open(getpid());
  StolenTime stolen_;
  const MonotonicTime began_ = monotonic_now();
  nanoseconds excused_{0};
};

/// A node of the suite that is killed, another node that watches, and a ROS 2 tool outside any suite.
class DeparturesTest : public testing::Test {
 protected:
  DeparturesTest() {
    var_.make_run_folder();
    victim_ = std::make_unique<testing_support::PeerProcess>("node", var_.root.string());
  }
  bool wait(const std::function<bool()>& condition, nanoseconds longest = seconds(20)) {
    return executor_.spin_until(condition, monotonic_now() + longest);
  }
  std::unique_ptr<Participant> node() {
    ParticipantOptions options{
        testing_support::own_domain(), {"127.0.0.1"}, &executor_, SuiteIdentity{"t", "watcher", 1}};
    options.lease = suite::lease_beside_the_ring;
    return Participant::create(options).value();
  }
  const testing_support::TemporaryFolder folder_;
  const suite::VarPaths var_{folder_.path()};
  Executor executor_;
  std::unique_ptr<testing_support::PeerProcess> victim_;
};

TEST_F(DeparturesTest, AKilledNodeLeavesEverybodysGraphAtOnceAndAStoppedOneStays) {
  const auto watcher = node();
  suite::Departures departures(executor_, *watcher, var_,
                               [](const std::string& name) { return name == "victim"; });
  const auto tool = Participant::create({testing_support::own_domain(), {"127.0.0.1"}}).value();
  const Subscription<srfs_msgs::msg::TaskFlags> heard(executor_, *tool, {"/test/victim", {}},
                                                      [](const auto&, const MessageInfo&) {});
  ASSERT_TRUE(wait([&] { return heard.publisher_count() == 1 && departures.watched() == 1; }));

  victim_->signal(SIGSTOP);
  EXPECT_FALSE(wait([&] { return heard.publisher_count() == 0; }, seconds(1)));
  EXPECT_EQ(departures.announced(), 0U);

  victim_->kill_now();
  RunningTime since_its_end;
  nanoseconds took{0};
  ASSERT_TRUE(wait([&] {
    took = since_its_end.passed();
    return heard.publisher_count() == 0;
  }));
  RecordProperty("microseconds", static_cast<int>(took / std::chrono::microseconds(1)));
  EXPECT_LE(took, seconds(1)) << "without a goodbye it stays for its lease, 20 s";
  EXPECT_EQ(departures.announced(), 1U);
  ASSERT_TRUE(wait([&] { return watcher->known_participants().members().empty(); }));
}

}  // namespace
}  // namespace srfs::ros
