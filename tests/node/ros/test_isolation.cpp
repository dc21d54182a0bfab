// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
// Isolation of the suite from foreign participants, over real DDS.

#include <arpa/inet.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <malloc.h>
#include <netinet/in.h>
#include <sys/socket.h>

#include <fastrtps/utils/IPLocator.h>

#include <srfs_msgs/srv/check_alive.hpp>

#include "base/fd.hpp"
#include "base/file.hpp"
#include "ros/client.hpp"
#include "ros/publisher.hpp"
#include "ros/service.hpp"
#include "tests/dds_domain.hpp"
#include "tests/node/ros/peer_process.hpp"
#include "tests/rtps_message.hpp"

namespace srfs::ros {
namespace {

using testing_support::RtpsMessage;

using srfs_msgs::msg::TaskFlags;

const Topic<TaskFlags> flags_topic{"/test/flags", {.depth = 4}, Priority::time};

/// A message without a length limit.
struct Blob {
  static constexpr const char* dds_type_name = "srfs_test::msg::dds_::Blob_";
  std::vector<std::uint8_t> octets;
  template <class Self, class V>
  static void visit(Self& s, V& v) {
    v.sequence(s.octets, 0, 0);
  }
};

/// @param depth history depth; the default is a service's depth
Topic<Blob> blob_topic(const std::string& name, std::int32_t depth = service_depth) {
  return {name, {.depth = depth}};
}

GuidPrefix prefix_of(const Gid& gid) {
  GuidPrefix prefix{};
  std::copy_n(gid.begin(), prefix.size(), prefix.begin());
  return prefix;
}

/// Sends arbitrary datagrams to ports of this host.
class RawSocket {
 public:
  void send(OctetView datagram, std::uint16_t port) const {
    sockaddr_in to{};
    to.sin_family = AF_INET;
    to.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
    to.sin_port = htons(port);
    (void)sendto(fd_.get(), datagram.data(), datagram.size(), 0, reinterpret_cast<const sockaddr*>(&to),
                 sizeof to);
  }
  /// Sends to every port on which this domain's discovery may listen.
  void send_to_discovery(OctetView datagram) const {
    for (int number = 0; number < 32; ++number)
      send(datagram,
           static_cast<std::uint16_t>(7400 + 250 * testing_support::own_domain() + 10 + 2 * number));
  }

 private:
  Fd fd_{socket(AF_INET, SOCK_DGRAM | SOCK_CLOEXEC, 0)};
};

/// Two processes of the suite and a stranger on one topic.
class IsolationTest : public testing::Test {
 protected:
  bool wait(const std::function<bool()>& condition) {
    return executor_.spin_until(condition, monotonic_now() + seconds(20));
  }
  static std::unique_ptr<Participant> member(const std::string& node, bool drop_foreign) {
    return Participant::create({testing_support::own_domain(),
                                {"127.0.0.1"},
                                nullptr,
                                SuiteIdentity{"suite", node, 1},
                                drop_foreign})
        .value();
  }
  /// @return the cycles received by the subscriber's callback, in order of arrival
  std::vector<std::uint64_t> run(bool drop_foreign) {
    const auto stranger = Participant::create({testing_support::own_domain(), {"127.0.0.1"}}).value();
    const auto listener = member("listener", drop_foreign);
    const auto friendly = member("talker", drop_foreign);
    std::vector<std::uint64_t> got;
    Publisher<TaskFlags> ours(*friendly, flags_topic);
    Publisher<TaskFlags> foreign(*stranger, flags_topic);
    Subscription<TaskFlags> subscription(
        executor_, *listener, flags_topic,
        [&](const TaskFlags& m, const MessageInfo&) { got.push_back(m.cycle); });
    EXPECT_TRUE(wait([&] { return ours.subscription_count() == 1 && foreign.subscription_count() == 1; }));
    TaskFlags m;
    m.cycle = 1;
    foreign.publish(m);
    EXPECT_TRUE(wait([&] { return subscription.stats().foreign == 1; }));
    m.cycle = 2;
    ours.publish(m);
    EXPECT_TRUE(wait([&] { return !got.empty() && got.back() == 2; }));
    EXPECT_EQ(subscription.stats().foreign, 1U);
    EXPECT_NE(subscription.reader().lock()->last_foreign().find("'/' at 127.0.0.1"), std::string::npos)
        << subscription.reader().lock()->last_foreign();
    return got;
  }
  Executor executor_;
};

TEST_F(IsolationTest, SamplesFromOutsideTheSuiteAreCountedAndAccepted) {
  EXPECT_THAT(run(false), testing::ElementsAre(1, 2));
}

TEST_F(IsolationTest, ANodeThatHearsItselfIsNoStranger) {
  const auto node = member("ttc", true);
  std::vector<std::uint64_t> got;
  Publisher<TaskFlags> publisher(*node, flags_topic);
  Subscription<TaskFlags> subscription(
      executor_, *node, flags_topic, [&](const TaskFlags& m, const MessageInfo&) { got.push_back(m.cycle); });
  ASSERT_TRUE(wait([&] { return publisher.subscription_count() == 1; }));
  publisher.publish({});
  EXPECT_TRUE(wait([&] { return got.size() == 1; }));
  EXPECT_EQ(subscription.stats().foreign, 0U);
}

TEST_F(IsolationTest, WhereTheDeploymentSaysSoTheyAreDropped) {
  EXPECT_THAT(run(true), testing::ElementsAre(2));
}

/// A node that reads on its work thread, like every node.
class NodeAmongStrangers : public IsolationTest {
 protected:
  using CheckAlive = srfs_msgs::srv::CheckAlive;

