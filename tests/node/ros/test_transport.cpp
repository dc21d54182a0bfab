// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
// The work-thread transport between two processes. The peer uses Fast DDS' receive threads or our transport.

#include <csignal>
#include <thread>

#include <fastdds/rtps/transport/UDPv4TransportDescriptor.h>
#include <fastrtps/utils/IPLocator.h>
#include <gtest/gtest.h>
#include <sys/prctl.h>
#include <sys/wait.h>
#include <unistd.h>
#include <fastdds/dds/domain/DomainParticipant.hpp>
#include <fastdds/dds/domain/DomainParticipantFactory.hpp>
#include <fastdds/dds/subscriber/DataReader.hpp>
#include <fastdds/dds/subscriber/Subscriber.hpp>

#include "ros/client.hpp"
#include "ros/publisher.hpp"
#include "ros/service.hpp"
#include "srfs_msgs/msg/task_flags.hpp"
#include "srfs_msgs/srv/check_alive.hpp"
#include "tests/dds_domain.hpp"
#include "tests/signal_child.hpp"

namespace srfs::ros {
namespace {

using srfs_msgs::msg::TaskFlags;
using srfs_msgs::srv::CheckAlive;

const Topic<TaskFlags> there_topic{"/test/there", {.depth = 64}, Priority::time};
const Topic<TaskFlags> back_topic{"/test/back", {.depth = 64}, Priority::time};

/// Echoes every message and answers a service.
[[noreturn]] void echo(int domain, bool own_threads) {
  prctl(PR_SET_PDEATHSIG, SIGKILL);
  Executor executor;
  const auto participant =
      Participant::create({domain, {"127.0.0.1"}, own_threads ? nullptr : &executor}).value();
  Publisher<TaskFlags> back(*participant, back_topic);
  const Subscription<TaskFlags> there(executor, *participant, there_topic,
                                      [&](const TaskFlags& m, const MessageInfo&) { back.publish(m); });
  const Service<CheckAlive> service(
      executor, *participant, "/test/echo", Qos{}, Priority::liveness,
      [](const CheckAlive::Request& q, CheckAlive::Response& r) { r.nonce = q.nonce + 1; });
  executor.spin();
  _exit(0);
}

/// Runs with a peer that uses Fast DDS' receive threads (like any other DDS program) and with one that uses
/// our transport.
class TransportTest : public testing::TestWithParam<bool> {
 protected:
  void SetUp() override {
    const std::string domain = std::to_string(domain_);
    peer_ = fork();
    // Execute a new program, because the threads of Fast DDS do not survive fork().
    if (peer_ == 0) {
      execl("/proc/self/exe", "echo", "--echo", domain.c_str(), GetParam() ? "own" : "work", nullptr);
      _exit(127);
    }
  }
  void TearDown() override {
    testing_support::signal_child(peer_, SIGKILL);
    waitpid(peer_, nullptr, 0);
  }
  bool wait(const std::function<bool()>& condition) {
    return executor_.spin_until(condition, monotonic_now() + seconds(20));
  }
  const int domain_ = testing_support::own_domain();
  pid_t peer_ = -1;
  Executor executor_;
};

TEST_P(TransportTest, SamplesLargeAndSmallComeBackWholeInOrderAndOnTheWorkThread) {
  const auto participant = Participant::create({domain_, {"127.0.0.1"}, &executor_}).value();
  Publisher<TaskFlags> there(*participant, there_topic);
  std::vector<TaskFlags> got;
  const auto work_thread = std::this_thread::get_id();
  bool elsewhere = false;
  const Subscription<TaskFlags> back(executor_, *participant, back_topic,
                                     [&](const TaskFlags& m, const MessageInfo& info) {
                                       elsewhere = elsewhere || std::this_thread::get_id() != work_thread;
                                       EXPECT_LE(info.received, monotonic_now());
                                       got.push_back(m);
                                     });
  ASSERT_TRUE(wait([&] { return there.subscription_count() == 1 && back.publisher_count() == 1; }));
  for (std::uint64_t i = 0; i < 200; ++i) {
    TaskFlags m;
    m.cycle = i;
    m.holder = std::string(i % 32, 'x');
    m.flags.assign(i % 8, true);
    ASSERT_TRUE(there.publish(m));
    ASSERT_TRUE(wait([&] { return got.size() == i + 1; })) << i;
    EXPECT_EQ(got.back(), m);
  }
  EXPECT_FALSE(elsewhere);
  EXPECT_GE(participant->transport_stats().datagrams, 200U);
  EXPECT_EQ(participant->transport_stats().overflowed, 0U);
}

TEST_P(TransportTest, AServiceIsCalledAcrossProcesses) {
  const auto participant = Participant::create({domain_, {"127.0.0.1"}, &executor_}).value();
  Client<CheckAlive> client(executor_, *participant, "/test/echo", Qos{}, Priority::liveness);
  for (std::uint64_t i = 0; i < 50; ++i) {
    std::optional<std::uint64_t> answer;
    CheckAlive::Request request;
    request.nonce = i;
    client.call(request, seconds(15), 1, [&](const Result<CheckAlive::Response, CallError>& r) {
      answer = r.has_value() ? r->nonce : 0;
    });
    ASSERT_TRUE(wait([&] { return answer.has_value(); }));
    EXPECT_EQ(*answer, i + 1);
  }
}

TEST_P(TransportTest, ManyParticipantsOfOneMachineFindPortsOfTheirOwn) {
  std::vector<std::unique_ptr<Participant>> crowd;
  for (int i = 0; i < 6; ++i)
    crowd.push_back(Participant::create({domain_, {"127.0.0.1"}, &executor_}).value());
  Client<CheckAlive> client(executor_, *crowd.back(), "/test/echo", Qos{}, Priority::liveness);
  std::optional<std::uint64_t> answer;
  client.call({}, seconds(15), 1, [&](const Result<CheckAlive::Response, CallError>& r) {
    answer = r.has_value() ? r->nonce : 0;
  });
  ASSERT_TRUE(wait([&] { return answer.has_value(); }));
  EXPECT_EQ(*answer, 1U);
}

/// A DDS program that answers new participants but announces nothing by itself for longer than any test
/// waits.
class QuietPeer {
 public:
  explicit QuietPeer(int domain) {
    dds::DomainParticipantQos qos;
    auto udp = std::make_shared<eprosima::fastdds::rtps::UDPv4TransportDescriptor>();
    udp->interfaceWhiteList = {"127.0.0.1"};
    qos.transport().use_builtin_transports = false;
    qos.transport().user_transports.push_back(udp);
    auto& discovery = qos.wire_protocol().builtin.discovery_config;
    discovery.leaseDuration = {600, 0};
    discovery.leaseDuration_announcementperiod = {300, 0};
    discovery.initial_announcements.count = 0;
    eprosima::fastrtps::rtps::Locator_t here;
    eprosima::fastrtps::rtps::IPLocator::setIPv4(here, 127, 0, 0, 1);
    qos.wire_protocol().builtin.metatrafficUnicastLocatorList.push_back(here);
    participant_ = factory().create_participant(static_cast<std::uint32_t>(domain), qos);
    dds::TypeSupport type(new TypeSupport<TaskFlags>);
    type.register_type(participant_);
    reader_ = participant_->create_subscriber(dds::SUBSCRIBER_QOS_DEFAULT)
                  ->create_datareader(participant_->create_topic("rt/test/there", type.get_type_name(),
                                                                 dds::TOPIC_QOS_DEFAULT),
                                      dds::DATAREADER_QOS_DEFAULT);
  }
  ~QuietPeer() {
    participant_->delete_contained_entities();
    factory().delete_participant(participant_);
  }
  QuietPeer(const QuietPeer&) = delete;
  QuietPeer& operator=(const QuietPeer&) = delete;
  [[nodiscard]] bool is_ready() const { return reader_ != nullptr; }

