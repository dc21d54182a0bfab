// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "nodes/ttc/command/telecommand_router.hpp"

#include <algorithm>

#include <fmt/format.h>

#include <mission/structures.hpp>

#include "base/config.hpp"
#include "nodes/ttc/services/own_functions.hpp"

namespace srfs {
namespace {

std::uint16_t apid_of(const mission::Dictionary& dictionary, const std::string& node) {
  const mission::ApplicationProcess* process = dictionary.apid_of_node(node);
  if (process == nullptr) throw ConfigError(fmt::format("mission dictionary: node '{}' has no APID", node));
  return process->apid;
}

}  // namespace

TelecommandRouter::TelecommandRouter(Parts parts, std::string own_node)
    : parts_(std::move(parts)),
      own_node_(std::move(own_node)),
      parser_(parts_.dictionary, apid_of(parts_.dictionary, own_node_)) {}

JudgedTelecommand TelecommandRouter::judge(OctetView packet, MonotonicTime now, bool room) {
  JudgedTelecommand judged = parser_.parse(packet);
  Telecommand& telecommand = judged.telecommand;
  if (!judged.refusal) judged.refusal = why_refused(telecommand, room, now);
  if (judged.refusal) return judged;
  const mission::Command& command = *telecommand.command;
  telecommand.expiry = now + command.timeout;
  if (command.hazardous) parts_.hazards.disarm(mission::DisarmReason::fired);  // once
  if (command.node != own_node_) ++waiting_[command.node];
  if (const auto mode = ModeService::mode_of(telecommand)) modes_to_come_.push_back(*mode);
  return judged;
}

void TelecommandRouter::carry_out(JudgedTelecommand judged, MonotonicTime now) {
  Telecommand& telecommand = judged.telecommand;
  const TelecommandOrigin origin = telecommand.origin;
  if (judged.refusal) return refuse(origin, *judged.refusal);
  const mission::Command& command = *telecommand.command;
  if (command.node != own_node_) --waiting_[command.node];
  if (ModeService::mode_of(telecommand)) modes_to_come_.erase(modes_to_come_.begin());
  if (!judged.durable && !command.recovery)
    return refuse(origin, Refusal{.code = mission::failure::storage_unavailable});
  if (!judged.durable) unstored_runs_.push_back(origin.id);
  parts_.report_queue.success(origin, Stage::acceptance);
  const auto mode = static_cast<std::uint8_t>(parts_.mode.mode());
  if (!command.allowed_in(mode)) {  // a mode change that it counted on did not come
    parts_.report_queue.failure(origin, Stage::start, mission::failure::wrong_mode, Octets{mode});
  } else if (command.node == own_node_) {
    execute(telecommand, now);
  } else if (!parts_.forwarder.submit(std::move(telecommand), now)) {
    parts_.report_queue.failure(origin, Stage::start, mission::failure::queue_full);
  }
}

void TelecommandRouter::restore(const AcceptedTelecommand& accepted, MonotonicTime now) {
  JudgedTelecommand parsed = parser_.parse(accepted.packet);
  if (parsed.refusal) {  // the dictionary of now does not have it
    parts_.report_queue.failure(accepted.origin, Stage::completion, mission::failure::interrupted);
    return;
  }
  Telecommand& telecommand = parsed.telecommand;
  telecommand.origin = accepted.origin;
  telecommand.expiry = accepted.expiry;
  telecommand.repeated = true;
  const mission::Command& command = *telecommand.command;
  if (command.node != own_node_)
    return parts_.forwarder.restore(std::move(telecommand), accepted.progress, now);
  PusService* const service = service_of(command);
  if (service != nullptr && service->restore(telecommand, accepted.progress, now)) return;
  const bool again = command.repeat_class == mission::RepeatClass::idempotent &&
                     !accepted.progress.other_boot && now < accepted.expiry &&
                     command.allowed_in(static_cast<std::uint8_t>(parts_.mode.mode()));
  if (again) {
    execute(telecommand, now);
  } else {
    parts_.report_queue.failure(accepted.origin, Stage::completion, mission::failure::interrupted);
  }
}

std::size_t TelecommandRouter::waiting_for(const std::string& node) const {
  const auto found = waiting_.find(node);
  return found == waiting_.end() ? 0 : found->second;
}

std::optional<Refusal> TelecommandRouter::why_refused(const Telecommand& telecommand, bool room,
                                                      MonotonicTime now) const {
  const mission::Command& command = *telecommand.command;
  const MissionMode to_come = modes_to_come_.empty() ? parts_.mode.mode() : modes_to_come_.back();
  const auto mode = static_cast<std::uint8_t>(to_come);
  if (!command.allowed_in(mode)) return Refusal{.code = mission::failure::wrong_mode, .parameter = {mode}};
  if (auto refusal = parser_.check_arguments(telecommand)) return refusal;
  const PusService* const service = command.node == own_node_ ? service_of(command) : nullptr;
  if (service != nullptr) {
    if (auto refusal = service->why_refused(telecommand)) return refusal;
  }
  if (command.hazardous && !parts_.hazards.is_armed(hazard_name(telecommand), now))
    return Refusal{.code = mission::failure::not_armed};
  const bool taken = room && (command.node == own_node_ ||
                              parts_.forwarder.has_room(command.node, waiting_for(command.node)));
  if (!taken) return Refusal{.code = mission::failure::queue_full};
  return std::nullopt;
}

std::optional<std::pair<std::uint16_t, std::uint8_t>> TelecommandRouter::check_scheduled(
    OctetView packet) const {
  const JudgedTelecommand parsed = parser_.parse(packet);
  if (parsed.refusal) return {{parsed.refusal->code, std::uint8_t{0}}};
  const auto refusal = parser_.check_arguments(parsed.telecommand);
  if (!refusal) return std::nullopt;
  return {{refusal->code, refusal->parameter.empty() ? std::uint8_t{0} : refusal->parameter.front()}};
}

void TelecommandRouter::refuse(const TelecommandOrigin& origin, const Refusal& refusal) {
  parts_.report_queue.failure(origin, refusal.stage, refusal.code, refusal.parameter);
  if (rejected_.size() == max_rejected) rejected_.erase(rejected_.begin());
  mission::TtcTelecommandRejectedEvent event;
  event.apid = origin.request.packet_identification & 0x7FF;
  event.sequence = origin.request.packet_sequence_control & 0x3FFF;
  event.code = refusal.code;
  rejected_.push_back(event);
}

PusService* TelecommandRouter::service_of(const mission::Command& command) const {
  const auto found = std::find_if(parts_.services.begin(), parts_.services.end(),
                                  [&](const PusService* service) { return service->provides(command); });
  return found == parts_.services.end() ? nullptr : *found;
}

void TelecommandRouter::execute(const Telecommand& telecommand, MonotonicTime now) {
  if (PusService* const service = service_of(*telecommand.command)) return service->execute(telecommand, now);
  // In the dictionary, but this version of ttc does not do it.
  parts_.report_queue.failure(telecommand.origin, Stage::start, mission::failure::unknown_function,
                              octets_of_u16(telecommand.command->function_id));
}

}  // namespace srfs
