// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <sys/types.h>

#include <cstdint>
#include <optional>
#include <string>

#include "base/time.hpp"

namespace srfs::suite {

/// What an observer of the ring holds against a node (DESIGN section 8). The numbers are on the wire and in
/// the ledger.
enum class FaultClass : std::uint8_t {
  none = 0,
  absent = 1,         ///< no process holds its instance lock, and none was seen to end
  exited = 2,         ///< its process ended
  silent = 3,         ///< checks unanswered and the heartbeat page stale: hung, stopped or starved
  deaf = 4,           ///< checks unanswered and the heartbeat page fresh: its communication failed
  wrong_answer = 5,   ///< another incarnation than its lock says, or an impossible state
  not_checking = 6,   ///< answers, but has not checked its own downstream for long
  not_working = 7,    ///< answers, but work that is due is not done
  worker_frozen = 8,  ///< answers, but a job of one of its worker threads does not end
  start_overdue = 9,  ///< started, and not in its desired state by the deadline
  too_large = 10,     ///< more memory or descriptors than its cap
  cpu_hog = 13,       ///< takes the CPUs from all others, without a real-time priority
  // Of a version on probation; the process itself may look healthy.
  not_confirmed = 11,    ///< the operator has not confirmed it in time
  limit_violation = 12,  ///< its telemetry left a hard limit, or it raised an event of high severity
};
[[nodiscard]] const char* to_text(FaultClass fault);

/// A verdict that asks for a restart.
struct Accusation {
  std::string subject;  ///< without slash
  FaultClass fault = FaultClass::none;
  pid_t pid = 0;                  ///< the process meant; 0: there is none
  std::uint32_t incarnation = 0;  ///< of that process; a later one is innocent. 0: not known
  std::uint32_t generation = 0;   ///< of the ring's membership when it was judged
  std::uint32_t misses = 0;       ///< unanswered checks that were counted
  MonotonicTime first_evidence;   ///< the first of them, or the exit
  MonotonicTime decided;
  std::string detail;  ///< for people: "worker 'store' busy for 12.1 s"
};

/// A node was started in another version than the active one.
struct VersionFallback {
  std::uint32_t from = 0;
  std::uint32_t to = 0;
  std::string why;  ///< for people: what was wrong with the one it comes from
};
[[nodiscard]] std::string to_text(const VersionFallback& fallback);

/// What became of an accusation.
struct RestartOutcome {
  enum class What : std::uint8_t {
    restarted = 1,
    renewed = 2,         ///< another process had restarted it before
    under_way = 3,       ///< another process is restarting it
    held = 4,            ///< by the operator: it stays down
    backing_off = 5,     ///< it died too often: not before `not_before`
    quarantined = 6,     ///< the same, and slowly from now on
    stopping = 7,        ///< the suite is being stopped
    unkillable = 8,      ///< its process survived SIGKILL for the time it was given
    cannot_start = 9,    ///< binary missing or damaged, no memory, no process
    not_believed = 10,   ///< the accusation's process is not the one that runs, or the membership has changed
    communication = 11,  ///< deaf, and the suite's one kill for that was used a short time ago
  };
  What what = What::restarted;
  pid_t pid = 0;  ///< of the new process
  std::optional<MonotonicTime> not_before;
  std::string reason;                         ///< for people
  std::optional<std::uint32_t> version{};     ///< of the new process
  std::optional<VersionFallback> fallback{};  ///< the version before it failed
};
[[nodiscard]] const char* to_text(RestartOutcome::What what);

}  // namespace srfs::suite
