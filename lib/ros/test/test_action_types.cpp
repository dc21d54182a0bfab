// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
// Octets of an action's types on the wire, compared with hand-written layouts (ROS2_WIRE: plain CDR,
// little-endian, alignment from the body).

#include <gtest/gtest.h>

#include <action_msgs/msg/goal_status_array.hpp>
#include <action_msgs/srv/cancel_goal.hpp>
#include <example_interfaces/action/fibonacci.hpp>

#include "ros/type_support.hpp"

namespace srfs::ros {
namespace {

using example_interfaces::action::Fibonacci;

template <class M>
std::string octets(const M& message) {
  Octets out(encoded_size(message));
  encode_into(message, reinterpret_cast<char*>(out.data()), out.size());
  M back;
  EXPECT_TRUE(decode_from(out, back));
  EXPECT_EQ(back, message);
  return to_hex(out);
}

const std::string header = "00010000";
const std::string uuid = "000102030405060708090a0b0c0d0e0f";

template <class M>
void set_goal_id(M& message) {
  for (std::uint8_t i = 0; i < 16; ++i) message.goal_id.uuid[i] = i;
}

TEST(ActionTypes, SendGoalIsTheIdAndTheGoalAndIsAnsweredWithAcceptanceAndStamp) {
  Fibonacci::SendGoal::Request request;
  set_goal_id(request);
  request.goal.order = 5;
  EXPECT_EQ(octets(request), header + uuid + "05000000");

  Fibonacci::SendGoal::Response response;
  response.accepted = true;
  response.stamp.sec = 0x11223344;
  response.stamp.nanosec = 7;
  EXPECT_EQ(octets(response), header + "01000000" + "44332211" + "07000000") << "padding to the stamp";
}

TEST(ActionTypes, GetResultIsTheIdAndIsAnsweredWithStatusAndResult) {
  Fibonacci::GetResult::Request request;
  set_goal_id(request);
  EXPECT_EQ(octets(request), header + uuid);

  Fibonacci::GetResult::Response response;
  response.status = 4;
  response.result.sequence = {0, 1, -1};
  EXPECT_EQ(octets(response), header + "04000000" + "03000000" + "00000000" + "01000000" + "ffffffff");
}

TEST(ActionTypes, FeedbackIsTheIdAndTheFeedback) {
  Fibonacci::FeedbackMessage message;
  set_goal_id(message);
  message.feedback.sequence = {2};
  EXPECT_EQ(octets(message), header + uuid + "01000000" + "02000000");
}

TEST(ActionTypes, CancelGoalAndStatusAreTheStandardOnes) {
  action_msgs::srv::CancelGoal::Request cancel;
  set_goal_id(cancel.goal_info);
  cancel.goal_info.stamp.sec = 1;
  EXPECT_EQ(octets(cancel), header + uuid + "01000000" + "00000000");

  action_msgs::srv::CancelGoal::Response canceling;
  canceling.return_code = 2;
  canceling.goals_canceling = {cancel.goal_info};
  EXPECT_EQ(octets(canceling), header + "02000000" + "01000000" + uuid + "01000000" + "00000000");

  action_msgs::msg::GoalStatusArray status;
  status.status_list.resize(2);
  status.status_list[0] = {cancel.goal_info, 2};
  status.status_list[1] = {cancel.goal_info, 6};
  EXPECT_EQ(octets(status), header + "02000000" + uuid + "01000000" + "00000000" + "02" + uuid + "000000" +
                                "01000000" + "00000000" + "06000000")
      << "the id follows the status at once, its stamp is aligned, the payload padded";
}

TEST(ActionTypes, NamesAreThoseOfRmwFastrtps) {
  EXPECT_STREQ(Fibonacci::SendGoal::Request::dds_type_name,
               "example_interfaces::action::dds_::Fibonacci_SendGoal_Request_");
  EXPECT_STREQ(Fibonacci::SendGoal::Response::dds_type_name,
               "example_interfaces::action::dds_::Fibonacci_SendGoal_Response_");
  EXPECT_STREQ(Fibonacci::GetResult::Request::dds_type_name,
               "example_interfaces::action::dds_::Fibonacci_GetResult_Request_");
  EXPECT_STREQ(Fibonacci::GetResult::Response::dds_type_name,
               "example_interfaces::action::dds_::Fibonacci_GetResult_Response_");
  EXPECT_STREQ(Fibonacci::FeedbackMessage::dds_type_name,
               "example_interfaces::action::dds_::Fibonacci_FeedbackMessage_");
  EXPECT_STREQ(action_msgs::srv::CancelGoal::Request::dds_type_name,
               "action_msgs::srv::dds_::CancelGoal_Request_");
  EXPECT_STREQ(action_msgs::msg::GoalStatusArray::dds_type_name, "action_msgs::msg::dds_::GoalStatusArray_");
}

}  // namespace
}  // namespace srfs::ros
