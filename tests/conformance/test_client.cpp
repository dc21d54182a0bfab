// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
// One of our nodes as the client of a service that ROS 2 serves.

#include "tests/conformance/node_process.hpp"

namespace srfs::conformance {
namespace {

constexpr const char* get_state = "lifecycle_msgs::srv::dds_::GetState";

/// The server at /ros2_peer/get_state. The node sends one request at each activation and logs the answer.
class ClientOfRos2 : public ConformanceTest {
 protected:
  void SetUp() override {
    change("configure");
    change("activate");
    const auto request = requests_.next();
    ASSERT_TRUE(request);
    request_ = *request;
  }
  void TearDown() override {
    change("deactivate");
    change("cleanup");
  }
  void change(const std::string& label) {
    EXPECT_FALSE(change_.call(Cdr().u8(0).str(label).payload()).empty()) << label;
  }
  void reply(const rtps::GUID_t& to, const rtps::SequenceNumber_t& number, const std::string& state) {
    rtps::SampleIdentity related;
    related.writer_guid(to);
    related.sequence_number(number);
    replies_.write(Cdr().u8(77).str(state).payload(), related);
  }
  [[nodiscard]] bool node_heard(const std::string& state) {
    return log_
        .next([&](const ReceivedSample& s) {
          return std::string(s.payload.begin(), s.payload.end()).find("the peer is 77 '" + state + "'") !=
                 std::string::npos;
        })
        .has_value();
  }

  RawReader log_{peer_, "rt/rosout", "rcl_interfaces::msg::dds_::Log_", true};
  RawReader requests_{peer_, "rq/ros2_peer/get_stateRequest", std::string(get_state) + "_Request_"};
  RawWriter replies_{peer_, "rr/ros2_peer/get_stateReply", std::string(get_state) + "_Response_"};
  RawClient change_{peer_, "/probe/change_state", "lifecycle_msgs::srv::dds_::ChangeState"};
  ReceivedSample request_;
};

TEST_F(ClientOfRos2, TheRequestNamesTheReaderOfTheReplyAndNoNumber) {
  EXPECT_EQ(hex(request_.payload), "0001000000000000");
  const rtps::GUID_t& reader = request_.related.writer_guid();
  EXPECT_EQ(reader.guidPrefix, participant().guid.guidPrefix);
  EXPECT_EQ(request_.related.sequence_number(), rtps::SequenceNumber_t::unknown());
  bool is_reply_reader = false;
  for (const SeenEndpoint& endpoint : peer_.endpoints_of(participant().guid)) {
    is_reply_reader =
        is_reply_reader || (endpoint.guid == reader && endpoint.topic == "rr/ros2_peer/get_stateReply");
  }
  EXPECT_TRUE(is_reply_reader);
  reply(reader, request_.identity.sequence_number(), "asked");
  EXPECT_TRUE(node_heard("asked"));
}

TEST_F(ClientOfRos2, AReplyToTheRequestsWriterIsTaken) {
  reply(request_.identity.writer_guid(), request_.identity.sequence_number(), "by_writer");
  EXPECT_TRUE(node_heard("by_writer"));
}

TEST_F(ClientOfRos2, RepliesToOthersAreNotTaken) {
  reply(change_.replies.guid(), request_.identity.sequence_number(), "not_ours");
  rtps::SequenceNumber_t another = request_.identity.sequence_number();
  ++another;
  reply(request_.related.writer_guid(), another, "not_this_request");
  reply(request_.related.writer_guid(), request_.identity.sequence_number(), "ours");
  // The node's log is in order, so the first line about the peer counts.
  const auto line = log_.next([](const ReceivedSample& s) {
    const std::string text(s.payload.begin(), s.payload.end());
    return text.find("'not_ours'") != std::string::npos ||
           text.find("'not_this_request'") != std::string::npos || text.find("'ours'") != std::string::npos;
  });
  ASSERT_TRUE(line);
  EXPECT_NE(std::string(line->payload.begin(), line->payload.end()).find("'ours'"), std::string::npos);
}

}  // namespace
}  // namespace srfs::conformance
