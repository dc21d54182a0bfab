// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "nodes/ttc/command/telecommand_router.hpp"

#include <algorithm>

#include <fmt/format.h>

#include <mission/structures.hpp>

#include "base/config.hpp"
#include "nodes/ttc/services/connection_tester.hpp"
#include "nodes/ttc/services/own_functions.hpp"

namespace srfs {
namespace {

constexpr std::uint8_t function_service = 8;
constexpr std::uint8_t perform_function = 1;

}  // namespace

TelecommandRouter::TelecommandRouter(Parts parts, std::string own_node)
    : parts_(parts), own_node_(std::move(own_node)) {
  const mission::ApplicationProcess* own = parts_.dictionary.apid_of_node(own_node_);
  if (own == nullptr) throw ConfigError(fmt::format("mission dictionary: node '{}' has no APID", own_node_));
  own_apid_ = own->apid;
}

TelecommandOrigin TelecommandRouter::origin_of(const wire::TcPacket& packet) const {
  TelecommandOrigin origin{.request = wire::request_id(packet),
                           .apid = packet.apid,
                           .ack_flags = packet.ack_flags,
                           .source_id = packet.source_id};
  // Only ttc can answer for an application process that does not exist.
  if (parts_.dictionary.apid(origin.apid) == nullptr) origin.apid = own_apid_;
  return origin;
}

JudgedTelecommand TelecommandRouter::judge(OctetView packet, MonotonicTime now, bool room) {
  const auto parsed = wire::parse_tc_packet(packet);
  if (!parsed) return judge_malformed(packet, parsed.error());
  JudgedTelecommand judged;
  judged.origin = origin_of(*parsed);
  auto checked = check(*parsed, room, now);
  if (!checked) {
    judged.refusal = checked.error();
    return judged;
  }
  judged.command = checked->command;
  judged.arguments = std::move(checked->arguments);
  judged.expiry = now + judged.command->timeout;
  if (judged.command->hazardous) parts_.hazards.disarm(mission::DisarmReason::fired);  // once
  if (judged.command->node != own_node_) ++waiting_[judged.command->node];
  if (const auto mode = ModeService::mode_of(*judged.command, judged.arguments))
    modes_to_come_.push_back(*mode);
  return judged;
}

void TelecommandRouter::carry_out(const JudgedTelecommand& judged, bool durable, MonotonicTime now) {
  if (judged.command == nullptr) {
    refuse(judged.origin, judged.refusal);
    return;
  }
  const mission::Command& command = *judged.command;
  if (command.node != own_node_) --waiting_[command.node];
  if (ModeService::mode_of(command, judged.arguments)) modes_to_come_.erase(modes_to_come_.begin());
  if (!durable && !command.recovery) {
    refuse(judged.origin, Refusal{mission::failure::storage_unavailable, {}});
    return;
  }
  if (!durable) unstored_runs_.push_back(judged.origin.id);
  parts_.report_queue.success(judged.origin, Stage::acceptance);
  const ServiceRequest request{
      .origin = judged.origin, .command = command, .arguments = judged.arguments, .now = now};
  const auto mode = static_cast<std::uint8_t>(parts_.mode.mode());
  if (!command.allowed_in(mode)) {  // a mode change that it counted on did not come
    parts_.report_queue.failure(judged.origin, Stage::start, mission::failure::wrong_mode, Octets{mode});
  } else if (command.node == own_node_) {
    execute(request);
  } else if (!parts_.forwarder.submit(judged.origin, forwarded(request, judged.expiry), now)) {
    parts_.report_queue.failure(judged.origin, Stage::start, mission::failure::queue_full);
  }
}

void TelecommandRouter::restore(const RestoredTelecommand& restored, MonotonicTime now) {
  const auto parsed = wire::parse_tc_packet(restored.packet);
  const auto found = parsed ? find_command(*parsed) : Err(Refusal{});
  if (!found) {  // the dictionary of now does not have it
    parts_.report_queue.failure(restored.origin, Stage::completion, mission::failure::interrupted);
    return;
  }
  const mission::Command& command = **found;
  const Octets arguments = arguments_of(*parsed, command);
  const ServiceRequest request{
      .origin = restored.origin, .command = command, .arguments = arguments, .now = now, .repeated = true};
  if (command.node != own_node_) {
    parts_.forwarder.restore(restored.origin, forwarded(request, restored.expiry), restored.progress, now);
    return;
  }
  PusService* const service = service_of(command);
  if (service != nullptr && service->restore(request, restored.progress)) return;
  const bool again = command.repeat_class == mission::RepeatClass::idempotent &&
                     !restored.progress.other_boot && now < restored.expiry &&
                     command.allowed_in(static_cast<std::uint8_t>(parts_.mode.mode()));
  if (again) {
    execute(request);
  } else {
    parts_.report_queue.failure(restored.origin, Stage::completion, mission::failure::interrupted);
  }
}

Result<const mission::Command*, Refusal> TelecommandRouter::find_command(const wire::TcPacket& packet) const {
  const mission::Dictionary& dictionary = parts_.dictionary;
  if (dictionary.apid(packet.apid) == nullptr)
    return Err(Refusal{mission::failure::unknown_apid, {}, Stage::routing});
  if (packet.service == function_service && packet.subtype == perform_function) {
    OctetReader reader(packet.application);
    const std::uint16_t function_id = reader.u16();
    if (!reader.ok()) return Err(Refusal{mission::failure::bad_arguments_length, {}});
    const mission::Command* function = dictionary.function(packet.apid, function_id);
    if (function == nullptr)
      return Err(Refusal{mission::failure::unknown_function, octets_of_u16(function_id)});
    return function;
  }
  const mission::Command* request = dictionary.request(packet.apid, packet.service, packet.subtype);
  if (request != nullptr) return request;
  // Every application process can be asked whether it is alive; ttc asks its node.
  if (packet.service == ConnectionTester::service_type && packet.subtype == ConnectionTester::are_you_alive)
    return dictionary.request(own_apid_, packet.service, packet.subtype);
  const bool service_known =
      packet.service == function_service || dictionary.has_service(packet.apid, packet.service);
  return Err(
      Refusal{service_known ? mission::failure::unknown_subtype : mission::failure::unknown_service, {}});
}

Octets TelecommandRouter::arguments_of(const wire::TcPacket& packet, const mission::Command& command) {
  OctetView arguments(packet.application);
  if (command.is_function()) arguments = arguments.subspan(2);
  return {arguments.begin(), arguments.end()};
}

std::size_t TelecommandRouter::waiting_for(const std::string& node) const {
  const auto found = waiting_.find(node);
  return found == waiting_.end() ? 0 : found->second;
}

Result<TelecommandRouter::Checked, Refusal> TelecommandRouter::check(const wire::TcPacket& packet, bool room,
                                                                     MonotonicTime now) const {
  const auto command = find_command(packet);
  if (!command) return Err(command.error());
  const mission::Command& found = **command;
  const MissionMode to_come = modes_to_come_.empty() ? parts_.mode.mode() : modes_to_come_.back();
  const auto mode = static_cast<std::uint8_t>(to_come);
  if (!found.allowed_in(mode)) return Err(Refusal{mission::failure::wrong_mode, {mode}});

  Octets arguments = arguments_of(packet, found);
  if (const auto checked = parts_.dictionary.check_arguments(found, arguments); !checked) {
    const std::uint8_t position = checked.error().parameter;
    if (position == 0) return Err(Refusal{mission::failure::bad_arguments_length, {}});
    return Err(Refusal{mission::failure::bad_argument, {position}});
  }
  const PusService* const service = found.node == own_node_ ? service_of(found) : nullptr;
  if (service != nullptr) {
    if (auto refusal = service->why_refused(found, arguments)) return Err(std::move(*refusal));
  }
  if (found.hazardous && !parts_.hazards.is_armed(hazard_name(packet), now))
    return Err(Refusal{mission::failure::not_armed, {}});
  const bool taken =
      room && (found.node == own_node_ || parts_.forwarder.has_room(found.node, waiting_for(found.node)));
  if (!taken) return Err(Refusal{mission::failure::queue_full, {}});
  return Checked{&found, std::move(arguments)};
}

std::optional<std::pair<std::uint16_t, std::uint8_t>> TelecommandRouter::check_scheduled(
    OctetView packet) const {
  const auto parsed = wire::parse_tc_packet(packet);
  if (!parsed) return {{judge_malformed(packet, parsed.error()).refusal.code, std::uint8_t{0}}};
  const auto command = find_command(*parsed);
  if (!command) return {{command.error().code, std::uint8_t{0}}};
  const auto checked = parts_.dictionary.check_arguments(**command, arguments_of(*parsed, **command));
  if (checked) return std::nullopt;
  const std::uint8_t position = checked.error().parameter;
  return {
      {position == 0 ? mission::failure::bad_arguments_length : mission::failure::bad_argument, position}};
}

void TelecommandRouter::refuse(const TelecommandOrigin& origin, const Refusal& refusal) {
  parts_.report_queue.failure(origin, refusal.stage, refusal.code, refusal.parameter);
  if (rejected_.size() == max_rejected) rejected_.erase(rejected_.begin());
  rejected_.push_back(RejectedTelecommand{
      .apid = static_cast<std::uint16_t>(origin.request.packet_identification & 0x7FF),
      .sequence_count = static_cast<std::uint16_t>(origin.request.packet_sequence_control & 0x3FFF),
      .code = refusal.code});
}

JudgedTelecommand TelecommandRouter::judge_malformed(OctetView packet, wire::TcPacketError error) const {
  JudgedTelecommand judged;
  judged.origin.request = wire::peek_request_id(packet).value_or(wire::RequestId{});
  judged.origin.apid = own_apid_;
  judged.refusal.code = mission::failure::bad_length;
  if (error == wire::TcPacketError::bad_checksum) judged.refusal.code = mission::failure::bad_checksum;
  if (error == wire::TcPacketError::idle_packet)
    judged.refusal = {mission::failure::unknown_apid, {}, Stage::routing};
  if (error == wire::TcPacketError::bad_pus_version || error == wire::TcPacketError::no_secondary_header) {
    judged.refusal.code = mission::failure::unknown_service;
  }
  return judged;
}

ForwardedCommand TelecommandRouter::forwarded(const ServiceRequest& request, MonotonicTime expiry) {
  const mission::Command& command = request.command;
  return ForwardedCommand{.id = request.origin.id,
                          .target = command.node,
                          .apid = command.apid,
                          .function_id = command.function_id,
                          .repeat_class = static_cast<std::uint8_t>(command.repeat_class),
                          .expiry = expiry,
                          .arguments = {request.arguments.begin(), request.arguments.end()}};
}

PusService* TelecommandRouter::service_of(const mission::Command& command) const {
  const auto found = std::find_if(parts_.services.begin(), parts_.services.end(),
                                  [&](const PusService* service) { return service->provides(command); });
  return found == parts_.services.end() ? nullptr : *found;
}

void TelecommandRouter::execute(const ServiceRequest& request) {
  if (PusService* const service = service_of(request.command)) return service->execute(request);
  // In the dictionary, but this version of ttc does not do it.
  parts_.report_queue.failure(request.origin, Stage::start, mission::failure::unknown_function,
                              octets_of_u16(request.command.function_id));
}

}  // namespace srfs
