// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "tests/simulation/faults.hpp"

#include <array>

#include "tests/simulation/kernel.hpp"

namespace srfs::simulation {
namespace {

constexpr std::array<const char*, fault_count> names{"kill",
                                                     "kill_at_action",
                                                     "stop",
                                                     "stop_at_action",
                                                     "starve",
                                                     "late_messages",
                                                     "slow_disk",
                                                     "failing_disk",
                                                     "power_cut",
                                                     "silent_peripheral",
                                                     "late_peripheral",
                                                     "garbled_peripheral",
                                                     "babbling_peripheral",
                                                     "stuck_power",
                                                     "bus_errors",
                                                     "bus_off",
                                                     "line_noise",
                                                     "line_cut",
                                                     "gps"};

}  // namespace

const char* to_text(Fault fault) {
  return names[static_cast<std::size_t>(fault)];
}

std::optional<Fault> fault_from(std::string_view text) {
  for (std::size_t i = 0; i < fault_count; ++i) {
    if (text == names[i]) return static_cast<Fault>(i);
  }
  return std::nullopt;
}

std::string to_text(const FaultSet& faults) {
  std::string text;
  for (std::size_t i = 0; i < fault_count; ++i) {
    if (faults[i]) text += (text.empty() ? "" : ",") + std::string(names[i]);
  }
  return text.empty() ? "none" : text;
}

std::optional<FaultSet> faults_from(std::string_view text) {
  FaultSet faults;
  if (text == "none") return faults;
  if (text == "all") return faults.set();
  while (!text.empty()) {
    const std::size_t comma = std::min(text.find(','), text.size());
    const auto fault = fault_from(text.substr(0, comma));
    if (!fault) return std::nullopt;
    faults.set(static_cast<std::size_t>(*fault));
    text.remove_prefix(std::min(comma + 1, text.size()));
  }
  return faults;
}

FaultSet swarm_of(std::uint64_t seed) {
  FaultSet faults;
  if (seed % 16 == 0) return faults;
  if (seed % 8 == 0) return faults.set();
  Random random(seed, "swarm");
  for (std::size_t i = 0; i < fault_count; ++i) faults.set(i, random.one_in(2));
  return faults;
}

}  // namespace srfs::simulation
