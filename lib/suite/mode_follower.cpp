// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "suite/mode_follower.hpp"

#include <fmt/format.h>

#include "base/excerpt.hpp"

namespace srfs::suite {
namespace {

constexpr seconds tolerated_future{1};

}  // namespace

std::string ModeFollower::why_impossible(const HeardMode& mode, MonotonicTime now) const {
  if (!settings_.knows(mode.name)) return fmt::format("/mode: no mode '{}' here", excerpt(mode.name, 24));
  if ((mode.name == ModeSettings::safe) != (mode.number == 0))
    return fmt::format("/mode: mode '{}' has number {}", excerpt(mode.name, 24), mode.number);
  if (mode.sent > now + tolerated_future) return "/mode: sent in the future";
  if (now - mode.sent > settings_.silence) return "/mode: an old sample";
  return {};
}

bool ModeFollower::on_mode(const HeardMode& mode, MonotonicTime now) {
  if (std::string why = why_impossible(mode, now); !why.empty()) {
    ++damaged_;
    return go_safe(std::move(why));
  }
  heard_ = now;
  const bool same =
      in_force_ && !in_force_->by_itself && in_force_->name == mode.name && in_force_->change == mode.change;
  in_force_ = ModeInForce{mode.number, mode.name, mode.change, false, mode.reason};
  return !same;
}

bool ModeFollower::on_time(MonotonicTime now) {
  if (now < next_due()) return false;
  return go_safe(fmt::format("/mode is silent for {} s", settings_.silence.count() / 1000));
}

bool ModeFollower::go_safe(std::string reason) {
  if (in_force_ && in_force_->by_itself) return false;
  const std::uint32_t change = in_force_ ? in_force_->change : 0;
  in_force_ = ModeInForce{0, ModeSettings::safe, change, true, std::move(reason)};
  return true;
}

}  // namespace srfs::suite