 private:
  static dds::DomainParticipantFactory& factory() { return *dds::DomainParticipantFactory::get_instance(); }
  dds::DomainParticipant* participant_ = nullptr;
  dds::DataReader* reader_ = nullptr;
};

TEST(Discovery, HearsAnAnswerThatComesWhileTheParticipantIsStillBeingMade) {
  const int domain = testing_support::own_domain();
  const QuietPeer peer(domain);
  ASSERT_TRUE(peer.is_ready());
  Executor executor;
  for (int i = 0; i < 12; ++i) {  // without the gate one in three was lost
    const auto participant = Participant::create({domain, {"127.0.0.1"}, &executor}).value();
    const Publisher<TaskFlags> there(*participant, there_topic);
    ASSERT_TRUE(
        executor.spin_until([&] { return there.subscription_count() == 1; }, monotonic_now() + seconds(20)))
        << i;
  }
}

INSTANTIATE_TEST_SUITE_P(Peer, TransportTest, testing::Bool(),
                         [](const auto& with) { return with.param ? "FastDdsThreads" : "WorkThread"; });

}  // namespace
}  // namespace srfs::ros

int main(int argc, char** argv) {
  if (argc == 4 && std::string(argv[1]) == "--echo")
    srfs::ros::echo(std::atoi(argv[2]), std::string(argv[3]) == "own");
  testing::InitGoogleTest(&argc, argv);
  return RUN_ALL_TESTS();
}
