// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
// The action protocol of a ROS 2 peer (rcl_action), on raw Fast DDS with hand-written octets. The server and
// the client under test are separate processes (action_peer).

#include <algorithm>
#include <set>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/conformance/ros2_peer.hpp"
#include "tests/node/ros/peer_process.hpp"

namespace srfs::conformance {
namespace {

using testing_support::PeerProcess;

const std::string package = "example_interfaces::action::dds_::Fibonacci_";
const std::string cancel_type = "action_msgs::srv::dds_::CancelGoal";
const std::string status_type = "action_msgs::msg::dds_::GoalStatusArray_";

enum Status : std::uint8_t { unknown, accepted, executing, canceling, succeeded, canceled, aborted };

Octets goal_id(std::uint8_t first) {
  Octets id;
  for (std::uint8_t i = 0; i < 16; ++i) id.push_back(static_cast<std::uint8_t>(first + i));
  return id;
}

Octets goal_request(const Octets& id, std::int32_t order) {
  return Cdr().raw(id).u32(static_cast<std::uint32_t>(order)).payload();
}

Octets sequence_after(const Octets& id, const std::vector<std::uint32_t>& sequence) {
  Cdr cdr;
  cdr.raw(id).u32(static_cast<std::uint32_t>(sequence.size()));
  for (const std::uint32_t n : sequence) cdr.u32(n);
  return cdr.payload();
}

Octets result_of(Status status, const std::vector<std::uint32_t>& sequence) {
  Cdr cdr;
  cdr.u8(status).u32(static_cast<std::uint32_t>(sequence.size()));
  for (const std::uint32_t n : sequence) cdr.u32(n);
  return cdr.payload();
}

struct GoalStatus {
  Octets id;
  std::uint32_t stamp_s;
  std::uint32_t stamp_ns;
  std::uint8_t status;
};

std::vector<GoalStatus> statuses(const Octets& payload) {
  CdrView view(payload);
  std::vector<GoalStatus> all(view.u32());
  for (GoalStatus& one : all) {
    one.id = view.raw(16);
    one.stamp_s = view.u32();
    one.stamp_ns = view.u32();
    one.status = view.u8();
  }
  EXPECT_TRUE(view.at_end());
  return all;
}

/// One server process and one peer for all tests; every test uses different goal ids.
class ActionServerConformance : public testing::Test {
 protected:
  static constexpr const char* name = "/conformance/fibonacci";
  static void SetUpTestSuite() {
    server_ = std::make_unique<PeerProcess>("server", name);
    peer_ = std::make_unique<Ros2Peer>(testing_support::own_domain());
  }
  static void TearDownTestSuite() {
    server_.reset();
    peer_.reset();
  }
  static std::string part(const char* what) { return std::string(name) + "/_action/" + what; }

  void SetUp() override {
    ASSERT_TRUE(wait_for([&] {
      return send_goal_.ready() && get_result_.ready() && cancel_.ready() && feedback_.matched() == 1 &&
             status_.matched() == 1;
    }));
  }
  /// @return the stamp of acceptance: seconds, nanoseconds
  std::pair<std::uint32_t, std::uint32_t> start(const Octets& id, std::int32_t order) {
    const Octets reply = send_goal_.call(goal_request(id, order));
    EXPECT_EQ(reply.size(), 16U);
    CdrView view(reply);
    EXPECT_EQ(view.u8(), 1) << "accepted";
    const std::uint32_t s = view.u32();
    return {s, view.u32()};
  }
  Octets result(const Octets& id) { return get_result_.call(Cdr().raw(id).payload()); }
  struct CancelAnswer {
    std::uint8_t code;
    std::vector<Octets> goals;
  };
  CancelAnswer cancel(const Octets& id, std::uint32_t stamp_s, std::uint32_t stamp_ns) {
    const Octets reply = cancel_.call(Cdr().raw(id).u32(stamp_s).u32(stamp_ns).payload());
    CdrView view(reply);
    CancelAnswer answer{view.u8(), {}};
    for (std::uint32_t left = view.u32(); left > 0; --left) {
      answer.goals.push_back(view.raw(16));
      view.u32();
      view.u32();
    }
    return answer;
  }
  bool status_becomes(const Octets& id, Status wanted) {
    return status_
        .next([&](const ReceivedSample& sample) {
          const auto all = statuses(sample.payload);
          return std::any_of(all.begin(), all.end(),
                             [&](const GoalStatus& one) { return one.id == id && one.status == wanted; });
        })
        .has_value();
  }

