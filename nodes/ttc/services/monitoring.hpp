// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <utility>
#include <vector>

#include <mission/structures.hpp>

#include "base/octets.hpp"
#include "base/result.hpp"
#include "base/time.hpp"
#include "msgs/mission/dictionary.hpp"

namespace srfs {

using mission::FunctionalState;
using mission::MonitorCheck;
using mission::MonitorState;

/// One check of one element of telemetry, as monitor.add defines it.
struct MonitorDefinition {
  mission::MonitorAdd what;
  bool enabled = false;
  friend bool operator==(const MonitorDefinition&, const MonitorDefinition&) = default;
};
using MonitorTable = std::map<std::uint16_t, MonitorDefinition>;  ///< by id

/// Several monitors together, as functional_monitor.add defines it: failed while so many of them are out of
/// limits at the same time (ECSS-E-ST-70-41C 6.12.4.2.1).
struct FunctionalDefinition {
  std::uint32_t condition = 0;  ///< parameter; 0: there is no condition
  std::uint32_t condition_mask = UINT32_MAX;
  double condition_value = 0;
  std::uint16_t event = 0;  ///< 0: none
  std::uint8_t minimum_failing = 1;
  std::vector<std::uint16_t> monitors = {};
  bool enabled = false;
  bool is_protected = false;
  friend bool operator==(const FunctionalDefinition&, const FunctionalDefinition&) = default;
};
using FunctionalTable = std::map<std::uint16_t, FunctionalDefinition>;  ///< by id

/// What the mission's file lists (`monitors`); for each limit of a field a definition, from id first_limit_id
/// on in the order of the structures' ids; for each periodic structure of another node one that finds it
/// stale, first_stale_id plus the structure's id. All enabled. Not of added nodes, nor of values that the
/// beacon repeats.
[[nodiscard]] MonitorTable factory_monitors(const mission::Dictionary& dictionary);
inline constexpr std::uint16_t first_limit_id = 1000;
inline constexpr std::uint16_t first_stale_id = 2000;

/// Why a definition is not taken: the failure code and its parameter.
struct MonitorRefusal {
  std::uint16_t code = 0;
  std::uint16_t parameter = 0;
};
[[nodiscard]] std::optional<MonitorRefusal> why_not_taken(const mission::MonitorAdd& definition,
                                                          const mission::Dictionary& dictionary);

/// @param monitors  that it may have
[[nodiscard]] std::optional<MonitorRefusal> why_not_taken(std::uint16_t id,
                                                          const FunctionalDefinition& definition,
                                                          const MonitorTable& monitors,
                                                          const mission::Dictionary& dictionary);

/// Below, above, unexpected or stale.
[[nodiscard]] constexpr bool is_out_of_limits(MonitorState state) {
  return state >= MonitorState::below;
}

struct MonitoringCounters {
  std::uint64_t checks = 0;
  std::uint32_t transitions = 0;
};

/// On-board monitoring (ECSS-E-ST-70-41C 6.12): checks the samples of housekeeping structures by a table of
/// definitions, each sample when it comes, and whether samples come. A state that is out of limits is news
/// when it begins and when it ends. A definition begins unchecked; nothing of the checks outlives the
/// process. Pure.
class Monitoring {
 public:
  static constexpr std::size_t max_definitions = 1000;
  static constexpr std::size_t max_functional = 32;  ///< a full table fits its file
  static constexpr std::size_t max_monitors = 16;    ///< of a functional monitor
  static constexpr seconds stale_check_period{1};
  /// A gap between two calls of on_time() that is longer is time in which nothing could be heard.
  static constexpr seconds longest_gap{3};

  /// @param dictionary  outlives it; its content may be replaced, then resolve() is to be called
  explicit Monitoring(const mission::Dictionary& dictionary) : dictionary_(dictionary) {}

  // ---- table

  [[nodiscard]] const MonitorTable& table() const { return table_; }
  /// Replaces all of it: those that are new, changed or newly enabled begin unchecked.
  void set_table(MonitorTable table);
  [[nodiscard]] const FunctionalTable& functional_table() const { return functional_table_; }
  /// The same. One that names a monitor that is not in the table is unresolved, and unchecked.
  void set_functional_table(FunctionalTable table);
  /// Looks up again where the parameters are.
  void resolve();
  [[nodiscard]] bool enabled() const { return enabled_; }
  void set_enabled(bool enabled);
  [[nodiscard]] bool functional_enabled() const { return functional_enabled_; }
  /// They are checked while both functions are enabled.
  void set_functional_enabled(bool enabled);

  // ---- checks

  void on_sample(std::uint16_t structure_id, OctetView data, TaiTime tai, MonotonicTime now);
  /// Finds what is stale. To be called about each second.
  void on_time(TaiTime tai, MonotonicTime now);

