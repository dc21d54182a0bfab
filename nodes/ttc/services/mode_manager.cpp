// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "nodes/ttc/services/mode_manager.hpp"

#include <mission/structures.hpp>

#include "nodes/ttc/checked_text.hpp"

namespace srfs {
namespace {

std::string stored_form(MissionMode mode) {
  return with_check(mode == MissionMode::nominal ? "nominal" : "safe");
}

}  // namespace

ModeManager::ModeManager(StoredModeState state, std::string_view stored, MissionMode initial) {
  if (state == StoredModeState::first_start) {
    mode_ = initial;
    reason_ = "first start";
  } else if (state == StoredModeState::missing) {
    reason_ = "stored mode missing";
  } else if (stored == stored_form(MissionMode::nominal) || stored == stored_form(MissionMode::safe)) {
    mode_ = stored == stored_form(MissionMode::nominal) ? MissionMode::nominal : MissionMode::safe;
    reason_ = "as before the restart";
  } else {
    reason_ = "stored mode damaged";
  }
}

std::string ModeManager::change(MissionMode mode, std::string reason) {
  mode_ = mode;
  reason_ = std::move(reason);
  if (reason_.size() > longest_reason) reason_.resize(longest_reason);
  return stored_text();
}

std::string ModeManager::stored_text() const {
  return stored_form(mode_);
}

}  // namespace srfs
