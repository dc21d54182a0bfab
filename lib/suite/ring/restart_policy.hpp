// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "base/time.hpp"
#include "suite/deployment.hpp"

namespace srfs::suite {

/// What is remembered of one node's deaths in this boot. Counted is the time it lived: while it waits for its
/// next start this clock stands still, so that a long wait does not make its deaths look rare.
struct DeathHistory {
  bool down = false;      ///< its last death is counted, and no start was attempted since
  MonotonicTime started;  ///< the last attempt to start it; the epoch: not known, so since boot
  nanoseconds lived{0};   ///< up to its last death
  std::uint32_t total = 0;
  std::vector<nanoseconds> deaths;  ///< those within the window before the last, on the clock of `lived`

  friend bool operator==(const DeathHistory&, const DeathHistory&) = default;
};

/// The node is dead: counted once between two starts. @param now not before the start
void count_death(DeathHistory& history, const RingSettings& settings, MonotonicTime now);
/// A start is attempted now; whether the node comes up shows later.
void count_start(DeathHistory& history, MonotonicTime now);

/// A process of a version on probation.
struct VersionTrial {
  std::uint32_t version = 0;
  nanoseconds probation{0};
  nanoseconds lived{0};
  bool to_confirm = false;  ///< ends well only if the operator confirms it

  friend bool operator==(const VersionTrial&, const VersionTrial&) = default;
};

struct RestartDecision {
  enum class Step : std::uint8_t {
    start,
    last_good,  ///< at once, and another version: the one it died with failed in its probation
    back_off,
    quarantine
  };
  Step step = Step::start;
  MonotonicTime not_before;  ///< earliest start; with `start`: at once
  int deaths = 0;            ///< within the window
};

/// When a dead node may be started again. From `restarts` deaths within the window on, a start is not before
/// first_wait after the start before, doubling with each death up to longest_wait; from `quarantine_deaths`
/// on not before longest_wait. A node that then lives for the window long has left all of it behind. A
/// death of a version within its probation asks for the last good one before any waiting; a later one never
/// does, except of a version that the operator has not confirmed. @param trial of the process that died
[[nodiscard]] RestartDecision decide(const DeathHistory& history, const RingSettings& settings,
                                     const std::optional<VersionTrial>& trial = std::nullopt);

/// One line of text with its CRC-32C.
[[nodiscard]] std::string encode(const DeathHistory& history);
/// nullopt: damaged.
[[nodiscard]] std::optional<DeathHistory> decode_history(std::string_view text);

}  // namespace srfs::suite
