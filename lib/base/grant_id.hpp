// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <compare>
#include <cstdint>

namespace srfs {

/// Names one grant of the CAN bus for ever: switcher processes have rising incarnations, each counts its
/// grants up from 1. {0, 0} is no grant. A lower pair is an older grant.
struct GrantId {
  std::uint32_t incarnation = 0;
  std::uint32_t counter = 0;
  friend constexpr auto operator<=>(const GrantId&, const GrantId&) = default;
};

}  // namespace srfs
