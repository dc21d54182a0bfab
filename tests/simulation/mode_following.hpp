// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <functional>
#include <optional>

#include "suite/mode_follower.hpp"
#include "tests/simulation/topics.hpp"

namespace srfs::simulation {

/// The modes of launch_config/sim.yaml. Read once.
[[nodiscard]] const suite::ModeSettings& flown_modes();

/// A node's half of the mode (suite::ModeFollower), with what suite::Node translates.
class ModeFollowing {
 public:
  /// @param changed  in_force() is another one
  ModeFollowing(Host& host, Topics& topics, const suite::ModeSettings& settings,
                std::function<void()> changed);
  /// Where the mode asks nothing of the node in any case it follows none.
  void start();

  [[nodiscard]] const std::optional<suite::ModeInForce>& in_force() const { return follower_.in_force(); }
  /// Nothing special where no mode is in force.
  [[nodiscard]] suite::ModeReaction reaction() const;
  void report_obeyed(std::uint8_t orders);

 private:
  void take(bool changed);

  Host& host_;
  Topics& topics_;
  const suite::ModeSettings& settings_;
  suite::ModeFollower follower_;
  std::function<void()> changed_;
};

}  // namespace srfs::simulation
