// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <optional>
#include <string>

#include "base/result.hpp"
#include "base/time.hpp"

namespace srfs::hw {

enum class WatchdogError : std::uint8_t {
  gone,         ///< no device at present; opened again by later calls, at most every 100 ms
  not_allowed,  ///< disarm of a watchdog that stays armed for good
};
[[nodiscard]] const char* to_string(WatchdogError error);

/// What the device reports of itself and of the last reset, read each time it is opened.
struct WatchdogFacts {
  std::string identity;                   ///< for people
  std::optional<bool> nowayout;           ///< it cannot be stopped once armed; nullopt: not known
  std::optional<bool> reset_by_watchdog;  ///< it caused the last reset; nullopt: not known
  std::string boot;                       ///< names this boot where no kernel boots (simulated); else empty
};

struct WatchdogCounters {
  std::uint64_t fed = 0;
  std::uint64_t failed = 0;
  std::uint64_t reopened = 0;
};

/// A timer that restarts the computer (or, simulated, the suite) unless fed. Armed by opening. Destroying the
/// object leaves it armed. Not thread-safe; never blocks.
class Watchdog {
 public:
  virtual ~Watchdog() = default;

  [[nodiscard]] virtual Result<void, WatchdogError> feed() = 0;
  /// The time-out in force, as the device reports it; nullopt when it does not, or is gone.
  [[nodiscard]] virtual std::optional<seconds> timeout() const = 0;
  /// Empty until it was there once.
  [[nodiscard]] virtual const WatchdogFacts& facts() const = 0;
  /// Stops it. Only the simulated one can be stopped; in flight the answer is not_allowed.
  [[nodiscard]] virtual Result<void, WatchdogError> disarm() = 0;
  /// Why the device is gone, for a person; empty while it is there.
  [[nodiscard]] virtual std::string reason() const = 0;
  [[nodiscard]] virtual const WatchdogCounters& counters() const = 0;
};

}  // namespace srfs::hw
