// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "tests/simulation/mode_following.hpp"

#include <mission/structures.hpp>

#include "suite/deployment.hpp"

namespace srfs::simulation {
namespace {

constexpr nanoseconds check_period = milliseconds(500);

}  // namespace

const suite::ModeSettings& flown_modes() {
  static const suite::ModeSettings read =
      suite::Deployment::load(SRFS_SOURCE_DIR "/launch_config/sim.yaml").modes;
  return read;
}

ModeFollowing::ModeFollowing(Host& host, Topics& topics, const suite::ModeSettings& settings,
                             std::function<void()> changed)
    : host_(host),
      topics_(topics),
      settings_(settings),
      follower_(settings, host.now()),
      changed_(std::move(changed)) {}

void ModeFollowing::start() {
  if (!settings_.concerns(host_.name())) return;
  topics_.mode.subscribe(host_, [this](const auto& m, Host&) {
    const MonotonicTime sent{nanoseconds(static_cast<std::int64_t>(m.monotonic_ns))};
    take(follower_.on_mode({m.mode, m.name, m.change, m.reason, sent}, host_.now()));
  });
  host_.every(check_period, [this] { take(follower_.on_time(host_.now())); });
}

void ModeFollowing::take(bool changed) {
  if (!changed) return;
  host_.trace(host_.lane(), in_force()->by_itself ? "mode safe by itself" : "mode followed",
              in_force()->number, in_force()->change);
  changed_();
}

suite::ModeReaction ModeFollowing::reaction() const {
  return in_force() ? settings_.reaction(in_force()->name, host_.name()) : suite::ModeReaction{};
}

void ModeFollowing::report_obeyed(std::uint8_t orders) {
  if (!in_force() || in_force()->by_itself) return;
  mission::NodeModeObeyedEvent event;
  event.mode = static_cast<mission::MissionMode>(in_force()->number);
  event.change = in_force()->change;
  event.orders = orders;
  publish_event(topics_, host_, encode_event(event));
}

}  // namespace srfs::simulation
