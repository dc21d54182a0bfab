// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
// Arguments of services 12, 19, 20, 23 and 128. All arguments that the dictionary accepts become orders and
// calls within their bounds, and every request ends.
#include <cstdlib>

#include <mission/structures.hpp>

#include "nodes/ttc/files/file_service.hpp"
#include "nodes/ttc/services/event_action_service.hpp"
#include "nodes/ttc/services/key_management_service.hpp"
#include "nodes/ttc/services/monitoring_service.hpp"
#include "nodes/ttc/services/parameter_service.hpp"

namespace {

using namespace srfs;

void require(bool condition) {
  if (!condition) std::abort();
}

/// On a spacecraft that has two session keys; one is used by an association, and its next key is the other.
void manage_keys(const Telecommand& telecommand, ReportQueue& report_queue) {
  const auto key = [](std::uint8_t first) { return wire::SdlsKey({first, 0x5A, 0x17}); };
  auto keys =
      wire::SessionKeys{}.uploaded(128, key(1))->uploaded(129, key(2))->activated(128)->activated(129);
  const wire::SessionKeys before = *keys->rekeyed(1, 128)->confirmed(1, 128).rekeyed(1, 129);
  UplinkConfig config;
  config.channels.push_back({.vc = 0, .associations = {}});
  config.channels[0].associations.push_back({.spi = 1, .key = key(3)});
  config.channels[0].associations.push_back({.spi = 5, .key = key(5), .set = std::nullopt});
  use_session_keys(config, before);
  std::vector<KeyEncryptionKey> masters;
  masters.push_back({.id = 1, .key = key(9)});
  UplinkChain uplink(std::move(config), {});
  KeyManagementService service(before, std::move(masters), {1}, uplink, report_queue);
  service.execute(telecommand, MonotonicTime(seconds(1)));
  while (const auto change = service.take_change()) service.on_stored(*change, true);
  const auto use = service.keys().use_of(1);
  require(use && use->current == 128 && service.keys().find(128) != nullptr);
  require(uplink.has_key(key(1).octets()) && uplink.has_key(key(5).octets()));
  require(wire::decode_session_keys(wire::encode_session_keys(service.keys())) == service.keys());
}

/// The first octet selects the command; the rest are its arguments.
void serve(const mission::Dictionary& dictionary, OctetView input) {
  static const std::vector<const mission::Command*> commands = [&] {
    std::vector<const mission::Command*> found;
    for (const auto& services :
         {std::pair(20, 23), std::pair(12, 19), std::pair(128, 128)}) {  // in the order of the seeds
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
  } else if (command.service == KeyManagementService::service_type) {
    manage_keys(telecommand, report_queue);
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
