// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <map>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "base/time.hpp"
#include "msgs/mission/dictionary.hpp"

namespace srfs {

/// Which violations a process of a node is to blame for: parameters of its telemetry beyond their hard
/// limits, and events of severity high, that did not stand when it was started. A parameter that was red
/// within the `memory` before, or of which no sample of the process before was seen, is excused: the first
/// for the life of the process, the second until it was in its limits. An event that the node raised before
/// is excused too. Pure; bounded by the dictionary.
class LimitWatch {
 public:
  static constexpr nanoseconds memory = std::chrono::minutes(10);

  /// @param since when the process was started that sent it; @param now not before the call before
  /// @return the first parameter it is to blame for, with its value
  std::optional<std::string> on_sample(const std::string& node, const mission::Structure& structure,
                                       const std::vector<mission::DecodedField>& fields, MonotonicTime since,
                                       MonotonicTime now);
  /// @return the event's name, if the process is to blame for it
  std::optional<std::string> on_event(const std::string& node, const mission::Event& event,
                                      MonotonicTime since, MonotonicTime now);

 private:
  enum class Excuse : std::uint8_t { none, stood_before, unknown_before };
  struct Track {
    std::optional<MonotonicTime> last;
    std::optional<MonotonicTime> last_red;
    Excuse excuse = Excuse::none;  ///< of the process that sent the last sample
  };
  std::map<std::pair<std::string, std::string>, Track> tracks_;            // node, parameter
  std::map<std::pair<std::string, std::uint16_t>, MonotonicTime> raised_;  // node, event: first time
};

/// Some field of it has hard limits.
[[nodiscard]] bool has_hard_limits(const mission::Structure& structure);

}  // namespace srfs
