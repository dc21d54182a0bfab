// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
// maintenance and the parameters of the nodes: what is kept, confirmed, restored and reset, by
// ~/save_parameters.
#include <mission/structures.hpp>

#include "nodes/maintenance/generation_line.hpp"
#include "nodes/maintenance/maintenance_node.hpp"

namespace srfs {
namespace {

using srfs_msgs::srv::SaveParameters;

/// Of one attempt: the search for the node's service and a write to its disk.
constexpr auto save_deadline = seconds(4);
constexpr int save_attempts = 2;  // a repeat names its first attempt: done once
constexpr const char* save_origin = "telecommand";
constexpr std::size_t longest_reason = 150;

/// What a telecommand asks of a node.
struct SaveOrder {
  std::string node;
  SaveParameters::Request request;
};

template <class Command>
Result<SaveOrder, FailureCode> order_of(OctetView arguments, std::uint8_t operation) {
  const auto command = Command::decode(arguments);
  if (!command) {
    return Err(command.error().parameter == 0 ? mission::failure::bad_arguments_length
                                              : mission::failure::bad_argument);
  }
  SaveOrder order{.node = command->node, .request = {}};
  order.request.operation = operation;
  order.request.origin = save_origin;
  if constexpr (requires { command->generation; }) order.request.generation = command->generation;
  return order;
}

Result<SaveOrder, FailureCode> read_order(std::uint16_t function, OctetView arguments) {
  using Request = SaveParameters::Request;
  switch (function) {
    case mission::ParametersKeep::function_id:
      return order_of<mission::ParametersKeep>(arguments, Request::KEEP);
    case mission::ParametersConfirm::function_id:
      return order_of<mission::ParametersConfirm>(arguments, Request::CONFIRM);
    case mission::ParametersHistory::function_id:
      return order_of<mission::ParametersHistory>(arguments, Request::REPORT);
    case mission::ParametersRestore::function_id:
      return order_of<mission::ParametersRestore>(arguments, Request::RESTORE);
    case mission::ParametersFactoryReset::function_id:
      return order_of<mission::ParametersFactoryReset>(arguments, Request::RESET);
    default:
      return Err(mission::failure::unknown_function);
  }
}

}  // namespace

FailureCode MaintenanceNode::check_parameters(std::uint16_t function, OctetView arguments) const {
  const auto order = read_order(function, arguments);
  if (!order) return order.error();
  return deployment().find(order->node) == nullptr ? mission::failure::unknown_node : mission::failure::none;
}

void MaintenanceNode::execute_parameters(const StoredTelecommand& telecommand) {
  const auto order = read_order(telecommand.function, telecommand.arguments);
  if (!order) return finished(order.error());  // stored by a version that knew it
  auto& client = save_clients_[order->node];
  if (!client) client = create_client<SaveParameters>("/" + order->node + "/save_parameters");
  client->call(order->request, save_deadline, save_attempts,
               [this, node = order->node,
                operation = order->request.operation](const ros::Client<SaveParameters>::Outcome& outcome) {
                 if (!outcome) return finished(mission::failure::node_silent);
                 if (!outcome->success) {
                   log::error("{}: {}", node, outcome->reason);
                   raise(mission::ParameterRequestRefusedEvent{
                       .node = node, .reason = outcome->reason.substr(0, longest_reason)});
                   return finished(mission::failure::parameters_refused);
                 }
                 if (operation != SaveParameters::Request::REPORT) return finished(mission::failure::none);
                 report_generations(node, *outcome);
               });
}

void MaintenanceNode::report_generations(const std::string& node, const SaveParameters::Response& said) {
  for (const auto& line : to_mission(node, said)) {
    srfs_msgs::msg::PayloadTelemetry m;
    m.source = name();
    m.apid = mission::ParameterGenerationHousekeeping::apid;
    m.structure_id = mission::ParameterGenerationHousekeeping::structure_id;
    m.time_valid = false;  // the node's own clock; ttc stamps the report with mission time
    m.data = line.encoded();
    lines_.push_back(std::move(m));
  }
  send_next();
}

}  // namespace srfs
