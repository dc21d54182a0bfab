// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <bitset>
#include <cstdint>
#include <optional>
#include <string>
#include <string_view>

namespace srfs::simulation {

/// Kinds of faults. A run has some of them on (swarm testing: Groce et al., ISSTA 2012): a fault that never
/// comes alone is masked by the others.
enum class Fault : std::uint8_t {
  kill,            ///< SIGKILL of any process
  kill_at_action,  ///< between two actions of a handler
  stop,            ///< SIGSTOP, SIGCONT later
  stop_at_action,  ///< the same in the middle of a handler
  starve,          ///< no CPU for some time
  late_messages,   ///< of all topics, up to 400 ms
  slow_disk,       ///< writes take up to 4 s
  failing_disk,    ///< writes fail
  power_cut,       ///< of the computer
  silent_peripheral,
  late_peripheral,
  garbled_peripheral,  ///< short answers, or garbage
  babbling_peripheral,
  stuck_power,  ///< a peripheral's switch does not obey
  bus_errors,   ///< error frames, lost and corrupted frames
  bus_off,
  line_noise,  ///< CLTUs and CADUs are lost or spoiled
  line_cut,    ///< nothing passes in either direction, up to some minutes
  gps,         ///< no pulse, no fix, false pulses, wrong times
};
inline constexpr std::size_t fault_count = 19;
using FaultSet = std::bitset<fault_count>;

[[nodiscard]] const char* to_text(Fault fault);
[[nodiscard]] std::optional<Fault> fault_from(std::string_view text);
/// "kill,stop"; "none".
[[nodiscard]] std::string to_text(const FaultSet& faults);
/// Also "all". Error: the word that names no fault.
[[nodiscard]] std::optional<FaultSet> faults_from(std::string_view text);
/// Each fault with even odds; every eighth seed has them all, every sixteenth none.
[[nodiscard]] FaultSet swarm_of(std::uint64_t seed);

}  // namespace srfs::simulation
