#pragma once

#include <string>
#include <vector>

#include "base/result.hpp"
#include "ros/parameters.hpp"

namespace srfs::ros {

/// What a file of stored parameters held.
struct StoredFile {
  std::vector<StoredParameter> parameters;
  std::vector<std::string> damaged;  ///< entries that could not be read, for people
};

/// Largest file and most entries; more is damage.
inline constexpr std::size_t largest_parameter_file = 64U << 10;
inline constexpr std::size_t most_stored_parameters = 256;

/// Reads VAR/state/<node>/parameters.yaml:
///
///     format: 1
///     parameters:
///       - { name: tick_period_ms, type: integer, value: 200, trial: false, saved: "2026-11-21T08:00:00Z" }
///
/// @return why the file as a whole is damaged; a damaged entry only loses itself
[[nodiscard]] Result<StoredFile, std::string> read_stored(const std::string& text);
[[nodiscard]] std::string write_stored(const std::string& node,
                                       const std::vector<StoredParameter>& parameters);

}  // namespace srfs::ros
