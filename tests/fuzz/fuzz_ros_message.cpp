// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
// Feeds payloads from an arbitrary peer to the decoders of all types that our nodes subscribe to or serve,
// including the types of actions, and of a type with every kind of field. Input: one octet that selects the
// type, then the payload with its encapsulation header. Checks that a decoded payload decodes to the same
// value after it is encoded again, and that the memory it uses is limited by its number of octets.

#include <array>
#include <cstdlib>

#include <action_msgs/msg/goal_status_array.hpp>
#include <action_msgs/srv/cancel_goal.hpp>
#include <example_interfaces/action/fibonacci.hpp>
#include <lifecycle_msgs/srv/change_state.hpp>
#include <lifecycle_msgs/srv/get_available_transitions.hpp>
#include <lifecycle_msgs/srv/get_state.hpp>
#include <rcl_interfaces/msg/log.hpp>
#include <rcl_interfaces/msg/parameter_event.hpp>
#include <rcl_interfaces/srv/describe_parameters.hpp>
#include <rcl_interfaces/srv/list_parameters.hpp>
#include <rcl_interfaces/srv/set_parameters.hpp>
#include <sensor_msgs/msg/image.hpp>
#include <srfs_msgs/msg/bus_status.hpp>
#include <srfs_msgs/msg/event.hpp>
#include <srfs_msgs/msg/payload_telemetry.hpp>
#include <srfs_msgs/msg/system_mode.hpp>
#include <srfs_msgs/msg/task_flags.hpp>
#include <srfs_msgs/msg/telecommand.hpp>
#include <srfs_msgs/msg/telecommand_report.hpp>
#include <srfs_msgs/msg/time_tick.hpp>
#include <srfs_msgs/srv/check_alive.hpp>
#include <test_interfaces/msg/every.hpp>

#include "ros/graph.hpp"
#include "ros/type_support.hpp"

namespace {

using srfs::Octets;
using srfs::OctetView;

void require(bool condition) {
  if (!condition) std::abort();
}

template <class M>
Octets encoded(const M& message) {
  Octets out(srfs::ros::encoded_size(message));
  srfs::ros::encode_into(message, reinterpret_cast<char*>(out.data()), out.size());
  return out;
}

// Compare octets, not values, because a NaN is not equal to itself.
template <class M>
void decode(OctetView payload) {
  M message;
  if (!srfs::ros::decode_from(payload, message)) return;
  const Octets once = encoded(message);
  require(once.size() <=
          64 * (payload.size() + 1) + 4096);  // alignment and empty strings, not claimed lengths
  M again;
  require(srfs::ros::decode_from(once, again));
  require(encoded(again) == once);
}

using Fibonacci = example_interfaces::action::Fibonacci;
using Decode = void (*)(OctetView);

// Add new types at the end, because the corpus refers to types by number.
constexpr std::array<Decode, 30> decoders{
    decode<Fibonacci::SendGoal::Request>,
    decode<Fibonacci::SendGoal::Response>,
    decode<Fibonacci::GetResult::Request>,
    decode<Fibonacci::GetResult::Response>,
    decode<Fibonacci::FeedbackMessage>,
    decode<action_msgs::srv::CancelGoal::Request>,
    decode<action_msgs::srv::CancelGoal::Response>,
    decode<action_msgs::msg::GoalStatusArray>,
    decode<lifecycle_msgs::srv::ChangeState::Request>,
    decode<lifecycle_msgs::srv::GetState::Response>,
    decode<lifecycle_msgs::srv::GetAvailableTransitions::Response>,
    decode<rcl_interfaces::msg::Log>,
    decode<rcl_interfaces::msg::ParameterEvent>,
    decode<rcl_interfaces::srv::DescribeParameters::Request>,
    decode<rcl_interfaces::srv::DescribeParameters::Response>,
    decode<rcl_interfaces::srv::ListParameters::Request>,
    decode<rcl_interfaces::srv::SetParameters::Request>,
    decode<srfs::ros::HumbleGraphMessage>,
    decode<sensor_msgs::msg::Image>,
    decode<srfs_msgs::msg::BusStatus>,
    decode<srfs_msgs::msg::Event>,
    decode<srfs_msgs::msg::PayloadTelemetry>,
    decode<srfs_msgs::msg::SystemMode>,
    decode<srfs_msgs::msg::TaskFlags>,
    decode<srfs_msgs::msg::Telecommand>,
    decode<srfs_msgs::msg::TelecommandReport>,
    decode<srfs_msgs::msg::TimeTick>,
    decode<srfs_msgs::srv::CheckAlive::Request>,
    decode<srfs_msgs::srv::CheckAlive::Response>,
    decode<test_interfaces::msg::Every>,
};

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* input, std::size_t size) {
  if (size == 0) return 0;
  decoders.at(input[0] % decoders.size())(OctetView(input, size).subspan(1));
  return 0;
}
