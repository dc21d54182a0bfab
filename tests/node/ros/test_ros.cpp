// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
// The ROS 2 layer over real DDS: two participants on loopback in this process.

#include <filesystem>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <lifecycle_msgs/srv/change_state.hpp>
#include <lifecycle_msgs/srv/get_state.hpp>
#include <rcl_interfaces/msg/parameter_type.hpp>
#include <rcl_interfaces/srv/describe_parameters.hpp>
#include <rcl_interfaces/srv/get_parameters.hpp>
#include <rcl_interfaces/srv/list_parameters.hpp>
#include <rcl_interfaces/srv/set_parameters.hpp>
#include <srfs_msgs/srv/check_alive.hpp>

#include "base/file.hpp"
#include "ros/serialized.hpp"
#include "suite/node.hpp"
#include "tests/dds_domain.hpp"
#include "tests/temporary_folder.hpp"

namespace srfs::ros {
namespace {

using srfs_msgs::msg::TaskFlags;
using srfs_msgs::srv::CheckAlive;

const Topic<TaskFlags> flags_topic{"/test/flags", {.depth = 4}, Priority::time};

/// One work thread serves both sides, so callbacks never overlap.
class RosTest : public testing::Test {
 protected:
  void SetUp() override {
    here_ = Participant::create({testing_support::own_domain(), {"127.0.0.1"}, &executor_}).value();
    there_ = Participant::create({testing_support::own_domain(), {"127.0.0.1"}, &executor_}).value();
  }
  bool wait(const std::function<bool()>& condition) {
    return executor_.spin_until(condition, monotonic_now() + seconds(20));
  }

