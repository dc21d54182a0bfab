// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "nodes/ttc/services/mode_manager.hpp"

#include <sstream>

#include <fmt/format.h>
#include <fmt/ranges.h>

#include "base/checked_text.hpp"

namespace srfs {
namespace {

constexpr unsigned most_modes = 32;

}  // namespace

ModeManager::ModeManager(StoredModeState state, std::string_view stored, MissionMode initial,
                         std::uint32_t lost_change) {
  if (state == StoredModeState::first_start) {
    mode_ = commanded_ = initial;
    why_ = {.cause = ModeCause::first_start, .reason = "first start"};
  } else if (const auto text = without_check(stored); !text || !read(*text)) {
    change_ = lost_change;
    why_.reason = state == StoredModeState::missing ? "stored mode missing" : "stored mode damaged";
  }
}

std::string ModeManager::change(MissionMode mode, ModeWhy why, std::optional<UtcTime> utc) {
  if (mode != mode_) since_ = utc;
  mode_ = mode;
  if (why.cause == ModeCause::command) commanded_ = mode;
  why_ = std::move(why);
  if (why_.reason.size() > longest_reason) why_.reason.resize(longest_reason);
  ++change_;
  return stored_text();
}

/// One line of values, one of the source, one of the reason, one of the present causes.
std::string ModeManager::stored_text() const {
  return with_check(fmt::format("mode {} {} {} {} {}\n{}\n{}\n{}", static_cast<unsigned>(mode_),
                                static_cast<unsigned>(commanded_), static_cast<unsigned>(why_.cause), change_,
                                since_ ? since_->ns() : 0, why_.source, why_.reason,
                                fmt::join(present_, ",")));
}

bool ModeManager::read(std::string_view text) {
  // As earlier versions stored it.
  if (text == "nominal" || text == "safe") {
    mode_ = commanded_ = text == "nominal" ? MissionMode::nominal : MissionMode::safe;
    why_ = {.cause = ModeCause::command, .reason = "as before the restart"};
    return true;
  }
  std::istringstream in{std::string(text)};
  std::string word;
  unsigned mode = 0;
  unsigned commanded = 0;
  unsigned cause = 0;
  std::uint32_t change = 0;
  std::int64_t since_ns = 0;
  if (!(in >> word >> mode >> commanded >> cause >> change >> since_ns) || word != "mode") return false;
  if (mode >= most_modes || commanded >= most_modes || since_ns < 0) return false;
  ModeWhy why{.cause = static_cast<ModeCause>(cause)};
  if (cause > UINT8_MAX || !mission::is_valid(why.cause)) return false;
  in.get();
  if (!std::getline(in, why.source)) return false;
  std::getline(in, why.reason);
  present_.clear();
  for (std::string name; std::getline(in, name, ',');) present_.push_back(name);  // earlier versions: none
  mode_ = static_cast<MissionMode>(mode);
  commanded_ = static_cast<MissionMode>(commanded);
  why_ = std::move(why);
  change_ = change;
  if (since_ns > 0) since_ = UtcTime(nanoseconds(since_ns));
  return true;
}

}  // namespace srfs