  struct Transition {
    std::uint16_t definition = 0;
    std::uint32_t parameter = 0;
    MonitorCheck check = MonitorCheck::limits;
    double value = 0;
    double limit = 0;
    MonitorState previous = MonitorState::unchecked;
    MonitorState state = MonitorState::unchecked;
    TaiTime since = {};
    std::uint16_t event = 0;  ///< to be raised; 0: none
  };
  /// Since the last call: at most one for each definition and sample.
  [[nodiscard]] std::vector<Transition> take_transitions() { return std::exchange(transitions_, {}); }

  /// A functional monitor failed.
  struct FunctionalFailure {
    std::uint16_t definition = 0;
    std::uint16_t event = 0;  ///< to be raised; 0: none
    std::uint8_t failing = 0;
    std::uint8_t monitors = 0;
  };
  /// Since the last call: at most one for each functional monitor and sample.
  [[nodiscard]] std::vector<FunctionalFailure> take_functional_failures() {
    return std::exchange(functional_failures_, {});
  }

  // ---- what others want to know

  [[nodiscard]] FunctionalState functional_state(std::uint16_t definition) const;
  [[nodiscard]] std::size_t functional_failed() const;
  [[nodiscard]] MonitorState state(std::uint16_t definition) const;
  /// The transition into the state of each definition that is out of limits, in the order of their ids.
  [[nodiscard]] std::vector<Transition> out_of_limits() const;
  /// nullopt: it is not.
  [[nodiscard]] std::optional<Transition> out_of_limits(std::uint16_t definition) const;
  [[nodiscard]] std::size_t out_of_limits_count() const { return out_of_limits_; }
  /// Monitors and functional monitors.
  [[nodiscard]] std::size_t unresolved() const { return unresolved_; }
  [[nodiscard]] const MonitoringCounters& counters() const { return counters_; }

 private:
  static constexpr std::size_t no_slot = SIZE_MAX;
  struct Condition {
    std::uint32_t parameter = 0;
    std::uint32_t mask = UINT32_MAX;
    double value = 0;
    std::size_t slot = no_slot;
  };
  struct Check {
    mission::MonitorAdd what;
    bool enabled = false;
    std::size_t slot = no_slot;  ///< of the parameter's value
    Condition condition = {};
    MonitorState state = MonitorState::unchecked;
    MonitorState candidate = MonitorState::unchecked;  ///< came so often in a row:
    std::uint8_t in_row = 0;
    std::optional<double> before = {};  ///< last checked value, of a delta
    MonotonicTime next = {};            ///< not checked before
    Transition last = {};               ///< into the state
  };
  struct Functional {
    FunctionalDefinition what;
    Condition condition = {};
    std::vector<const Check*> monitors = {};  ///< empty: unresolved
    FunctionalState state = FunctionalState::unchecked;
  };
  struct Slot {
    std::optional<double> value;  ///< newest
    bool single = false;          ///< an f32 as it is
  };
  /// Where a value stands in the samples of its structure.
  struct Place {
    std::size_t slot = 0;
    std::size_t offset = 0;        ///< octets before it without the characters of texts
    std::size_t texts_before = 0;  ///< texts before it
    mission::Field form;           ///< how to read it
  };
  struct Watched {
    std::vector<std::size_t> texts;  ///< their offsets, as those of places
    std::vector<Place> places;
    std::vector<Check*> checks;
    std::vector<Check*> stale_checks;
    milliseconds interval{0};
    std::optional<MonotonicTime> last_sample;
  };
  [[nodiscard]] std::size_t slot_of(std::uint32_t parameter);
  void add_place(Watched& watched, const mission::TelemetryElement& element, std::size_t slot) const;
  void read(const Watched& watched, OctetView data);
  /// @return false: there is no such parameter
  [[nodiscard]] bool resolve(Condition& condition);
  void resolve_checks();
  void resolve_functional();
  [[nodiscard]] bool holds(const Condition& condition, MonotonicTime now) const;
  void check_functional(MonotonicTime now);
  [[nodiscard]] FunctionalState state_of(const Functional& functional, std::uint8_t failing,
                                         MonotonicTime now) const;
  void check(Check& check, TaiTime tai, MonotonicTime now);
  void set_state(Check& check, MonitorState state, double value, double limit, TaiTime tai);
  static void forget(Check& check);
  void count_out_of_limits();

  const mission::Dictionary& dictionary_;
  bool enabled_ = true;
  MonitorTable table_;
  bool functional_enabled_ = true;
  FunctionalTable functional_table_;
  std::map<std::uint16_t, Check> checks_;           ///< by id
  std::map<std::uint16_t, Functional> functional_;  ///< by id
  std::map<std::uint16_t, Watched> watched_;        ///< by structure id
  std::map<std::uint32_t, std::size_t> slots_;      ///< by parameter
  std::vector<Slot> values_;                        ///< by slot
  std::vector<Transition> transitions_;
  std::vector<FunctionalFailure> functional_failures_;
  std::optional<MonotonicTime> last_time_;
  std::size_t out_of_limits_ = 0;
  std::size_t unresolved_ = 0;
  MonitoringCounters counters_;
};

}  // namespace srfs
