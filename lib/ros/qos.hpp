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
};

/// Of an action's status topic, as rcl_action has it: the latest state of all goals, also for who comes
/// later.
inline constexpr Qos action_status_qos{.depth = 1, .transient_local = true};

}  // namespace srfs::ros