  Executor executor_;
  std::unique_ptr<Participant> here_;
  std::unique_ptr<Participant> there_;
};

TEST_F(RosTest, MessagesArriveWholeAndInOrder) {
  std::vector<TaskFlags> got;
  Publisher<TaskFlags> publisher(*here_, flags_topic);
  Subscription<TaskFlags> subscription(executor_, *there_, flags_topic,
                                       [&](const TaskFlags& m, const MessageInfo&) { got.push_back(m); });
  ASSERT_TRUE(
      wait([&] { return publisher.subscription_count() == 1 && subscription.publisher_count() == 1; }));

  for (std::uint64_t i = 0; i < 50; ++i) {
    TaskFlags m;
    m.cycle = i;
    m.holder = "payload_eps";
    m.flags = {false, true};
    EXPECT_TRUE(publisher.publish(m));
    ASSERT_TRUE(wait([&] { return got.size() == i + 1; }));
    EXPECT_EQ(got.back(), m);
  }
  EXPECT_EQ(subscription.stats().lost, 0U);
}

TEST_F(RosTest, WhatTheHistoryDroppedIsCountedAsLost) {
  std::vector<std::uint64_t> got;
  Publisher<TaskFlags> publisher(*here_, flags_topic);
  Subscription<TaskFlags> subscription(
      executor_, *there_, flags_topic,
      [&](const TaskFlags& m, const MessageInfo&) { got.push_back(m.cycle); });
  std::uint64_t told = 0;
  subscription.on_lost([&](MonotonicTime, std::uint64_t messages) {
    told += messages;
    EXPECT_NE(got.back(), 40U) << "before the message that shows it";
  });
  ASSERT_TRUE(
      wait([&] { return publisher.subscription_count() == 1 && subscription.publisher_count() == 1; }));
  TaskFlags first;
  publisher.publish(first);
  ASSERT_TRUE(wait([&] { return got.size() == 1; }));

  // The work thread does not run while 40 messages meet a history of 4.
  for (std::uint64_t i = 1; i <= 40; ++i) {
    TaskFlags m;
    m.cycle = i;
    publisher.publish(m);
  }
  ASSERT_TRUE(wait([&] { return !got.empty() && got.back() == 40; }));
  EXPECT_EQ(got.size() + subscription.stats().lost, 41U);
  EXPECT_EQ(told, subscription.stats().lost);
}

TEST_F(RosTest, AMessageBeyondItsBoundsIsRefusedAndCounted) {
  Publisher<TaskFlags> publisher(*here_, flags_topic);
  TaskFlags m;
  m.flags.assign(17, true);
  EXPECT_FALSE(publisher.publish(m));
  EXPECT_EQ(publisher.refused(), 1U);
}

TEST_F(RosTest, APublisherTellsItsPeerFromOneThatOnlyListens) {
  const Topic<TaskFlags> questions{"/test/questions", {.depth = 4}, Priority::normal};
  const auto ignore = [](const TaskFlags&, const MessageInfo&) {};
  const auto recorder = Participant::create({testing_support::own_domain(), {"127.0.0.1"}}).value();
  Publisher<TaskFlags> answers(*here_, flags_topic);
  Subscription<TaskFlags> asked(executor_, *here_, questions, ignore);
  Subscription<TaskFlags> recorded(executor_, *recorder, flags_topic, ignore);
  Publisher<TaskFlags> asking(*there_, questions);
  ASSERT_TRUE(wait([&] { return answers.subscription_count() == 1 && asked.publisher_count() == 1; }));
  EXPECT_FALSE(answers.is_heard_by_a_publisher_of(asked)) << "only the recorder listens";

  Subscription<TaskFlags> heard(executor_, *there_, flags_topic, ignore);
  EXPECT_TRUE(wait([&] { return answers.is_heard_by_a_publisher_of(asked); }));
}

/// Claims the type of TaskFlags on the wire but has arbitrary content.
struct ForeignFlags {
  static constexpr const char* dds_type_name = TaskFlags::dds_type_name;
  std::vector<std::uint8_t> junk;
  template <class Self, class V>
  static void visit(Self& s, V& v) {
    v.sequence(s.junk, 0, 0);
  }
};

TEST_F(RosTest, ABestEffortSensorIsHeardByABestEffortReaderAlone) {
  const Topic<TaskFlags> sensor{"/test/sensor", {.depth = 8, .best_effort = true}};
  const Topic<TaskFlags> reliable{"/test/sensor", {.depth = 8}};
  std::vector<std::uint64_t> got;
  Publisher<TaskFlags> publisher(*there_, sensor);
  Subscription<TaskFlags> best_effort(
      executor_, *here_, sensor, [&](const TaskFlags& m, const MessageInfo&) { got.push_back(m.cycle); });
  Subscription<TaskFlags> strict(executor_, *here_, reliable,
                                 [](const TaskFlags&, const MessageInfo&) { FAIL() << "heard"; });
  ASSERT_TRUE(wait([&] {
    return publisher.subscription_count() == 1 && best_effort.publisher_count() == 1 &&
           strict.qos_events().incompatible == 1 && publisher.qos_events().incompatible == 1;
  }));
  EXPECT_EQ(strict.qos_events().incompatible_policy, "reliability");
  EXPECT_EQ(publisher.qos_events().incompatible_policy, "reliability");
  for (std::uint64_t n = 1; got.empty() || n <= 20; ++n) {
    TaskFlags m;
    m.cycle = n;
    EXPECT_TRUE(publisher.publish(m));
    (void)executor_.spin_until([] { return false; }, monotonic_now() + milliseconds(5));
    ASSERT_LT(n, 2000U);
  }
  EXPECT_EQ(strict.publisher_count(), 0U);
}

TEST_F(RosTest, AReliablePublisherIsHeardByABestEffortReader) {
  std::uint64_t got = 0;
  Publisher<TaskFlags> publisher(*there_, {"/test/reliable", {}});
  Subscription<TaskFlags> subscription(executor_, *here_, {"/test/reliable", {.best_effort = true}},
                                       [&](const TaskFlags&, const MessageInfo&) { ++got; });
  ASSERT_TRUE(
      wait([&] { return publisher.subscription_count() == 1 && subscription.publisher_count() == 1; }));
  ASSERT_TRUE(wait([&] { return publisher.publish({}) && got > 0; }));
}

TEST_F(RosTest, KeepAllRefusesTheNextSampleInsteadOfDroppingOne) {
  const Topic<TaskFlags> topic{"/test/keep_all", {.depth = 5, .keep_all = true}};
  std::vector<std::uint64_t> got;
  Publisher<TaskFlags> publisher(*there_, topic);
  Subscription<TaskFlags> subscription(
      executor_, *here_, topic, [&](const TaskFlags& m, const MessageInfo&) { got.push_back(m.cycle); });
  ASSERT_TRUE(
      wait([&] { return publisher.subscription_count() == 1 && subscription.publisher_count() == 1; }));
  std::uint64_t accepted = 0;
  while (true) {
    TaskFlags m;
    m.cycle = accepted + 1;
    if (!publisher.publish(m)) break;
    ++accepted;
    ASSERT_LE(accepted, 1000U) << "the reader takes nothing meanwhile";
  }
  EXPECT_GE(accepted, 5U);
  EXPECT_GT(publisher.refused(), 0U);
  EXPECT_TRUE(wait([&] { return got.size() == accepted; }));
  for (std::size_t i = 0; i < got.size(); ++i) EXPECT_EQ(got[i], i + 1);
  EXPECT_EQ(subscription.stats().lost, 0U);
  EXPECT_TRUE(wait([&] { return publisher.publish({}); })) << "when they are acknowledged";
}

TEST_F(RosTest, ADeadlineThatIsMissedIsCountedAtBothEnds) {
  const Topic<TaskFlags> topic{"/test/deadline", {.deadline = milliseconds(50)}};
  Publisher<TaskFlags> publisher(*there_, topic);
  Publisher<TaskFlags> without(*there_, {"/test/deadline", {}});
  Subscription<TaskFlags> subscription(executor_, *here_, topic, [](const TaskFlags&, const MessageInfo&) {});
  std::atomic<int> events = 0;
  subscription.on_qos_event([&] { ++events; });
  ASSERT_TRUE(
      wait([&] { return publisher.subscription_count() == 1 && subscription.publisher_count() == 1; }));
  ASSERT_TRUE(wait([&] { return without.qos_events().incompatible == 1; }));
  EXPECT_EQ(without.qos_events().incompatible_policy, "deadline");
  EXPECT_TRUE(publisher.publish({}));
  EXPECT_TRUE(wait([&] {
    return publisher.qos_events().deadlines_missed > 1 && subscription.qos_events().deadlines_missed > 1;
  }));
  EXPECT_GT(events, 1);
  subscription.on_qos_event({});
}

TEST_F(RosTest, AWriterThatProvesItsLivelinessByPublishingIsNotAliveWhenItStops) {
  const Topic<TaskFlags> topic{"/test/liveliness",
                               {.liveliness_lease = milliseconds(100), .manual_liveliness = true}};
  Publisher<TaskFlags> publisher(*there_, topic);
  Subscription<TaskFlags> subscription(executor_, *here_, topic, [](const TaskFlags&, const MessageInfo&) {});
  ASSERT_TRUE(
      wait([&] { return publisher.subscription_count() == 1 && subscription.publisher_count() == 1; }));
  EXPECT_TRUE(wait([&] { return publisher.publish({}) && subscription.qos_events().alive == 1; }));
  EXPECT_TRUE(wait([&] {
    return subscription.qos_events().liveliness_lost > 0 && publisher.qos_events().liveliness_lost > 0;
  }));
  EXPECT_TRUE(wait([&] { return publisher.publish({}) && subscription.qos_events().alive == 1; }));
}

TEST_F(RosTest, TheTopicsOfTheDomainAreKnownWithTypeAndQosUntilTheirEndsGo) {
  ParticipantOptions options{testing_support::own_domain(), {"127.0.0.1"}, &executor_};
  options.remember_topics = true;
  const auto observer = Participant::create(options).value();
  const auto find = [&]() -> std::optional<TopicEnds> {
    for (const TopicEnds& ends : observer->topics().topics()) {
      if (ends.topic == "rt/test/known") return ends;
    }
    return std::nullopt;
  };
  {
    const Publisher<TaskFlags> publisher(*here_,
                                         {"/test/known", {.transient_local = true, .best_effort = true}});
    const Subscription<TaskFlags> subscription(executor_, *there_, {"/test/known", {}},
                                               [](const TaskFlags&, const MessageInfo&) {});
    ASSERT_TRUE(wait([&] { return find() && find()->publishers == 1 && find()->subscriptions == 1; }));
    EXPECT_EQ(ros_type_name(find()->type), "srfs_msgs/msg/TaskFlags");
    EXPECT_TRUE(find()->best_effort);
    EXPECT_TRUE(find()->transient_local);
  }
  EXPECT_TRUE(wait([&] { return !find(); }));
  EXPECT_TRUE(here_->topics().topics().empty()) << "it was not asked to";
}

TEST_F(RosTest, AMessageOfATypeThatIsKnownByNameOnlyGoesThroughAsOctets) {
  const std::string type = "srfs_msgs/msg/TaskFlags";
  TaskFlags sent;
  sent.cycle = 7;
  Octets octets(encoded_size(sent));
  encode_into(sent, reinterpret_cast<char*>(octets.data()), octets.size());
  std::vector<Octets> heard;
  std::vector<std::uint64_t> got;
  SerializedPublisher publisher(*there_, "/test/octets", type, {});
  Subscription<TaskFlags> typed(executor_, *here_, {"/test/octets", {}},
                                [&](const TaskFlags& m, const MessageInfo&) { got.push_back(m.cycle); });
  ASSERT_TRUE(wait([&] { return publisher.subscription_count() == 1 && typed.publisher_count() == 1; }));
  EXPECT_TRUE(publisher.publish(octets));
  EXPECT_TRUE(wait([&] { return got.size() == 1; }));
  EXPECT_EQ(got.at(0), 7U);

  Publisher<TaskFlags> typed_publisher(*here_, {"/test/back", {}});
  SerializedSubscription subscription(
      executor_, *there_, "/test/back", type, {}, Priority::normal,
      [&](OctetView o, const MessageInfo&) { heard.emplace_back(o.begin(), o.end()); });
  ASSERT_TRUE(
      wait([&] { return typed_publisher.subscription_count() == 1 && subscription.publisher_count() == 1; }));
  EXPECT_TRUE(typed_publisher.publish(sent));
  EXPECT_TRUE(wait([&] { return heard.size() == 1; }));
  EXPECT_EQ(heard.at(0), octets);
  EXPECT_THROW(SerializedPublisher(*here_, "/test/octets", type, {}), std::runtime_error)
      << "here the topic is one of a C++ type";
  EXPECT_THROW(SerializedPublisher(*there_, "/test/octets", "std_msgs/msg/String", {}), std::runtime_error)
      << "the topic has another type";
  EXPECT_THROW(SerializedPublisher(*there_, "/test/x", "String", {}), std::runtime_error);
}

TEST_F(RosTest, AMalformedSampleIsCountedDroppedAndTheNextGoodOneArrives) {
  std::vector<std::uint64_t> got;
  WriterEndpoint foreign(*here_, topic_dds_name(flags_topic.name),
                         dds::TypeSupport(new TypeSupport<ForeignFlags>), flags_topic.qos);
  const auto other = Participant::create({testing_support::own_domain(), {"127.0.0.1"}}).value();
  Publisher<TaskFlags> good(*other, flags_topic);
  Subscription<TaskFlags> subscription(
      executor_, *there_, flags_topic,
      [&](const TaskFlags& m, const MessageInfo&) { got.push_back(m.cycle); });
  ASSERT_TRUE(wait([&] { return foreign.matched_count() == 1 && good.subscription_count() == 1; }));

  for (const std::size_t size : {0U, 1U, 7U, 3000U}) {
    ForeignFlags junk;
    junk.junk.assign(size, 0xff);
    const std::uint64_t before = subscription.stats().malformed;
    EXPECT_TRUE(foreign.write(&junk));
    ASSERT_TRUE(wait([&] { return subscription.stats().malformed == before + 1; })) << size;
  }
  TaskFlags m;
  m.cycle = 9;
  good.publish(m);
  ASSERT_TRUE(wait([&] { return !got.empty(); }));
  EXPECT_THAT(got, testing::ElementsAre(9));
}

TEST(Participants, MadeAndForgottenAllDayLongAreStillFound) {
  Executor executor;
  const auto here = Participant::create({testing_support::own_domain(), {"127.0.0.1"}, &executor}).value();
  const Publisher<TaskFlags> publisher(*here, flags_topic);
  std::set<GUID_t> guids;
  for (int i = 0; i < 40; ++i) {
    const auto there = Participant::create({testing_support::own_domain(), {"127.0.0.1"}, &executor}).value();
    const Subscription<TaskFlags> subscription(executor, *there, flags_topic,
                                               [](const TaskFlags&, const MessageInfo&) {});
    ASSERT_TRUE(executor.spin_until([&] { return subscription.publisher_count() == 1; },
                                    monotonic_now() + seconds(20)))
        << "number " << i;
    EXPECT_TRUE(guids.insert(subscription.guid()).second) << "a GUID names one reader for ever";
  }
}

class ServiceTest : public RosTest {
 protected:
  std::shared_ptr<Service<CheckAlive>> serve() {
    return std::make_shared<Service<CheckAlive>>(
        executor_, *here_, "/test/check_alive", Qos{}, Priority::liveness,
        [](const CheckAlive::Request& q, CheckAlive::Response& r) { r.nonce = q.nonce + 1; });
  }
  void SetUp() override {
    RosTest::SetUp();
    client_ = std::make_unique<Client<CheckAlive>>(executor_, *there_, "/test/check_alive", Qos{},
                                                   Priority::liveness);
  }
  void TearDown() override { client_.reset(); }
  std::unique_ptr<Client<CheckAlive>> client_;
};

TEST_F(ServiceTest, ACallMadeBeforeTheServerExistsIsAnsweredWhenItComes) {
  std::optional<std::uint64_t> answer;
  CheckAlive::Request request;
  request.nonce = 41;
  client_->call(request, seconds(15), 1,
                [&](const Result<CheckAlive::Response, CallError>& r) { answer = r.value().nonce; });
  const auto server = serve();
  ASSERT_TRUE(wait([&] { return answer.has_value(); }));
  EXPECT_EQ(*answer, 42U);
}

TEST_F(ServiceTest, ConcurrentCallsGetTheirOwnAnswers) {
  const auto server = serve();
  ASSERT_TRUE(wait([&] { return client_->is_ready(); }));
  std::map<std::uint64_t, std::uint64_t> answers;
  for (std::uint64_t i = 0; i < 8; ++i) {
    CheckAlive::Request request;
    request.nonce = i * 100;
    client_->call(request, seconds(5), 1, [&answers, i](const Result<CheckAlive::Response, CallError>& r) {
      answers[i] = r.value().nonce;
    });
  }
  ASSERT_TRUE(wait([&] { return answers.size() == 8; }));
  for (const auto& [i, nonce] : answers) EXPECT_EQ(nonce, i * 100 + 1);
}

TEST_F(ServiceTest, WithoutAServerACallFailsAtItsDeadlineAndSaysWhy) {
  std::optional<CallError> error;
  client_->call({}, milliseconds(50), 3,
                [&](const Result<CheckAlive::Response, CallError>& r) { error = r.error(); });
  ASSERT_TRUE(wait([&] { return error.has_value(); }));
  EXPECT_EQ(*error, CallError::no_server);
}

TEST_F(RosTest, ANodeWithoutASuiteHasItsNamespaceAndItsOtherNamesOnTheWire) {
  struct PlainNode : LifecycleNode {
    using LifecycleNode::LifecycleNode;
  };
  PlainNode node(
      {.names = NodeNames("probe", "/", {*parse_remap_rule("__ns:=/bus_b"), *parse_remap_rule("/a:=/b")}),
       .executor = executor_,
       .participant = *here_});
  int heard = 0;
  const Topic<srfs_msgs::msg::TaskFlags> topic{"/a", {}};
  const auto flags = node.create_subscription(topic, [&](const srfs_msgs::msg::TaskFlags&) { ++heard; });
  Publisher<srfs_msgs::msg::TaskFlags> publisher(*there_, {"/b", {}});
  Client<lifecycle_msgs::srv::GetState> client(executor_, *there_, "/bus_b/probe/get_state", Qos{},
                                               Priority::normal);
  std::optional<std::string> state;
  client.call({}, seconds(15), 1, [&](const auto& answer) {
    if (answer) state = answer->current_state.label;
  });
  ASSERT_TRUE(wait([&] {
    publisher.publish({});
    return state.has_value() && heard > 0;
  }));
  EXPECT_EQ(state, "unconfigured");
  EXPECT_TRUE(node.go_to(State::active));
  EXPECT_EQ(node.parameters().names(),
            (std::vector<std::string>{"callback_budget_ms", "log_level", "service_budget_ms",
                                      "transition_deadline_ms"}));
}

class TestNode : public suite::Node {
 public:
  explicit TestNode(suite::NodeContext& context) : Node(context) {
    declare_parameter("period_ms", std::int64_t{100}, ParameterRange{10, 1000}, "Period");
  }
  std::vector<std::string> calls;
  CallbackReturn configure_result = CallbackReturn::success;
  CallbackReturn error_result = CallbackReturn::success;

