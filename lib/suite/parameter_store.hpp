// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <deque>
#include <string>
#include <vector>

#include "base/result.hpp"
#include "ros/parameters.hpp"

namespace srfs::suite {

/// A set of values that a node kept.
struct ParameterGeneration {
  std::uint32_t number = 0;  ///< goes up with each set
  std::string saved;         ///< when, UTC, for people
  std::string origin;        ///< what made it, for people
  std::vector<ros::StoredParameter> values;
  friend bool operator==(const ParameterGeneration&, const ParameterGeneration&) = default;
};

/// What a node keeps over its restarts. Only the newest generation holds.
struct ParameterHistory {
  static constexpr std::size_t most_generations = 10;

  std::deque<ParameterGeneration> generations;  ///< the oldest first
  /// Values that waited to be confirmed when this was written: never used at a start, only reported.
  std::vector<ros::StoredParameter> trial;

  /// Of the newest generation; empty: the deployment's hold.
  [[nodiscard]] std::vector<ros::StoredParameter> values() const {
    return generations.empty() ? std::vector<ros::StoredParameter>{} : generations.back().values;
  }
  [[nodiscard]] const ParameterGeneration* find(std::uint32_t number) const;
  /// A new generation; the oldest of too many goes. Nothing when the newest has these values already.
  void add(std::vector<ros::StoredParameter> values, const std::string& origin, const std::string& saved);

  friend bool operator==(const ParameterHistory&, const ParameterHistory&) = default;
};

/// What a file of stored parameters held.
struct StoredFile {
  ParameterHistory history;
  std::vector<std::string> damaged;  ///< entries that could not be read, for people
};

/// Largest file, and most values in a list; more is damage.
inline constexpr std::size_t largest_parameter_file = 64U << 10;
inline constexpr std::size_t most_stored_parameters = 256;

/// Reads VAR/state/<node>/parameters.yaml:
///
///     format: 2
///     generations:
///       - number: 1
///         saved: "2026-11-21T08:00:00Z"
///         origin: "keep (telecommand)"
///         values:
///           - { name: tick_period_ms, type: integer, value: 200, saved: "2026-11-21T08:00:00Z" }
///     trial: []
///     # crc32c 0badcafe        (of all above)
///
/// and the form that people write, and earlier versions wrote, one generation without a checksum:
///
///     format: 1
///     parameters:
///       - { name: tick_period_ms, type: integer, value: 200, saved: "2026-11-21T08:00:00Z" }
///
/// @return why the file as a whole is damaged; an entry that cannot be read only loses itself
[[nodiscard]] Result<StoredFile, std::string> read_stored(const std::string& text);
/// Format 2. The oldest generations go while it is larger than largest_parameter_file.
/// @return why it cannot be written
[[nodiscard]] Result<std::string, std::string> write_stored(const std::string& node,
                                                            ParameterHistory& history);
/// Format 1.
[[nodiscard]] std::string write_list(const std::string& node,
                                     const std::vector<ros::StoredParameter>& values);

/// "name=value, name=value", for people.
[[nodiscard]] std::string to_text(const std::vector<ros::StoredParameter>& values);

}  // namespace srfs::suite