  static std::unique_ptr<PeerProcess> server_;
  static std::unique_ptr<Ros2Peer> peer_;
  RawClient send_goal_{*peer_, part("send_goal"), package + "SendGoal"};
  RawClient get_result_{*peer_, part("get_result"), package + "GetResult"};
  RawClient cancel_{*peer_, part("cancel_goal"), cancel_type};
  RawReader feedback_{*peer_, "rt" + part("feedback"), package + "FeedbackMessage_"};
  RawReader status_{*peer_, "rt" + part("status"), status_type, true};
};

std::unique_ptr<PeerProcess> ActionServerConformance::server_;
std::unique_ptr<Ros2Peer> ActionServerConformance::peer_;

TEST_F(ActionServerConformance, HasTheNamesTypesAndQosOfRclAction) {
  const auto all = peer_->participants();
  std::set<std::tuple<std::string, std::string, bool, bool>> seen;
  for (const auto& participant : all) {
    for (const auto& endpoint : peer_->endpoints_of(participant.guid)) {
      EXPECT_TRUE(endpoint.reliable) << endpoint.topic;
      seen.insert({endpoint.topic, endpoint.type, endpoint.is_reader, endpoint.transient_local});
    }
  }
  for (const auto& [service, type] : {std::pair<std::string, std::string>{"send_goal", package + "SendGoal"},
                                      {"get_result", package + "GetResult"},
                                      {"cancel_goal", cancel_type}}) {
    EXPECT_TRUE(seen.contains({"rq" + part(service.c_str()) + "Request", type + "_Request_", true, false}));
    EXPECT_TRUE(seen.contains({"rr" + part(service.c_str()) + "Reply", type + "_Response_", false, false}));
  }
  EXPECT_TRUE(seen.contains({"rt" + part("feedback"), package + "FeedbackMessage_", false, false}));
  EXPECT_TRUE(seen.contains({"rt" + part("status"), status_type, false, true}));
}

TEST_F(ActionServerConformance, AGoalIsAcceptedGivesFeedbackAndAResult) {
  std::uint16_t earlier = 0;
  ASSERT_TRUE(feedback_.heard([&] {
    Octets other(16, 0xEE);
    other[0] = static_cast<std::uint8_t>(earlier >> 8);
    other[1] = static_cast<std::uint8_t>(earlier++);
    start(other, 1);
    result(other);  // one at a time: the server takes no more than eight
  }));
  const Octets id = goal_id(0x10);
  const auto [stamp_s, stamp_ns] = start(id, 3);
  EXPECT_GT(stamp_s, 1'700'000'000U) << "UTC";
  EXPECT_LT(stamp_ns, 1'000'000'000U);
  EXPECT_EQ(hex(result(id)), hex(result_of(succeeded, {0, 1, 1}))) << "asked before the end, answered at it";

  const std::vector<std::vector<std::uint32_t>> steps{{0}, {0, 1}, {0, 1, 1}};
  for (const auto& step : steps) {
    const auto sample = feedback_.next([&](const ReceivedSample& s) {
      return std::search(s.payload.begin(), s.payload.end(), id.begin(), id.end()) != s.payload.end();
    });
    ASSERT_TRUE(sample);
    EXPECT_EQ(hex(sample->payload), hex(sequence_after(id, step)));
  }
  EXPECT_TRUE(status_becomes(id, succeeded));
  EXPECT_EQ(hex(result(id)), hex(result_of(succeeded, {0, 1, 1}))) << "kept after the end";
}

TEST_F(ActionServerConformance, TheStatusNamesTheGoalWithItsStamp) {
  const Octets id = goal_id(0x20);
  const auto [stamp_s, stamp_ns] = start(id, 3);
  const auto sample = status_.next([&](const ReceivedSample& s) {
    const auto all = statuses(s.payload);
    return std::any_of(all.begin(), all.end(), [&](const GoalStatus& one) { return one.id == id; });
  });
  ASSERT_TRUE(sample);
  for (const GoalStatus& one : statuses(sample->payload)) {
    if (one.id != id) continue;
    EXPECT_EQ(one.status, executing);
    EXPECT_EQ(one.stamp_s, stamp_s);
    EXPECT_EQ(one.stamp_ns, stamp_ns);
  }
  EXPECT_TRUE(status_becomes(id, succeeded));
}

TEST_F(ActionServerConformance, ARejectedGoalAndAnIdInUseAreNotAccepted) {
  EXPECT_EQ(send_goal_.call(goal_request(goal_id(0x30), -1)).at(4), 0);
  start(goal_id(0x31), 1);
  EXPECT_EQ(send_goal_.call(goal_request(goal_id(0x31), 1)).at(4), 0);
}

TEST_F(ActionServerConformance, TheResultOfAnUnknownGoalHasStatusUnknown) {
  EXPECT_EQ(hex(result(goal_id(0x40))), hex(result_of(unknown, {})));
}

TEST_F(ActionServerConformance, ARunningGoalIsCanceledByItsId) {
  const Octets id = goal_id(0x50);
  start(id, 0);
  const auto answer = cancel(id, 0, 0);
  EXPECT_EQ(answer.code, 0);
  EXPECT_THAT(answer.goals, testing::ElementsAre(id));
  EXPECT_EQ(result(id).at(4), canceled);
  const auto late = cancel(id, 0, 0);
  EXPECT_EQ(late.code, 3) << "terminated";
  EXPECT_TRUE(late.goals.empty());
  EXPECT_EQ(cancel(goal_id(0x51), 0, 0).code, 2) << "unknown";
}

TEST_F(ActionServerConformance, GoalsAreCanceledByTheirStampAndAllAtOnce) {
  const Octets none(16, 0);
  const Octets first = goal_id(0x60);
  const Octets second = goal_id(0x61);
  const auto [s, ns] = start(first, 0);
  start(second, 0);
  const auto before = cancel(none, s - 1, 0);
  EXPECT_EQ(before.code, 0);
  EXPECT_TRUE(before.goals.empty());
  EXPECT_THAT(cancel(none, s, ns).goals, testing::ElementsAre(first)) << "at or before the stamp";
  EXPECT_EQ(result(first).at(4), canceled);
  EXPECT_THAT(cancel(none, 0, 0).goals, testing::ElementsAre(second));
  EXPECT_EQ(result(second).at(4), canceled);
}

TEST_F(ActionServerConformance, AResultExpires) {
  const Octets id = goal_id(0x70);
  start(id, 1);
  EXPECT_EQ(result(id).at(4), succeeded);
  EXPECT_TRUE(wait_for([&] { return result(id).at(4) == unknown; }));
}

TEST_F(ActionServerConformance, MalformedRequestsAreDroppedAndTheNextGoodOneIsAnswered) {
  send_goal_.send({0, 1, 0, 0, 1, 2, 3, 4});
  get_result_.send({0, 1, 0, 0});
  cancel_.send({0, 1, 0, 0, 0xff, 0xff});
  EXPECT_EQ(hex(result(goal_id(0x80))), hex(result_of(unknown, {})));
  EXPECT_EQ(send_goal_.call(goal_request(goal_id(0x81), -1)).at(4), 0);
  EXPECT_EQ(cancel(goal_id(0x82), 0, 0).code, 2);
}

/// A server made of bare endpoints.
struct RawService {
  RawService(Ros2Peer& peer, const std::string& name, const std::string& type)
      : requests(peer, "rq" + name + "Request", type + "_Request_"),
        replies(peer, "rr" + name + "Reply", type + "_Response_") {}
  /// Names the request like a ROS 2 server, once the client's reader is known, like rmw_fastrtps.
  void answer(const ReceivedSample& request, const Octets& response) {
    ASSERT_TRUE(wait_for([&] { return replies.matched() > 0; }));
    rtps::SampleIdentity to = request.identity;
    to.writer_guid(request.related.writer_guid());
    replies.write(response, to);
  }
  RawReader requests;
  RawWriter replies;
};

/// The status writer, the only transient-local writer of an action: reliable, depth 1.
class StatusWriter {
 public:
  StatusWriter(Ros2Peer& peer, const std::string& topic) : peer_(peer) {
    dds::DataWriterQos qos = dds::DATAWRITER_QOS_DEFAULT;
    qos.reliability().kind = dds::RELIABLE_RELIABILITY_QOS;
    qos.durability().kind = dds::TRANSIENT_LOCAL_DURABILITY_QOS;
    qos.history().kind = dds::KEEP_LAST_HISTORY_QOS;
    qos.history().depth = 1;
    qos.endpoint().history_memory_policy = rtps::PREALLOCATED_WITH_REALLOC_MEMORY_MODE;
    qos.data_sharing().off();
    writer_ = peer.publisher().create_datawriter(peer.topic(topic, status_type), qos);
  }
  ~StatusWriter() { peer_.publisher().delete_datawriter(writer_); }
  StatusWriter(const StatusWriter&) = delete;
  StatusWriter& operator=(const StatusWriter&) = delete;
  void write(Octets payload) { EXPECT_TRUE(writer_->write(&payload)); }

 private:
  Ros2Peer& peer_;
  dds::DataWriter* writer_ = nullptr;
};

TEST(ActionClientConformance, OurClientDrivesAServerOfRos2) {
  const std::string name = "/conformance/raw_fibonacci/_action/";
  Ros2Peer peer(testing_support::own_domain());
  RawService send_goal(peer, name + "send_goal", package + "SendGoal");
  RawService get_result(peer, name + "get_result", package + "GetResult");
  RawService cancel(peer, name + "cancel_goal", cancel_type);
  RawWriter feedback(peer, "rt" + name + "feedback", package + "FeedbackMessage_");
  StatusWriter status(peer, "rt" + name + "status");
  PeerProcess client("client", "/conformance/raw_fibonacci");

  const auto goal = send_goal.requests.next();
  ASSERT_TRUE(goal);
  ASSERT_EQ(goal->payload.size(), 24U);
  const Octets id(goal->payload.begin() + 4, goal->payload.begin() + 20);
  EXPECT_EQ(id[6] >> 4, 4) << "a random UUID";
  EXPECT_EQ(id[8] >> 6, 2);
  EXPECT_EQ(hex(goal->payload), hex(goal_request(id, 3)));
  EXPECT_NE(goal->related.writer_guid(), rtps::GUID_t::unknown());
  EXPECT_EQ(goal->related.sequence_number(), rtps::SequenceNumber_t::unknown())
      << "as rmw_fastrtps leaves it";
  send_goal.answer(*goal, Cdr().u8(1).u32(1'800'000'000).u32(5).payload());

  const auto wanted = get_result.requests.next();
  ASSERT_TRUE(wanted);
  EXPECT_EQ(hex(wanted->payload), hex(Cdr().raw(id).payload()));
  status.write(Cdr().u32(1).raw(id).u32(1'800'000'000).u32(5).u8(executing).payload());
  feedback.write(sequence_after(id, {0}));
  status.write(Cdr().u32(1).raw(id).u32(1'800'000'000).u32(5).u8(succeeded).payload());
  get_result.answer(*wanted, result_of(succeeded, {0, 1, 1}));
  EXPECT_EQ(client.wait_for_exit(), 0);
}

}  // namespace
}  // namespace srfs::conformance
