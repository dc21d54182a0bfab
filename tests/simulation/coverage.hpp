// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <utility>
#include <vector>

namespace srfs::simulation {

/// The state machines whose transitions are counted.
enum class StateTable : std::uint8_t {
  fop,       ///< FOP-1 on the ground
  ad,        ///< the AD service as the operator has it
  farm,      ///< FARM-1 on board
  mode,      ///< of the mission
  sync,      ///< of the clock to the GPS pulse
  slot,      ///< of one payload on the bus
  restart,   ///< what the ring does for a dead node
  version,   ///< of a node's program
  update,    ///< of an uplinked package
  schedule,  ///< of a scheduled telecommand
};
inline constexpr std::size_t state_table_count = 10;
inline constexpr std::size_t most_states = 10;

struct StateTableInfo {
  const char* name;
  std::vector<const char*> states;
  std::vector<std::pair<std::uint8_t, std::uint8_t>> permitted;  ///< from, to: all that the classes make
};
[[nodiscard]] const std::array<StateTableInfo, state_table_count>& state_tables();

/// How often each transition was seen.
using TransitionCounts =
    std::array<std::array<std::array<std::uint64_t, most_states>, most_states>, state_table_count>;

/// Follows each object of each table.
class Coverage {
 public:
  /// @param object  which of several, for example a node's place. What has no state yet makes no transition
  void note(StateTable table, std::uint64_t object, std::uint8_t state);
  /// It begins anew.
  void forget(StateTable table, std::uint64_t object) { states_.erase({table, object}); }
  /// The present state of an object, if it has one.
  [[nodiscard]] std::optional<std::uint8_t> state(StateTable table, std::uint64_t object) const {
    const auto found = states_.find({table, object});
    return found == states_.end() ? std::nullopt : std::optional(found->second);
  }
  [[nodiscard]] const TransitionCounts& counts() const { return counts_; }

 private:
  std::map<std::pair<StateTable, std::uint64_t>, std::uint8_t> states_;
  TransitionCounts counts_{};
};

void add(TransitionCounts& to, const TransitionCounts& counts);
/// For people: each table with its share of the permitted transitions, those never seen, and those that were
/// seen and are not in the table.
[[nodiscard]] std::string report(const TransitionCounts& counts);

}  // namespace srfs::simulation
