// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <chrono>
#include <cstdint>

namespace srfs::ros {

/// The QoS that differs between our topics; everything is reliable KEEP_LAST (FASTDDS.md: KEEP_ALL lets one
/// stopped reader block every write). A full history drops its oldest sample; the reader counts the gap.
struct Qos {
  std::int32_t depth = 10;
  bool transient_local = false;
  std::chrono::milliseconds lifespan{0};  ///< a sample is dropped this long after it was written; 0: never
  /// Readers drop a sample that claims to be larger before they take memory for it; 0: what the bounds of its
  /// type allow, 1 MiB where they do not say.
  std::size_t largest_octets = 0;
};

/// A service's requests that wait to be taken, and its replies that wait for their acknowledgement; what
/// finds this full makes the oldest one go. Memory is taken for what is there.
inline constexpr std::int32_t service_depth = 1024;

/// Of an action's status topic, as rcl_action has it: the latest state of all goals, also for late readers.
inline constexpr Qos action_status_qos{.depth = 1, .transient_local = true};

}  // namespace srfs::ros
