// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "base/octets.hpp"
#include "base/time.hpp"
#include "msgs/mission/dictionary.hpp"
#include "nodes/ttc/services/mode_manager.hpp"
#include "suite/modes.hpp"

namespace srfs {

/// What changes the mode without a telecommand: the deployment's measurements with their thresholds, and
/// critical nodes that are not Active. Levels with hysteresis and debounce, so that a restart of ttc, noise
/// and single wrong samples change nothing. Needs no other service of ttc. Pure.
class ModeCauses {
 public:
  /// A change of mode that is due.
  struct Change {
    MissionMode mode = MissionMode::safe;
    ModeWhy why;
  };
  static constexpr const char* node_lost = "node_lost";  ///< the name of that cause

  /// @param dictionary  is not kept
  ModeCauses(const mission::Dictionary& dictionary, suite::ModeSettings settings, MonotonicTime now);

  /// What of the deployment's modes the dictionary does not have; such a cause is never present.
  [[nodiscard]] const std::vector<std::string>& problems() const { return problems_; }
  [[nodiscard]] const suite::ModeSettings& settings() const { return settings_; }
  /// Its name in the dictionary, and so in the deployment.
  [[nodiscard]] std::string name_of(MissionMode mode) const;
  [[nodiscard]] suite::ModeReaction reaction(MissionMode mode, const std::string& node) const {
    return settings_.reaction(name_of(mode), node);
  }

  void on_telemetry(std::uint16_t structure_id, OctetView data, MonotonicTime now);
  void on_node(const std::string& node, bool active, MonotonicTime now);
  /// By name; they are looked at and change nothing.
  void set_ignored(std::vector<std::string> names) { ignored_ = std::move(names); }

  /// The change that is due now. To be called with the mode as it is after each input, and by next_due().
  [[nodiscard]] std::optional<Change> take_change(const ModeManager& mode, MonotonicTime now);
  [[nodiscard]] std::optional<MonotonicTime> next_due(MonotonicTime now) const;

  /// Why a telecommand may not order this mode: it is not of the deployment, or a cause of a safer one is
  /// present. @return failure code and its parameter
  [[nodiscard]] std::optional<std::pair<std::uint16_t, Octets>> why_not(MissionMode mode) const;

  /// The names of the measurements that are a cause now, whether or not they are why the mode is what it is.
  [[nodiscard]] std::vector<std::string> present() const;
  /// Bit n: cause n + 1 of the deployment; bit 7: a critical node is lost.
  [[nodiscard]] std::uint8_t present_bits() const;
  /// The same for people.
  [[nodiscard]] std::string present_text() const;
  /// What ends the mode by itself; empty: nothing does.
  [[nodiscard]] std::string way_back(const ModeManager& mode) const;

 private:
  struct Cause {
    suite::ModeCause rule;
    MissionMode mode = MissionMode::safe;
    std::uint16_t structure_id = 0;  ///< 0: the dictionary has no such field
    std::size_t offset = 0;
    bool present = false;
    bool stale = false;  ///< no sample since long
    int beyond = 0;      ///< samples in a row past the threshold that would change `present`
    double last = 0;
    MonotonicTime heard;
  };
  struct Critical {
    std::string node;
    bool active = true;  ///< until it is known
    MonotonicTime since;
    bool lost = false;      ///< not Active for long enough
    bool reported = false;  ///< as lost, by a change of mode; again only after it was Active
  };
  [[nodiscard]] bool has_row(MissionMode mode) const;
  void resolve(const mission::Dictionary& dictionary, Cause& cause);
  void judge(Cause& cause, double value);
  void look_at_age(MonotonicTime now);
  [[nodiscard]] bool counts(const std::string& name) const;
  /// nullptr: none, or they are ignored.
  [[nodiscard]] const Critical* first_lost() const;
  [[nodiscard]] std::optional<Change> lost_node(const ModeManager& mode);
  /// The safest mode that a cause demands.
  [[nodiscard]] const Cause* demanding() const;
  [[nodiscard]] ModeWhy why(const Cause& cause) const;
  /// How much a mode protects: safe most, those of causes more than the others.
  [[nodiscard]] int protection(MissionMode mode) const;

  suite::ModeSettings settings_;
  std::map<std::uint8_t, std::string> names_;
  std::vector<Cause> causes_;
  std::vector<Critical> critical_;
  std::vector<std::string> ignored_;
  std::vector<std::string> problems_;
  bool restored_ = false;  ///< causes_ know which of them is behind the mode at the start
};

}  // namespace srfs
