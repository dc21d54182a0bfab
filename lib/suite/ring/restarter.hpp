// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <string>

#include "base/process.hpp"
#include "suite/deployment.hpp"
#include "suite/instance.hpp"
#include "suite/launcher.hpp"
#include "suite/ring/fault.hpp"
#include "suite/ring/fault_ledger.hpp"
#include "suite/ring/restart_policy.hpp"
#include "update/version_table.hpp"

namespace srfs::suite {

/// Restarts a node that an observer accuses, exactly once however many observers accuse it (DESIGN section
/// 8): under the node's restart lock the evidence is read again, the old process is killed, its instance lock
/// proves that it is gone, and the active version is started, no child of this process: the last good one
/// when it died in the probation of another.
/// Needs no DDS, waits for no disk; the ledger and the report are written afterwards by a thread of its own.
/// One thread at a time, of which on_recovered() may be another.
class Restarter {
 public:
  static constexpr milliseconds abort_patience{150};  ///< for the backtrace of a hung process
  static constexpr milliseconds term_patience{50};
  static constexpr milliseconds kill_patience{500};  ///< after SIGKILL; then it is unkillable
  /// On a machine under pressure (busy_cpu_pressure) one node of the suite is started in such a time: a start
  /// costs up to 0.2 s of a CPU, and restarts must not feed an overload.
  static constexpr milliseconds between_starts{500};

  /// @param observer  name of the node that this process is, or of the tool
  Restarter(const Deployment& deployment, VarPaths var, std::string observer,
            std::filesystem::path bin_folder = suite_bin_folder());
  ~Restarter();  ///< waits for the records that are being written, 2 s at most
  Restarter(const Restarter&) = delete;
  Restarter& operator=(const Restarter&) = delete;

  /// Blocks for 3.8 s at most, mostly some 10 ms. Call it again while the node stays down: a refusal does not
  /// promise that another process will restart it.
  RestartOutcome restart(const Accusation& accusation);
  /// A node this process restarted is in its desired state again: the ledger's last figure. Never blocks.
  void on_recovered(const std::string& subject, std::uint32_t incarnation, MonotonicTime active);
  /// The probation of a node's version ended well: it becomes the last good one. Never blocks; a record like
  /// the others.
  void commit(const std::string& subject, std::uint32_t version);

  /// Asked under the lock: the generation of the ring's membership now. An accusation of another one is void.
  /// Without it, or with generation 0 in the accusation, none is.
  void set_generation_source(std::function<std::optional<std::uint32_t>()> generation) {
    generation_ = std::move(generation);
  }
  /// The deployment as it is now, asked at the begin of a restart. Without it: the constructor's.
  void set_deployment_source(std::function<const Deployment&()> deployment) {
    deployment_now_ = std::move(deployment);
  }
  /// The share of time in which some task of the machine waited for a CPU, 0 to 1, of the last seconds;
  /// nullopt: the kernel does not tell, so starts are not spaced. Without it: /proc/pressure/cpu.
  void set_pressure_source(std::function<std::optional<double>()> pressure) {
    pressure_ = std::move(pressure);
  }
  /// Asked just before a start: false when who asked for it has ended meanwhile. Without it: it is wanted.
  void set_wanted_source(std::function<bool()> wanted) { wanted_ = std::move(wanted); }
  /// How signals reach a process; a test has one here that does not obey.
  void set_signaller(std::function<int(const Process&, int number)> send) { send_ = std::move(send); }
  /// Records that were not written: too many at once, or the disk refused them.
  [[nodiscard]] std::uint64_t records_lost() const;
  /// Waits until all records so far are written. @return false: not within @p patience
  bool flush(milliseconds patience);

 private:
  class Recorder;
  struct FailedVersion;
  struct Case;
  [[nodiscard]] RestartOutcome decide_and_act(Case& c);
  [[nodiscard]] std::string wait_for_stand_in(const Case& c) const;
  [[nodiscard]] std::optional<RestartOutcome> look_again(Case& c) const;
  [[nodiscard]] std::optional<RestartOutcome> look_for_starting(Case& c) const;
  [[nodiscard]] std::optional<RestartOutcome> ask_policy(Case& c) const;
  [[nodiscard]] bool gives_way_to_golden(const Case& c, update::VersionNumber active) const;
  void take_next_best(Case& c, const FailedVersion& failed, DeathHistory& history) const;
  [[nodiscard]] std::optional<RestartOutcome> kill_old(Case& c) const;
  [[nodiscard]] RestartOutcome start_new(Case& c, const RestartLock& lock) const;
  [[nodiscard]] std::optional<RestartOutcome> wait_for_pressure(const Case& c) const;
  enum class Turn { look, take };
  [[nodiscard]] bool turn(const char* name, nanoseconds interval, bool without_memory, Turn what) const;
  void record(const Case& c, const RestartOutcome& outcome);

  const Deployment& deployment_;  ///< of the start; the ring's settings and the file never change
  VarPaths var_;
  std::string observer_;
  std::filesystem::path bin_folder_;
  std::function<std::optional<std::uint32_t>()> generation_;
  std::function<const Deployment&()> deployment_now_;
  std::function<bool()> wanted_;
  std::function<int(const Process&, int number)> send_;
  std::function<std::optional<double>()> pressure_;
  std::map<std::string, RestartOutcome::What> last_recorded_;  ///< a refusal that repeats is recorded once
  std::shared_ptr<Recorder> recorder_;
};

}  // namespace srfs::suite
