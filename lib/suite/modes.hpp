// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <chrono>
#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "base/config.hpp"

namespace srfs::suite {

/// What a node does while a mode lasts. Levels, not a sequence: whoever starts in the middle does the same.
struct ModeReaction {
  /// Telecommands of the node for its peripheral, as `eps.switch_load load=2 state=off`: sent in this order,
  /// and again after each repeat time, and after a reset of node or peripheral.
  std::vector<std::string> hold;
  /// The same, sent until carried out, once for each change to the mode.
  std::vector<std::string> once;
  bool work = true;  ///< tasks, builds, swaps of programs; false: what runs is ended in order, none begins

  // Of ttc.
  std::optional<std::chrono::milliseconds> beacon_period{};  ///< none: that of its parameter
  bool open_retrieval = true;                                ///< stored packets go down without request
  std::optional<std::uint32_t> downlink_octets_s{};          ///< of stored packets and files; none: no bound

  friend bool operator==(const ModeReaction&, const ModeReaction&) = default;
};

/// A measurement that changes the mode by itself: a field of a housekeeping structure beyond a threshold in
/// so many samples in a row. It is over when it was on the other side of the second threshold as often.
struct ModeCause {
  std::string name;
  std::string structure;
  std::string field;
  bool below = true;  ///< present below `enter`, over above `leave`; false: the other way round
  double enter = 0;
  double leave = 0;
  int samples = 3;
  std::chrono::seconds stale{0};  ///< without a sample for so long it is present, too; 0: never
  std::string mode;               ///< that it causes
  bool returns = false;  ///< when it is over, the mode that was commanded comes back; false: by command only
};

/// The section `modes` of a deployment.
struct ModeSettings {
  static constexpr std::size_t most_causes = 7;
  static constexpr std::size_t most_orders = 16;  ///< of a node in a mode, each list
  static constexpr const char* safe = "safe";

  std::chrono::milliseconds silence{30'000};  ///< without /mode a node goes to safe after it
  std::chrono::milliseconds repeat{10'000};   ///< what is held is sent again
  std::chrono::milliseconds lost{30'000};     ///< a critical node that is not Active for so long: safe
  std::vector<std::string> critical;          ///< these nodes; default: those of the ring
  std::vector<ModeCause> causes;
  std::map<std::string, std::string> shed;  ///< per mode, for people: what its orders switch off
  std::map<std::string, std::map<std::string, ModeReaction>> table;  ///< by mode, then by node

  /// The deployment has the section.
  [[nodiscard]] bool enabled() const { return !table.empty(); }
  [[nodiscard]] bool knows(const std::string& mode) const { return table.contains(mode); }
  /// Nothing special where the table has none.
  [[nodiscard]] ModeReaction reaction(const std::string& mode, const std::string& node) const;
  /// Whether any mode asks something of it.
  [[nodiscard]] bool concerns(const std::string& node) const;
};

/// Throws ConfigError. What it names of the mission's dictionary (modes, nodes, fields, telecommands) is
/// checked by ttc and by the nodes. A row of a node that the deployment does not have is not used: a
/// deployment may be a part of another one. Without ttc it has no modes.
[[nodiscard]] ModeSettings read_modes(const ConfigSection& section);

}  // namespace srfs::suite
