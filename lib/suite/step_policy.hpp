// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>

#include "base/time.hpp"

namespace srfs::suite {

/// When each step is taken, of a deployment (`step_down`).
struct StepPolicy {
  std::uint32_t last_good = 3;  ///< after so many starts in a row that did not become healthy
  std::uint32_t golden = 6;
  std::uint32_t rescue = 9;
  seconds calm{86400};        ///< healthy for so long without a break: the next start is one step up
  seconds no_contact{86400};  ///< srfs_rescue without a telecommand for so long: the suite gets another try

  /// Each step is later than the one before it.
  [[nodiscard]] bool is_sound() const { return 0 < last_good && last_good < golden && golden < rescue; }
  friend bool operator==(const StepPolicy&, const StepPolicy&) = default;
};

}  // namespace srfs::suite
