// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <optional>
#include <string>

#include "base/time.hpp"
#include "tests/simulation/kernel.hpp"

namespace srfs::simulation {

struct CommandabilitySettings {
  std::uint64_t seed = 1;
  std::size_t pairs = 1000;
  bool line_cut = false;  ///< nothing reaches the spacecraft: the proof fails
};

struct CommandabilityOutcome {
  std::optional<Violation> violation{};
  std::string diagram;          ///< of the last steps before a violation
  std::size_t orders = 0;       ///< from which the pairs are drawn
  std::size_t pairs = 0;        ///< given and proved
  std::uint64_t completed = 0;  ///< telecommands of the pairs that were carried out
  nanoseconds slowest{0};       ///< from a pair to the proof
  std::uint64_t kills = 0;      ///< of processes, behind a pair
  std::uint32_t boots = 0;
};

/// Gives pairs of telecommands, one after the other to the same spacecraft, which remembers what all of them
/// left behind; behind some of them a process is killed or the power is cut. After each pair the spacecraft
/// has to answer a ping and to carry out a telecommand of a payload, within a minute. A transmitter that was
/// switched off is switched on by a telecommand that is sent blind.
[[nodiscard]] CommandabilityOutcome run_commandability(const CommandabilitySettings& settings);

}  // namespace srfs::simulation
