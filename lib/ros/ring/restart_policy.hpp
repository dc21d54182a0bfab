#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "base/time.hpp"
#include "ros/deployment.hpp"

namespace srfs::ros {

/// What is remembered of one node's deaths in this boot. Counted is the time it lived: while it waits for its
/// next start this clock stands still, so that a long wait does not make its deaths look rare.
struct DeathHistory {
  bool down = false;      ///< its last death is counted, and nobody has tried to start it since
  MonotonicTime started;  ///< the last attempt to start it; the epoch: not known, so since boot
  nanoseconds lived{0};   ///< up to its last death
  std::uint32_t total = 0;
  std::vector<nanoseconds> deaths;  ///< those within the window before the last, on the clock of `lived`

  friend bool operator==(const DeathHistory&, const DeathHistory&) = default;
};

/// The node is dead: counted once between two starts. @param now not before the start
void count_death(DeathHistory& history, const RingSettings& settings, MonotonicTime now);
/// Somebody tries to start it now; whether it comes up shows later.
void count_start(DeathHistory& history, MonotonicTime now);

struct RestartDecision {
  enum class Step : std::uint8_t { start, back_off, quarantine };
  Step step = Step::start;
  MonotonicTime not_before;  ///< earliest start; with `start`: at once
  int deaths = 0;            ///< within the window
};

/// When a dead node may be started again. From `restarts` deaths within the window on, a start is not before
/// first_wait after the start before, doubling with each death up to longest_wait; from `quarantine_deaths`
/// on not before longest_wait. A node that then lives for the window long has left all of it behind. Deaths
/// soon after a change of version belong here, too: they ask for the last good version, before any waiting.
/// There are no versions yet.
[[nodiscard]] RestartDecision decide(const DeathHistory& history, const RingSettings& settings);

/// One line of text with its CRC-32C.
[[nodiscard]] std::string encode(const DeathHistory& history);
/// nullopt: damaged.
[[nodiscard]] std::optional<DeathHistory> decode_history(std::string_view text);

}  // namespace srfs::ros
