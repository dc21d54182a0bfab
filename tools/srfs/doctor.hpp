#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "base/time.hpp"
#include "ros/deployment.hpp"
#include "tools/srfs/doctor_machine.hpp"

namespace srfs::tool {

enum class Verdict : std::uint8_t {
  ok,       ///< looked at, and as it has to be
  note,     ///< good to know
  unknown,  ///< cannot be told from here
  warn,     ///< works, worse than it could
  fail,     ///< what the deployment asks for is not to be had
};
[[nodiscard]] std::string_view to_text(Verdict verdict);

/// One line of `srfs doctor`.
struct Finding {
  Verdict verdict;
  std::string check;  ///< what was looked at, a name for tools: "sysctl.net.core.rmem_max"
  std::string found;
  std::string expected;  ///< empty: nothing in particular
  std::string command;   ///< for root: changes it, or tells more; empty: there is none
};

/// What is asked, and what has been found so far.
struct Examination {
  const Machine& machine;
  const ros::Deployment& deployment;
  std::filesystem::path var;     ///< absolute
  std::filesystem::path prefix;  ///< installation whose programs the suite runs
  UtcTime now;
  Account starter;  ///< who runs this: taken for who starts the suite
  std::vector<Finding> findings = {};

  void ok(std::string check, std::string found);
  void note(std::string check, std::string found, std::string expected = "", std::string command = "");
  void unknown(std::string check, std::string why, std::string expected = "");
  void add(Verdict verdict, std::string check, std::string found, std::string expected, std::string command);

  /// It drives hardware: a device is none of the simulation's.
  [[nodiscard]] bool flies() const;
  /// A node runs under SCHED_FIFO.
  [[nodiscard]] bool is_real_time() const;
  /// For what costs a simulation nothing.
  [[nodiscard]] Verdict when_flying(Verdict verdict) const { return flies() ? verdict : Verdict::note; }
  [[nodiscard]] const ros::NodeEntry* running(std::string_view executable) const;
  /// Whom a node's process will belong to; nullopt: there is no such user, which is a finding of its own.
  [[nodiscard]] std::optional<Account> account(const ros::NodeEntry& node) const;
};

// The checks; each only reads.
void examine_kernel(Examination& x);
void examine_waiting(Examination& x);
void examine_processors(Examination& x);
void examine_limits(Examination& x);
void examine_users(Examination& x);
void examine_devices(Examination& x);
void examine_sysctls(Examination& x);
void examine_memory(Examination& x);
void examine_disk(Examination& x);
void examine_network(Examination& x);
void examine_clock(Examination& x);
void examine_lane(Examination& x);
void examine_keys(Examination& x);

/// All of them. Blocks as reading some hundred files does.
[[nodiscard]] std::vector<Finding> examine(const Machine& machine, const ros::Deployment& deployment,
                                           const std::filesystem::path& var,
                                           const std::filesystem::path& prefix, UtcTime now);

/// `srfs doctor`: prints them. @return exit code: 0, or 1 when something fails
int doctor(const ros::Deployment& deployment, const std::filesystem::path& var, bool json);

}  // namespace srfs::tool
