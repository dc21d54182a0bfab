// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "nodes/ttc/services/own_functions.hpp"

#include <algorithm>

#include <mission/structures.hpp>

#include "nodes/ttc/services/event_action_service.hpp"

namespace srfs {

// ---- mode

std::optional<MissionMode> ModeService::mode_of(const Telecommand& telecommand) {
  if (telecommand.command->name != mission::TtcSetMode::name || telecommand.arguments.empty())
    return std::nullopt;
  return static_cast<MissionMode>(telecommand.arguments.front());  // the dictionary has checked it
}

bool ModeService::provides(const mission::Command& command) const {
  return command.name == mission::TtcSetMode::name;
}

std::optional<Refusal> ModeService::why_refused(const Telecommand& telecommand) const {
  const auto mode = mode_of(telecommand);
  const auto why = mode && causes_ != nullptr ? causes_->why_not(*mode) : std::nullopt;
  if (!why) return std::nullopt;
  return Refusal{.code = why->first, .parameter = why->second};
}

void ModeService::execute(const Telecommand& telecommand, MonotonicTime /*now*/) {
  if (const auto refusal = why_refused(telecommand)) {  // the cause came meanwhile
    report_queue().failure(telecommand.origin, Stage::start, refusal->code, refusal->parameter);
    return;
  }
  const MissionMode mode = mode_of(telecommand).value_or(MissionMode::safe);
  const bool by_event = telecommand.origin.source_id == EventActionService::on_board_source;
  if (by_event && mode == mode_.mode()) {  // nothing new: why it is so decides what ends it
    report_queue().done(telecommand.origin);
    return;
  }
  if (!start(telecommand.origin)) return;
  if (mode != mode_.mode()) hazards_.disarm(mission::DisarmReason::mode_changed);
  ModeWhy why{.reason = "commanded"};
  if (by_event) why = {.cause = ModeCause::on_board, .reason = "event-action"};
  set_change(
      {.origin = telecommand.origin, .mode = mode, .stored_text = mode_.change(mode, std::move(why), utc_)});
}

// ---- arming

bool ArmingService::provides(const mission::Command& command) const {
  return command.name == mission::TtcArm::name || command.name == mission::TtcDisarm::name;
}

void ArmingService::execute(const Telecommand& telecommand, MonotonicTime now) {
  if (telecommand.command->name == mission::TtcArm::name) return arm(telecommand, now);
  hazards_.disarm(mission::DisarmReason::commanded);
  report_queue_.done(telecommand.origin);
}

std::optional<Refusal> ArmingService::why_not_armed(const mission::TtcArm& arm) const {
  // Which of the functions is in the digest.
  const auto is_meant = [&](const mission::Command& command) {
    return command.hazardous && command.apid == arm.of_apid && command.service == arm.of_service &&
           command.subtype == arm.of_subtype;
  };
  const auto mode = static_cast<std::uint8_t>(mode_.mode());
  std::optional<Refusal> why = Refusal{mission::failure::not_hazardous, {}};
  for (const mission::Command& command : dictionary_.commands()) {
    if (!is_meant(command)) continue;
    if (command.allowed_in(mode)) return std::nullopt;
    why = Refusal{mission::failure::wrong_mode, {mode}};
  }
  return why;
}

void ArmingService::arm(const Telecommand& telecommand, MonotonicTime now) {
  const auto arm = mission::TtcArm::decode(telecommand.arguments);
  const auto refusal = arm ? why_not_armed(*arm) : Refusal{mission::failure::bad_arguments_length, {}};
  if (refusal) {
    report_queue_.failure(telecommand.origin, Stage::start, refusal->code, refusal->parameter);
    return;
  }
  hazards_.arm(
      {.apid = arm->of_apid, .service = arm->of_service, .subtype = arm->of_subtype, .digest = arm->digest},
      now);
  report_queue_.done(telecommand.origin);
}

// ---- keys

bool KeyService::provides(const mission::Command& command) const {
  return command.name == mission::TtcSelectKeys::name;
}

void KeyService::execute(const Telecommand& telecommand, MonotonicTime /*now*/) {
  const auto select = mission::TtcSelectKeys::decode(telecommand.arguments);
  const auto set = select ? select->set : KeySet::a;
  const auto vc = select ? select->vc : std::uint8_t{0};
  const bool has_it = std::find(available_.begin(), available_.end(), std::pair(vc, set)) != available_.end();
  if (!select || !has_it) {
    report_queue().failure(telecommand.origin, Stage::start, mission::failure::unknown_identifier,
                           octets_of_u16(vc));
  } else if (start(telecommand.origin)) {
    set_change({.origin = telecommand.origin, .vc = vc, .set = set});
  }
}

// ---- rescue

bool RescueService::provides(const mission::Command& command) const {
  return command.name.starts_with("rescue.");
}

void RescueService::execute(const Telecommand& telecommand, MonotonicTime /*now*/) {
  if (telecommand.command->name != mission::RescueEnter::name) {
    report_queue().failure(telecommand.origin, Stage::start, mission::failure::suite_runs);
  } else if (start(telecommand.origin)) {
    set_change({.origin = telecommand.origin});
  }
}

// ---- transmitter

bool TransmitterService::provides(const mission::Command& command) const {
  return command.name == mission::TtcTransmitterOff::name || command.name == mission::TtcTransmitterOn::name;
}

void TransmitterService::execute(const Telecommand& telecommand, MonotonicTime now) {
  if (!start(telecommand.origin)) return;
  seconds off{0};
  if (telecommand.command->name == mission::TtcTransmitterOff::name) {
    const auto command = mission::TtcTransmitterOff::decode(telecommand.arguments);
    off = seconds(command ? command->duration_s : 0);
  }
  if (off > seconds(0)) {
    transmitter_.switch_off(off, now);
  } else {
    transmitter_.switch_on();
  }
  set_change({.origin = telecommand.origin, .off = off, .stored_text = transmitter_.stored_text()});
}

}  // namespace srfs
