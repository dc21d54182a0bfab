// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
// ttc and the parameters of the nodes: the PUS service 20 over their ROS 2 parameter services.
#include "nodes/ttc/ttc_node.hpp"

namespace srfs {
namespace {

using rcl_interfaces::srv::GetParameters;
using rcl_interfaces::srv::SetParameters;

/// Of one call, the search for the node's service in it.
constexpr seconds answer_deadline{4};

std::optional<NodeValue> to_node_value(const ros::ParameterValue& value) {
  return std::visit(
      [](const auto& v) -> std::optional<NodeValue> {
        using Type = std::decay_t<decltype(v)>;
        if constexpr (std::is_constructible_v<NodeValue, Type>) return NodeValue(v);
        return std::nullopt;
      },
      value);
}

ros::ParameterValue to_ros(const NodeValue& value) {
  return std::visit([](const auto& v) { return ros::ParameterValue(v); }, value);
}

}  // namespace

void TtcNode::ask_nodes() {
  if (const auto call = link_->parameters.next_call(monotonic_now()))
    call->value ? set_value(*call) : ask_for_value(*call);
  for (const RefusedValue& refused : link_->parameters.take_refused()) {
    mission::ParameterRefusedEvent event;
    event.parameter = refused.parameter;
    event.reason = refused.reason;
    raise(event);
  }
}

void TtcNode::ask_for_value(const ParameterCall& call) {
  auto& client = get_clients_[call.node];
  if (!client) client = create_client<GetParameters>("/" + call.node + "/get_parameters");
  GetParameters::Request request;
  request.names = {call.parameter};
  client->call(request, answer_deadline, 1,
               [this, number = call.number](const ros::Client<GetParameters>::Outcome& outcome) {
                 ParameterService& parameters = link_->parameters;
                 if (!outcome) {
                   parameters.on_error(number, ParameterCallError::no_answer);
                 } else {
                   const auto ros_value =
                       outcome->values.empty() ? std::nullopt : ros::from_message(outcome->values.front());
                   const auto value = ros_value ? to_node_value(*ros_value) : std::nullopt;
                   value ? parameters.on_value(number, *value)
                         : parameters.on_error(number, ParameterCallError::no_such_parameter);
                 }
                 if (is_active()) settle();
               });
}

void TtcNode::set_value(const ParameterCall& call) {
  auto& client = set_clients_[call.node];
  if (!client) client = create_client<SetParameters>("/" + call.node + "/set_parameters");
  rcl_interfaces::msg::Parameter parameter;
  parameter.name = call.parameter;
  parameter.value = ros::to_message(to_ros(*call.value));
  SetParameters::Request request;
  request.parameters = {parameter};
  client->call(request, answer_deadline, 1,
               [this, number = call.number](const ros::Client<SetParameters>::Outcome& outcome) {
                 ParameterService& parameters = link_->parameters;
                 if (!outcome) {
                   parameters.on_error(number, ParameterCallError::no_answer);
                 } else if (outcome->results.empty()) {
                   parameters.on_error(number, ParameterCallError::no_such_parameter);
                 } else if (const auto& result = outcome->results.front(); result.successful) {
                   parameters.on_set(number, {});
                 } else {
                   parameters.on_set(number, Err(result.reason));
                 }
                 if (is_active()) settle();
               });
}

}  // namespace srfs
