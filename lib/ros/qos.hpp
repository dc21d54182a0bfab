// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <string>

namespace srfs::ros {

/// What differs between topics. The default is reliable KEEP_LAST: a full history drops its oldest sample,
/// and the reader counts the gap. Flight topics keep to it: with KEEP_ALL one stopped reader stops its
/// writers.
struct Qos {
  std::int32_t depth = 10;
  bool transient_local = false;
  std::chrono::milliseconds lifespan{0};  ///< a sample is dropped this long after it was written; 0: never
  /// Readers drop a sample that claims to be larger before they take memory for it; 0: what the bounds of its
  /// type allow, 1 MiB where they do not say.
  std::size_t largest_octets = 0;
  /// Lost samples are not repeated. A reader with this hears every writer; one without hears reliable ones
  /// only.
  bool best_effort = false;
  /// Nothing is dropped: a writer whose `depth` samples are not acknowledged refuses the next one after 1 ms
  /// (publish() returns false), and a reader whose `depth` samples wait lets reliable writers repeat.
  bool keep_all = false;
  std::chrono::milliseconds deadline{0};  ///< a sample is due this often, promised or wanted; 0: no deadline
  /// A writer is not alive when nothing proved it for so long; 0: as long as its participant is there.
  std::chrono::milliseconds liveliness_lease{0};
  bool manual_liveliness = false;  ///< publishing proves it (MANUAL_BY_TOPIC), not the process alone
};

/// What the QoS policies noticed at a publisher or subscription since it was made.
struct QosEvents {
  std::uint64_t deadlines_missed = 0;
  std::uint64_t liveliness_lost =
      0;                   ///< a publisher's own; at a subscription publishers that are not alive any longer
  std::int32_t alive = 0;  ///< publishers with proven liveliness, at a subscription
  std::uint64_t incompatible = 0;   ///< others on the topic that are not matched because of their QoS
  std::string incompatible_policy;  ///< of the last one, in words: "reliability"
};

/// A service's requests that wait to be taken, and its replies that wait for their acknowledgement; what
/// finds this full makes the oldest one go. Memory is taken for what is there.
inline constexpr std::int32_t service_depth = 1024;

/// Of an action's status topic, as rcl_action has it: the latest state of all goals, also for late readers.
inline constexpr Qos action_status_qos{.depth = 1, .transient_local = true};

}  // namespace srfs::ros
