// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <sys/types.h>

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "base/cpu_wait.hpp"
#include "base/time.hpp"

namespace srfs {

/// What the ring's times leave for the watchdog (README.md has the arithmetic).
struct WatchdogBudget {
  nanoseconds recovery;           ///< longest time in which the ring brings a dead node back
  nanoseconds evidence_lifetime;  ///< an answer counts for so long: a recovery does not starve the watchdog
  nanoseconds least_timeout;      ///< of the watchdog: longer than the recovery of timing itself
};

/// Period of timing's own checks of the critical nodes; each is waited for at most as long.
inline constexpr nanoseconds critical_check_period = seconds(1);

/// @param period, misses, start_deadline  of the deployment's ring
[[nodiscard]] WatchdogBudget watchdog_budget(nanoseconds period, int misses, nanoseconds start_deadline);

/// Remembers when each critical node last gave proof that it works: the answer to timing's own question, with
/// its nonce, of a node that is Active. Whether somebody wants it in another state does not matter: an order
/// must not keep the spacecraft deaf. A start and a transition have their time in the lifetime of a proof.
/// Pure; one thread.
class CriticalAnswers {
 public:
  /// @param incarnation  of timing: answers to a process before this one have other nonces
  CriticalAnswers(std::vector<std::string> nodes, std::uint32_t incarnation, nanoseconds lifetime);

  [[nodiscard]] const std::vector<std::string>& nodes() const { return names_; }

  /// A question goes out. @return its nonce; older ones are void
  [[nodiscard]] std::uint64_t ask(std::size_t node, MonotonicTime now);
  /// @param state  of lifecycle_msgs/msg/State
  void on_answer(std::size_t node, std::uint64_t nonce, std::uint8_t state);

  /// What the node's process has had of the CPU: a time in which it waited for one does not make its proof
  /// older.
  /// @param pid  another one's totals begin anew
  void on_cpu(std::size_t node, pid_t pid, const CpuTotals& totals, MonotonicTime now);

  /// Want of a CPU excuses missing proof for so long at most: then a restart of the computer may end it.
  static constexpr nanoseconds longest_excuse = seconds(30);
  /// Proof is not older than the lifetime, counted from the question: an answer that lay in a queue is as old
  /// as what it answers.
  [[nodiscard]] bool holds(std::size_t node, MonotonicTime now) const;

  struct Counters {
    std::uint64_t asked = 0;
    std::uint64_t answered = 0;
    std::uint64_t wrong_nonce = 0;
    std::uint64_t not_active = 0;
  };
  [[nodiscard]] const Counters& counters() const { return counters_; }

 private:
  struct Node {
    std::uint64_t nonce = 0;
    MonotonicTime asked;
    std::optional<MonotonicTime> proof;
    pid_t pid = 0;
    CpuHistory cpu;
  };

  std::vector<std::string> names_;
  std::vector<Node> nodes_;
  nanoseconds lifetime_;
  std::uint64_t next_nonce_;
  Counters counters_;
};

}  // namespace srfs
