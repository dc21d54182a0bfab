// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
// Arguments of services 12, 19, 20 and 23. All arguments that the dictionary accepts become orders and calls
// within their bounds, and every request ends.
#include <cstdlib>

#include <mission/structures.hpp>

#include "nodes/ttc/files/file_service.hpp"
#include "nodes/ttc/services/event_action_service.hpp"
#include "nodes/ttc/services/monitoring_service.hpp"
#include "nodes/ttc/services/parameter_service.hpp"

namespace {

using namespace srfs;

void require(bool condition) {
  if (!condition) std::abort();
}

/// The first octet selects the command; the rest are its arguments.
void serve(const mission::Dictionary& dictionary, OctetView input) {
  static const std::vector<const mission::Command*> commands = [&] {
    std::vector<const mission::Command*> found;
    for (const auto& services : {std::pair(20, 23), std::pair(12, 19)}) {  // in the order of the seeds
      for (const auto& command : dictionary.commands()) {
        if (command.service == services.first || command.service == services.second)
          found.push_back(&command);
      }
    }
    return found;
  }();
  const mission::Command& command = *commands[input[0] % commands.size()];
  const OctetView arguments = input.subspan(1);
  if (!dictionary.check_arguments(command, arguments)) return;

  const Telecommand telecommand{.origin = {.apid = 1, .ack_flags = wire::ack::all},
                                .command = &command,
                                .arguments = {arguments.begin(), arguments.end()}};
  const MonotonicTime now(seconds(1));
  ReportQueue report_queue;
  FileService files(report_queue, 1);
  ParameterService parameters(dictionary, report_queue, 1);
  if (command.service == 12) {
    MonitoringService monitoring(dictionary, {}, report_queue);
    monitoring.execute(telecommand, now);
    if (const auto change = monitoring.take_change(now)) monitoring.on_stored(*change, true, now);
    monitoring.go_on(1U << 20, now);
    require(monitoring.monitoring().table().size() <= Monitoring::max_definitions);
  } else if (command.service == 19) {
    EventActionService actions(dictionary, report_queue);
    actions.load({}, [](OctetView) { return std::nullopt; });
    actions.execute(telecommand, now);
    if (const auto change = actions.take_change(now)) actions.on_stored(*change, true, now);
    actions.go_on(1U << 20, now);
    actions.on_event(1, mission::event::node_error, now);
    require(actions.table().size() <= EventActionService::max_actions && actions.waiting() <= 2);
  } else if (command.service == 23) {
    files.execute(telecommand, now);
    if (const auto order = files.next_order(now)) {
      require(order->repository.size() <= 255 && order->name.size() <= 255 && order->operations.size() <= 16);
      require(order->action != FileAction::copy || order->operations.size() == 1);
      files.on_outcome({.unfinished = true}, now);
      require(files.next_order(now).has_value());
      files.on_outcome({}, now);
    }
  } else {
    parameters.execute(telecommand, now);
    for (int calls = 0; const auto call = parameters.next_call(now); ++calls) {
      require(calls < 16);
      if (call->value) {
        parameters.on_set(call->number, {});
      } else {
        parameters.on_value(call->number, NodeValue(std::int64_t{1}));
      }
    }
  }
  // The end of the request was reported exactly once.
  require(report_queue.counters().completed + report_queue.counters().failed == 1);
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  static const auto dictionary = srfs::mission::Dictionary::load(srfs::mission::Dictionary::default_folder());
  if (size > 0) serve(dictionary, {data, size});
  return 0;
}
