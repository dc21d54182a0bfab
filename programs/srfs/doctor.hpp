// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "base/time.hpp"
#include "programs/srfs/doctor_machine.hpp"
#include "suite/deployment.hpp"

namespace srfs::tool {

enum class Verdict : std::uint8_t {
  ok,       ///< checked, and as required
  note,     ///< good to know
  unknown,  ///< cannot be checked from here
  warn,     ///< works, worse than it could
  fail,     ///< a requirement of the deployment is not met
};
[[nodiscard]] std::string_view to_text(Verdict verdict);

/// One line of `srfs doctor`.
struct Finding {
  Verdict verdict;
  std::string check;  ///< what was checked, a name for tools: "sysctl.net.core.rmem_max"
  std::string found;
  std::string expected;  ///< empty: nothing in particular
  std::string command;   ///< for root: fixes it, or shows more; empty: none
};

/// What is examined, and the findings so far.
struct Examination {
  const Machine& machine;
  const suite::Deployment& deployment;
  std::filesystem::path var;     ///< absolute
  std::filesystem::path prefix;  ///< installation whose programs the suite runs
  UtcTime now;
  Account starter;  ///< the caller, assumed to start the suite as well
  std::vector<Finding> findings = {};

  void ok(std::string check, std::string found);
  void note(std::string check, std::string found, std::string expected = "", std::string command = "");
  void unknown(std::string check, std::string why, std::string expected = "");
  void add(Verdict verdict, std::string check, std::string found, std::string expected, std::string command);

  /// It drives hardware: at least one device is not simulated.
  [[nodiscard]] bool flies() const;
  /// A node runs under SCHED_FIFO.
  [[nodiscard]] bool is_real_time() const;
  /// For what matters on flight hardware but not in a simulation.
  [[nodiscard]] Verdict when_flying(Verdict verdict) const { return flies() ? verdict : Verdict::note; }
  [[nodiscard]] const suite::NodeEntry* running(std::string_view executable) const;
  /// The account that will own a node's process; nullopt: there is no such user, which is a separate finding.
  [[nodiscard]] std::optional<Account> account(const suite::NodeEntry& node) const;
};

// The checks; each only reads.
void examine_kernel(Examination& x);
void examine_waiting(Examination& x);
void examine_processors(Examination& x);
void examine_limits(Examination& x);
void examine_users(Examination& x);
void examine_privileges(Examination& x);
void examine_devices(Examination& x);
void examine_sysctls(Examination& x);
void examine_memory(Examination& x);
void examine_orders(Examination& x);
void examine_disk(Examination& x);
void examine_network(Examination& x);
void examine_clock(Examination& x);
void examine_lane(Examination& x);
void examine_keys(Examination& x);

/// Runs all checks. Blocks for as long as reading some hundred files takes.
[[nodiscard]] std::vector<Finding> examine(const Machine& machine, const suite::Deployment& deployment,
                                           const std::filesystem::path& var,
                                           const std::filesystem::path& prefix, UtcTime now);

/// `srfs doctor`: prints them. @return exit code: 0, or 1 when something fails
int doctor(const suite::Deployment& deployment, const std::filesystem::path& var, bool json);

}  // namespace srfs::tool
