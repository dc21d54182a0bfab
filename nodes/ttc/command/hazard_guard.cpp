// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "nodes/ttc/command/hazard_guard.hpp"

#include "base/crc32c.hpp"

namespace srfs {

HazardName hazard_name(const Telecommand& telecommand) {
  const mission::Command& command = *telecommand.command;
  OctetWriter application;
  if (command.is_function()) application.u16(command.function_id);
  application.bytes(telecommand.arguments);
  return {.apid = command.apid,
          .service = command.service,
          .subtype = command.subtype,
          .digest = crc32c(application.view())};
}

void HazardGuard::arm(const HazardName& name, MonotonicTime now) {
  on_time(now);
  disarm(mission::DisarmReason::replaced);
  armed_ = Armed{name, now + window_};
  news_.push_back({name, std::nullopt});
}

void HazardGuard::disarm(mission::DisarmReason reason) {
  if (!armed_) return;
  news_.push_back({armed_->name, reason});
  armed_.reset();
}

bool HazardGuard::is_armed(const HazardName& name, MonotonicTime now) const {
  return armed_ && armed_->name == name && now < armed_->until;
}

void HazardGuard::on_time(MonotonicTime now) {
  if (armed_ && now >= armed_->until) disarm(mission::DisarmReason::expired);
}

std::optional<MonotonicTime> HazardGuard::next_due() const {
  return armed_ ? std::optional(armed_->until) : std::nullopt;
}

}  // namespace srfs