  std::unique_ptr<Participant> node(bool drop_foreign) {
    ParticipantOptions options{
        testing_support::own_domain(), {"127.0.0.1"}, &executor_, SuiteIdentity{"suite", "node", 1}};
    options.drop_foreign = drop_foreign;
    return Participant::create(options).value();
  }
  std::unique_ptr<Service<CheckAlive>> service(Participant& participant) {
    return std::make_unique<Service<CheckAlive>>(
        executor_, participant, "/test/alive", Qos{}, Priority::liveness,
        [](const CheckAlive::Request& q, CheckAlive::Response& r) { r.nonce = q.nonce; });
  }
  /// Checks the node once from @p from. @return whether the node answers
  bool is_answered(Participant& from, nanoseconds deadline) {
    Client<CheckAlive> client(executor_, from, "/test/alive", Qos{}, Priority::liveness);
    std::optional<bool> answered;
    client.call({}, deadline, 1, [&](const auto& answer) { answered = answer.has_value(); });
    EXPECT_TRUE(wait([&] { return answered.has_value(); }));
    return answered.value_or(false);
  }
  /// Resident memory of this process, in octets, without free memory that malloc() keeps.
  static std::size_t resident_memory() {
    malloc_trim(0);
    return memory("VmRSS:");
  }
  /// Peak resident memory of this process, in octets.
  static std::size_t peak_memory() { return memory("VmHWM:"); }
  static std::size_t memory(const std::string& which) {
    const std::string status = read_file("/proc/self/status", 1U << 16).value();
    return std::stoul(status.substr(status.find(which) + which.size())) << 10;
  }
  /// The port on which a participant receives user traffic.
  static std::uint16_t user_port(Participant& participant) {
    auto* reader = participant.create_reader("rt/test/port", dds::TypeSupport(new TypeSupport<TaskFlags>),
                                             Qos{}, nullptr);
    eprosima::fastdds::rtps::LocatorList locators;
    EXPECT_EQ(reader->get_listening_locators(locators), ReturnCode_t::RETCODE_OK);
    const auto port = eprosima::fastrtps::rtps::IPLocator::getPhysicalPort(*locators.begin());
    participant.destroy(reader);
    return port;
  }
  static std::unique_ptr<Participant> make_stranger() {
    return Participant::create({testing_support::own_domain(), {"127.0.0.1"}}).value();
  }
  void pass(nanoseconds time) {
    (void)executor_.spin_until([] { return false; }, monotonic_now() + time);
  }
};

TEST_F(NodeAmongStrangers, SamplesThatClaimMoreThanTheirTopicTakesCostNoMemory) {
  const auto here = node(false);
  const auto friendly = member("talker", false);
  std::vector<std::uint64_t> got;
  Publisher<TaskFlags> ours(*friendly, flags_topic);
  const Subscription<TaskFlags> subscription(
      executor_, *here, flags_topic, [&](const TaskFlags& m, const MessageInfo&) { got.push_back(m.cycle); });
  ASSERT_TRUE(wait([&] { return ours.subscription_count() == 1; }));
  const std::size_t before = peak_memory();
  const testing_support::PeerProcess stranger("huge", flags_topic.name);  // 64 MiB each
  ASSERT_TRUE(wait([&] { return subscription.stats().malformed > 500; })) << "fragments of it";
  EXPECT_LT(peak_memory() - before, 16U << 20);
  TaskFlags m;
  m.cycle = 7;
  ours.publish(m);
  EXPECT_TRUE(wait([&] { return !got.empty(); }));
  EXPECT_THAT(got, testing::ElementsAre(7));
}

TEST_F(NodeAmongStrangers, AStrangerIsHeardAfterASilence) {
  const auto here = node(false);
  const auto stranger = Participant::create({testing_support::own_domain(), {"127.0.0.1"}}).value();
  std::vector<std::uint64_t> got;
  Publisher<TaskFlags> foreign(*stranger, flags_topic);
  const Subscription<TaskFlags> subscription(
      executor_, *here, flags_topic, [&](const TaskFlags& m, const MessageInfo&) { got.push_back(m.cycle); });
  ASSERT_TRUE(wait([&] { return foreign.subscription_count() == 1 && subscription.publisher_count() == 1; }));
  for (std::uint64_t n = 1; n <= 3; ++n) {
    (void)executor_.spin_until([] { return false; }, monotonic_now() + milliseconds(150));
    TaskFlags m;
    m.cycle = n;
    foreign.publish(m);
    ASSERT_TRUE(wait([&] { return got.size() == n; }));
  }
  EXPECT_EQ(here->transport_stats().foreign, 0U);
}

TEST_F(NodeAmongStrangers, AFloodOfThemKeepsNoCheckFromItsAnswer) {
  const auto here = node(false);
  const auto friendly = member("neighbour", false);
  const auto alive = service(*here);
  std::uint64_t handled = 0;
  const Subscription<TaskFlags> subscription(executor_, *here, flags_topic,
                                             [&](const TaskFlags&, const MessageInfo&) { ++handled; });
  const testing_support::PeerProcess a("flood", flags_topic.name);
  const testing_support::PeerProcess b("flood", flags_topic.name);
  ASSERT_TRUE(wait([&] { return handled > 1000; }));
  const std::size_t before = peak_memory();
  for (int i = 0; i < 20; ++i) EXPECT_TRUE(is_answered(*friendly, seconds(5))) << i;
  EXPECT_LT(peak_memory() - before, 16U << 20);
  RecordProperty("samples", static_cast<int>(handled));
  RecordProperty("dropped_unread", static_cast<int>(here->transport_stats().foreign));
}

TEST_F(NodeAmongStrangers, TheirFloodOfLargeSamplesLosesNoneOfTheSuites) {
  const auto here = node(false);
  const auto friendly = member("talker", false);
  const Topic<TaskFlags> quiet{"/test/quiet", {.depth = 4}, Priority::time};
  std::uint64_t got = 0;
  Publisher<TaskFlags> ours(*friendly, quiet);
  const Subscription<TaskFlags> subscription(executor_, *here, quiet,
                                             [&](const TaskFlags&, const MessageInfo&) { ++got; });
  const Subscription<TaskFlags> flooded(executor_, *here, flags_topic,
                                        [](const TaskFlags&, const MessageInfo&) {});
  const testing_support::PeerProcess a("huge", flags_topic.name);  // 64 MiB each
  const testing_support::PeerProcess b("huge", flags_topic.name);
  ASSERT_TRUE(wait([&] { return ours.subscription_count() == 1 && here->transport_stats().foreign > 1000; }))
      << here->transport_stats().foreign;
  for (std::uint64_t n = 1; n <= 100; ++n) {
    ours.publish({});
    ASSERT_TRUE(wait([&] { return got == n; })) << n;
  }
  EXPECT_EQ(here->transport_stats().overflowed, 0U) << "its socket is not the one that they fill";
}

TEST_F(NodeAmongStrangers, WhereTheDeploymentSaysSoNothingOfThemIsRead) {
  const auto here = node(true);
  const auto friendly = member("neighbour", true);
  const auto stranger = Participant::create({testing_support::own_domain(), {"127.0.0.1"}}).value();
  const auto alive = service(*here);
  std::vector<std::uint64_t> got;
  Publisher<TaskFlags> ours(*friendly, flags_topic);
  Publisher<TaskFlags> foreign(*stranger, flags_topic);
  const Subscription<TaskFlags> subscription(
      executor_, *here, flags_topic, [&](const TaskFlags& m, const MessageInfo&) { got.push_back(m.cycle); });
  ASSERT_TRUE(wait([&] { return ours.subscription_count() == 1 && foreign.subscription_count() == 1; }));
  TaskFlags m;
  m.cycle = 1;
  foreign.publish(m);
  ASSERT_TRUE(wait([&] { return here->transport_stats().foreign > 0; }));
  EXPECT_FALSE(is_answered(*stranger, milliseconds(500)));
  EXPECT_TRUE(is_answered(*friendly, seconds(10)));
  m.cycle = 2;
  ours.publish(m);
  EXPECT_TRUE(wait([&] { return !got.empty(); }));
  EXPECT_THAT(got, testing::ElementsAre(2));
  EXPECT_EQ(alive->counters().refused, 0U);
  EXPECT_NE(here->last_dropped().find("'/' at 127.0.0.1"), std::string::npos) << here->last_dropped();
}

TEST_F(NodeAmongStrangers, FirstFragmentsThatClaimMuchTakeNoMoreThanTheRoomForThem) {
  const auto here = node(false);
  const auto friendly = member("talker", false);
  const auto liar = make_stranger();
  const auto honest = make_stranger();
  const auto topic = blob_topic("/test/blob");
  std::vector<std::size_t> got;
  Publisher<Blob> ours(*friendly, topic);
  const Publisher<Blob> lies(*liar, topic);
  Publisher<Blob> foreign(*honest, topic);
  const Subscription<Blob> subscription(
      executor_, *here, topic, [&](const Blob& m, const MessageInfo&) { got.push_back(m.octets.size()); });
  ASSERT_TRUE(wait([&] {
    return ours.subscription_count() == 1 && lies.subscription_count() == 1 &&
           foreign.subscription_count() == 1 && subscription.publisher_count() == 3;
  }));
  const RawSocket socket;
  const std::uint16_t port = user_port(*here);
  const Gid writer = to_gid(lies.guid());
  const std::size_t peak_before = peak_memory();
  const std::size_t before = resident_memory();
  for (std::int64_t n = 1; n <= 10'000; ++n) {
    socket.send(RtpsMessage(prefix_of(writer)).fragment(writer, {.sample_octets = 1U << 20, .sequence = n}),
                port);
    if (n % 16 == 0) executor_.spin_once(nanoseconds(0));
  }
  EXPECT_LT(peak_memory() - peak_before, 16U << 20);

  // Participants of the suite have no such bound; an outside sender waits for room.
  ASSERT_TRUE(ours.publish({std::vector<std::uint8_t>(800'000)}));
  EXPECT_TRUE(wait([&] { return got.size() == 1; }));
  ASSERT_TRUE(foreign.publish({std::vector<std::uint8_t>(900'000)}));
  EXPECT_TRUE(wait([&] { return got.size() == 2; }));
  EXPECT_THAT(got, testing::ElementsAre(800'000, 900'000));
  EXPECT_LT(resident_memory(), before + (3U << 20)) << "one of the lies was given up";
}

TEST_F(NodeAmongStrangers, MemoryForTheirSamplesIsGivenBack) {
  const auto here = node(false);
  const auto stranger = make_stranger();
  const auto elsewhere = make_stranger();
  constexpr std::size_t topics = 6;
  constexpr std::size_t samples = 36;
  const Blob large{std::vector<std::uint8_t>(100'000)};
  const Blob largest{std::vector<std::uint8_t>(900'000)};
  std::vector<std::unique_ptr<Publisher<Blob>>> publishers;
  std::vector<std::unique_ptr<Subscription<Blob>>> subscriptions;
  std::size_t got = 0;
  for (std::size_t i = 0; i < topics; ++i) {
    const std::string name = "/test/blob" + std::to_string(i);
    publishers.push_back(std::make_unique<Publisher<Blob>>(*stranger, blob_topic(name, 1)));
    // Make the writer allocate its memory for two samples in flight before the measurement.
    std::size_t heard = 0;
    auto listener = std::make_unique<Subscription<Blob>>(executor_, *elsewhere, blob_topic(name),
                                                         [&](const Blob&, const MessageInfo&) { ++heard; });
    ASSERT_TRUE(wait([&] { return publishers[i]->subscription_count() == 1; }));
    for (int n = 0; n < 4; ++n) publishers[i]->publish(largest);
    ASSERT_TRUE(wait([&] { return heard > 0; }));
    listener.reset();
    ASSERT_TRUE(wait([&] { return publishers[i]->subscription_count() == 0; }));
    subscriptions.push_back(std::make_unique<Subscription<Blob>>(
        executor_, *here, blob_topic(name), [&](const Blob&, const MessageInfo&) { ++got; }));
    ASSERT_TRUE(wait([&] {
      return publishers[i]->subscription_count() == 1 && subscriptions[i]->publisher_count() == 1;
    }));
  }
  // On a busy machine the node may read its socket too late and lose samples.
  const auto lost = [&] {
    std::size_t sum = 0;
    for (const auto& subscription : subscriptions) sum += subscription->stats().lost;
    return sum;
  };
  const std::size_t before = resident_memory();
  std::size_t sent = 0;
  for (std::size_t i = 0; i < topics; ++i) {
    pass(seconds(1));  // strangers have an octet budget per second
    for (std::size_t n = 0; n < samples; ++n, ++sent) {
      publishers[i]->publish(large);
      here->receive_waiting();  // moves the sample into the reader without taking it
    }
    ASSERT_TRUE(wait([&] { return got + lost() == sent; })) << got;
  }
  for (std::size_t i = 0; i < topics; ++i) {
    publishers[i]->publish(largest);
    ++sent;
    ASSERT_TRUE(wait([&] { return got + lost() == sent; })) << got;
  }
  EXPECT_LT(resident_memory(), before + (4U << 20));
}

TEST_F(NodeAmongStrangers, FragmentsOfDiscoveryThatClaimMuchTakeNoMemory) {
  const auto here = node(false);
  const auto liar = make_stranger();
  const Publisher<TaskFlags> publisher(*liar, flags_topic);
  const Subscription<TaskFlags> subscription(executor_, *here, flags_topic,
                                             [](const TaskFlags&, const MessageInfo&) {});
  const Publisher<Blob> publisher_of_large(*liar, blob_topic("/test/blob"));
  const Subscription<Blob> large(executor_, *here, blob_topic("/test/blob"),
                                 [](const Blob&, const MessageInfo&) {});
  ASSERT_TRUE(wait([&] { return subscription.publisher_count() == 1 && large.publisher_count() == 1; }));
  const RawSocket socket;
  Gid publications = to_gid(publisher.guid());  // the stranger's publications writer
  std::copy_n(std::array<std::uint8_t, 4>{0, 0, 3, 0xc2}.begin(), 4, publications.begin() + 12);
  const std::size_t before = peak_memory();
  for (std::int64_t n = 1; n <= 2000; ++n) {
    const RtpsMessage message =
        RtpsMessage(prefix_of(publications))
            .fragment(publications, {.sample_octets = 1U << 20, .sequence = 3 + n, .octets = 1000});
    socket.send_to_discovery(message);
    if (n % 50 == 0) pass(milliseconds(20));
  }
  EXPECT_LT(peak_memory() - before, 16U << 20);
  // The departure message below shows that the datagrams reached the discovery port.
  EXPECT_EQ(subscription.publisher_count(), 1U);
  socket.send_to_discovery(departure_message(prefix_of(publications)));
  EXPECT_TRUE(wait([&] { return subscription.publisher_count() == 0; }));
}

TEST_F(NodeAmongStrangers, WhatIsSentToDiscoverysPortReachesNoReader) {
  const auto here = node(true);
  const auto stranger = make_stranger();
  const auto friendly = member("talker", false);
  std::vector<std::uint64_t> got;
  const Publisher<TaskFlags> foreign(*stranger, flags_topic);
  const Publisher<TaskFlags> ours(*friendly, flags_topic);
  const Subscription<TaskFlags> subscription(
      executor_, *here, flags_topic, [&](const TaskFlags& m, const MessageInfo&) { got.push_back(m.cycle); });
  ASSERT_TRUE(wait([&] {
    return ours.subscription_count() == 1 && foreign.subscription_count() == 1 &&
           subscription.publisher_count() == 2;
  }));
  const RawSocket socket;
  const auto sample = [](const Gid& writer, std::uint64_t cycle) {
    TaskFlags m;
    m.cycle = cycle;
    Octets octets(encoded_size(m));
    encode_into(m, reinterpret_cast<char*>(octets.data()), octets.size());
    return RtpsMessage(prefix_of(writer)).data(writer, octets);
  };
  socket.send_to_discovery(sample(to_gid(foreign.guid()), 1));
  socket.send_to_discovery(sample(to_gid(ours.guid()), 2));
  pass(milliseconds(200));
  socket.send(sample(to_gid(foreign.guid()), 3), user_port(*here));
  socket.send(sample(to_gid(ours.guid()), 4), user_port(*here));
  EXPECT_TRUE(wait([&] { return !got.empty(); }));
  EXPECT_THAT(got, testing::ElementsAre(4));
}

TEST_F(NodeAmongStrangers, SubmessagesThatDoNotHoldWhatTheySayAreDropped) {
  const auto here = node(false);
  const auto liar = make_stranger();
  const auto topic = blob_topic("/test/blob");
  Publisher<Blob> lies(*liar, topic);
  std::vector<std::size_t> got;
  const Subscription<Blob> subscription(
      executor_, *here, topic, [&](const Blob& m, const MessageInfo&) { got.push_back(m.octets.size()); });
  ASSERT_TRUE(wait([&] { return lies.subscription_count() == 1 && subscription.publisher_count() == 1; }));
  const RawSocket socket;
  const std::uint16_t port = user_port(*here);
  const Gid writer = to_gid(lies.guid());
  const RtpsMessage empty(prefix_of(writer));
  // Fast DDS 2.9 copies the whole sample size from a datagram of 100 octets.
  socket.send(RtpsMessage(empty).fragment(
                  writer, {.sample_octets = 1U << 20, .count = 17, .octets = 65000, .held = 40}),
              port);
  // With fragment size 0, Fast DDS treats the sample as complete, with whatever its memory contains.
  socket.send(RtpsMessage(empty).fragment(writer, {.sample_octets = 1U << 20, .octets = 0, .held = 40}),
              port);
  EXPECT_TRUE(wait([&] { return subscription.stats().malformed == 2; }));
  EXPECT_TRUE(lies.publish({std::vector<std::uint8_t>(1000)}));
  EXPECT_TRUE(wait([&] { return !got.empty(); }));
  EXPECT_THAT(got, testing::ElementsAre(1000));
}

}  // namespace
}  // namespace srfs::ros