 protected:
  CallbackReturn on_configure() override { return note("configure", configure_result); }
  CallbackReturn on_activate() override { return note("activate", CallbackReturn::success); }
  CallbackReturn on_deactivate() override { return note("deactivate", CallbackReturn::success); }
  CallbackReturn on_cleanup() override { throw std::runtime_error("cannot clean"); }
  CallbackReturn on_error() override { return note("error", error_result); }

 private:
  CallbackReturn note(const char* call, CallbackReturn result) {
    calls.emplace_back(call);
    return result;
  }
};

class NodeTest : public RosTest {
 protected:
  void SetUp() override {
    RosTest::SetUp();
    ASSERT_TRUE(write_file_atomically(
        folder_ / "d.yaml",
        "deployment: t\nnodes: [{name: probe, executable: x, parameters: {period_ms: 50}}]\n"));
    deployment_ = std::make_unique<suite::Deployment>(suite::Deployment::load(folder_ / "d.yaml"));
    context_ = std::make_unique<suite::NodeContext>(
        suite::NodeContext{"probe", *deployment_, suite::VarPaths{folder_}, 7, executor_, *here_});
    node_ = std::make_unique<TestNode>(*context_);
  }
  void TearDown() override { node_.reset(); }
  template <class S>
  typename S::Response call(const std::string& name, const typename S::Request& request) {
    Client<S> client(executor_, *there_, name, Qos{}, Priority::normal);
    std::optional<typename S::Response> answer;
    client.call(request, seconds(15), 1, [&](const Result<typename S::Response, CallError>& r) {
      if (r) answer = *r;
    });
    EXPECT_TRUE(wait([&] { return answer.has_value(); })) << name;
    return answer.value_or(typename S::Response{});
  }
  bool change(const std::string& label) {
    lifecycle_msgs::srv::ChangeState_Request request;
    request.transition.label = label;
    return call<lifecycle_msgs::srv::ChangeState>("/probe/change_state", request).success;
  }
  const testing_support::TemporaryFolder temporary_;
  const std::filesystem::path folder_ = temporary_.path();
  std::unique_ptr<suite::Deployment> deployment_;
  std::unique_ptr<suite::NodeContext> context_;
  std::unique_ptr<TestNode> node_;
};

TEST_F(NodeTest, IsDrivenThroughItsStatesOverTheWireAndRemembersTheDesiredOne) {
  EXPECT_EQ(call<lifecycle_msgs::srv::GetState>("/probe/get_state", {}).current_state.label, "unconfigured");
  EXPECT_TRUE(change("configure"));
  EXPECT_TRUE(change("activate"));
  EXPECT_EQ(call<lifecycle_msgs::srv::GetState>("/probe/get_state", {}).current_state.id, 3);
  EXPECT_FALSE(change("configure")) << "not in this state";
  EXPECT_TRUE(change("deactivate"));
  EXPECT_THAT(node_->calls, testing::ElementsAre("configure", "activate", "deactivate"));
  EXPECT_EQ(read_file(folder_ / "state/probe/desired_state").value(), "inactive\n");
}

TEST_F(NodeTest, ANameOrValueOf200000CharactersDoesNotComeBack) {
  const std::string text(200'000, 'x');
  rcl_interfaces::msg::Parameter long_name;
  long_name.name = text;
  long_name.value.type = rcl_interfaces::msg::ParameterType::PARAMETER_BOOL;
  rcl_interfaces::msg::Parameter long_value;
  long_value.name = "period_ms";
  long_value.value.type = rcl_interfaces::msg::ParameterType::PARAMETER_STRING;
  long_value.value.string_value = text;
  for (const auto& parameter : {long_name, long_value}) {
    rcl_interfaces::srv::SetParameters_Request set;
    set.parameters = {parameter};
    const auto results = call<rcl_interfaces::srv::SetParameters>("/probe/set_parameters", set).results;
    EXPECT_FALSE(results.at(0).successful);
    EXPECT_LE(results.at(0).reason.size(), longest_refusal);
  }
  rcl_interfaces::srv::DescribeParameters_Request describe;
  describe.names = {text};
  const auto described =
      call<rcl_interfaces::srv::DescribeParameters>("/probe/describe_parameters", describe).descriptors;
  EXPECT_LE(described.at(0).name.size(), longest_refusal);
  EXPECT_FALSE(change(text));
  EXPECT_LE(node_->last_transition().label.size(), longest_refusal);
}

TEST_F(NodeTest, AFailingConfigureLeavesItUnconfigured) {
  node_->configure_result = CallbackReturn::failure;
  EXPECT_FALSE(change("configure"));
  EXPECT_EQ(node_->state(), State::unconfigured);
}

TEST_F(NodeTest, AnExceptionInATransitionIsProcessedAsAnError) {
  ASSERT_TRUE(node_->go_to(State::inactive));
  EXPECT_FALSE(change("cleanup"));
  EXPECT_EQ(node_->state(), State::unconfigured) << "on_error succeeded";

  ASSERT_TRUE(node_->go_to(State::inactive));
  node_->error_result = CallbackReturn::failure;
  EXPECT_FALSE(change("cleanup"));
  EXPECT_EQ(node_->state(), State::finalized);
}

TEST_F(NodeTest, ParametersAreReadListedAndSetWithReasons) {
  rcl_interfaces::srv::GetParameters_Request get;
  get.names = {"period_ms", "nonsense"};
  const auto values = call<rcl_interfaces::srv::GetParameters>("/probe/get_parameters", get).values;
  EXPECT_EQ(values.at(0).integer_value, 50) << "from the deployment file";
  EXPECT_EQ(values.at(1).type, 0);

  rcl_interfaces::srv::SetParameters_Request set;
  set.parameters.resize(2);
  set.parameters[0].name = "period_ms";
  set.parameters[0].value.type = 2;
  set.parameters[0].value.integer_value = 200;
  set.parameters[1] = set.parameters[0];
  set.parameters[1].value.integer_value = 5000;
  const auto results = call<rcl_interfaces::srv::SetParameters>("/probe/set_parameters", set).results;
  EXPECT_TRUE(results.at(0).successful);
  EXPECT_EQ(results.at(1).reason, "parameter 'period_ms': 5000 is outside 10..1000");
  EXPECT_THAT(
      call<rcl_interfaces::srv::ListParameters>("/probe/list_parameters", {}).result.names,
      testing::UnorderedElementsAre("period_ms", "log_level", "callback_budget_ms", "service_budget_ms",
                                    "transition_deadline_ms", "parameter_trial_s"));
}

TEST(Executor, RunsTimersOnTheirGridAndCountsMissedPeriods) {
  Executor executor;
  int runs = 0;
  const auto start = monotonic_now();
  const auto timer = executor.add_timer(start - milliseconds(35), milliseconds(10), [&] { ++runs; });
  EXPECT_TRUE(executor.spin_until([&] { return runs == 2; }, start + seconds(10)));
  EXPECT_GE(executor.missed_timer_periods(), 3U) << "three deadlines had passed before the first wake-up";
}

TEST(Executor, WhatATimerHoldsGoesWithItsHandle) {
  Executor executor;
  auto held = std::make_shared<int>(1);
  const std::weak_ptr<int> watched = held;
  auto timer = executor.add_timer(monotonic_now() + seconds(60), nanoseconds(0), [held] {});
  held.reset();
  EXPECT_FALSE(watched.expired());
  timer.reset();
  EXPECT_TRUE(watched.expired());
}

TEST(Executor, APeriodicTimerMayEndItself) {
  Executor executor;
  int runs = 0;
  Timer timer;
  timer = executor.add_timer(monotonic_now(), milliseconds(1), [&] {
    ++runs;
    timer.reset();
  });
  bool later = false;
  const auto end =
      executor.add_timer(monotonic_now() + milliseconds(10), nanoseconds(0), [&] { later = true; });
  EXPECT_TRUE(executor.spin_until([&] { return later; }, monotonic_now() + seconds(10)));
  EXPECT_EQ(runs, 1);
}

TEST(Executor, WhatTheWorkThreadPostsItselfIsRunWithoutWaitingForAnotherWakeUp) {
  Executor executor;
  int chain = 0;
  std::function<void()> next = [&] {
    if (++chain < 100) executor.post(next);
  };
  const auto start = executor.add_timer(monotonic_now(), nanoseconds(0), next);
  // Count turns, not time: a turn that misses the wake-up of a post waits for up to a minute.
  for (int turn = 0; turn < 110 && chain < 100; ++turn) executor.spin_once(seconds(60));
  EXPECT_EQ(chain, 100);
}

TEST(Executor, ADroppedTimerNeverRunsAndADroppedWatchNeverFires) {
  Executor executor;
  bool ran = false;
  {
    const auto dropped = executor.add_timer(monotonic_now(), nanoseconds(0), [&] { ran = true; });
  }
  bool done = false;
  const auto later =
      executor.add_timer(monotonic_now() + milliseconds(5), nanoseconds(0), [&] { done = true; });
  EXPECT_TRUE(executor.spin_until([&] { return done; }, monotonic_now() + seconds(10)));
  EXPECT_FALSE(ran);
}

TEST(Worker, RunsJobsElsewhereAndTheirResultsOnTheWorkThread) {
  Executor executor;
  Worker worker(executor, "test", 4, milliseconds(3000));
  const auto work_thread = std::this_thread::get_id();
  std::thread::id job_thread;
  std::thread::id done_thread;
  EXPECT_TRUE(worker.post([&] { job_thread = std::this_thread::get_id(); },
                          [&] { done_thread = std::this_thread::get_id(); }));
  EXPECT_TRUE(
      executor.spin_until([&] { return done_thread != std::thread::id(); }, monotonic_now() + seconds(10)));
  EXPECT_NE(job_thread, work_thread);
  EXPECT_EQ(done_thread, work_thread);
}

TEST(Worker, RefusesAndCountsWhatItsQueueCannotHold) {
  Executor executor;
  Worker worker(executor, "test", 2, milliseconds(3000));
  std::mutex gate;
  gate.lock();
  int taken = 0;
  for (int i = 0; i < 10; ++i) taken += worker.post([&] { const std::lock_guard wait(gate); }) ? 1 : 0;
  EXPECT_LE(taken, 3);
  EXPECT_EQ(worker.progress().refused, static_cast<std::uint64_t>(10 - taken));
  gate.unlock();
  worker.drain();
}

}  // namespace
}  // namespace srfs::ros
