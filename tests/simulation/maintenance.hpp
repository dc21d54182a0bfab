// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <map>
#include <optional>
#include <string>

#include "base/action_queue.hpp"
#include "nodes/maintenance/update_transaction.hpp"
#include "tests/simulation/played_worker.hpp"
#include "tests/simulation/versions.hpp"

namespace srfs::simulation {

/// Every package that the ground sent, and what became of it. Its functions check requirement F6.
class PackageRecord {
 public:
  explicit PackageRecord(Kernel& kernel) : kernel_(kernel), random_(kernel.random("packages")) {}

  struct Package {
    std::size_t node = 0;  ///< by lane
    std::uint64_t counter = 0;
    bool sound = true;  ///< its signature
    bool builds = true;
    bool passes_test = true;  ///< its self-test
    bool activate = true;
    PlayedProgram program;
    std::optional<MonotonicTime> accepted{};
    bool refused = false;
    bool ended = false;                                  ///< and that was reported
    std::string origin{};                                ///< of the version that it becomes
    update::UpdateStep last = update::UpdateStep::none;  ///< that was reported
    bool is_used = false;                                ///< an operator had its version used by itself
  };
  /// The operator makes a package for any node. @return its file
  std::string make(std::size_t nodes);
  [[nodiscard]] const Package& of(const std::string& file) const { return packages_.at(file); }
  void on_answer(const std::string& file, FailureCode code);
  void on_report(const update::Update& update);
  /// Its sources are built, or its program is to be used.
  void on_build(const std::string& file) const;
  void on_use(const std::string& file) const;
  /// An operator has a version used, whatever became of its installation.
  void on_use_ordered(const std::string& origin);
  /// At the end of a calm.
  void check_ends(MonotonicTime accepted_before) const;
  /// The same. @param origin  of a program that runs
  void check_running(const std::string& origin) const;
  /// The same. @param origin  of a program that is stored
  void check_stored(const std::string& origin) const;

  struct Counters {
    std::uint64_t made = 0;
    std::uint64_t installed = 0;
  };
  [[nodiscard]] const Counters& counters() const { return counters_; }

 private:
  Kernel& kernel_;
  Random random_;
  std::map<std::string, Package> packages_;  ///< by file
  Counters counters_;
};

/// What of maintenance outlives its process.
struct MaintenanceFlash {
  explicit MaintenanceFlash(Kernel& kernel)
      : packages(kernel), in_flight(kernel.random("maintenance in flight")) {}
  std::array<std::string, 2> journal;   ///< updates_a, updates_b
  std::optional<unsigned> writes_left;  ///< the process ends behind so many; nullopt: it lives
  struct VersionOrder {
    std::string node;
    update::VersionNumber version;
  };
  std::optional<VersionOrder> version_order;  ///< telecommand that is not completed
  PackageRecord packages;
  Random in_flight;
};

struct MaintenanceSurroundings {
  Disk& disk;
  MaintenanceFlash& flash;
  Versions& versions;
  std::vector<Host*> nodes;  ///< by lane
  const bool& powered;
  const bool& rests;                                ///< the mode allows no installation
  std::function<bool(const Host& node)> is_locked;  ///< another process restarts it
  /// Ends the process of a node and starts another one. @return its number
  std::function<pid_t(Host& node)> restart;
};

/// maintenance's UpdateTransaction, with its journal and update::VersionStore, over played surroundings: the
/// contents of packages, the build lane and the launcher.
class Maintenance final : public Program {
 public:
  Maintenance(Host& host, MaintenanceSurroundings surroundings);
  ~Maintenance() override;
  void start() override;
  /// Telecommands.
  void install(const std::string& file);
  void cancel();
  void use_version(const std::string& node, update::VersionNumber version);
  /// The mode allows installations, or does not.
  void rest(bool rests) { run(transaction_->rest(rests)); }

 private:
  using Swapped = Result<std::optional<StartedProgram>, std::string>;
  void run(UpdateTransaction::Actions actions);
  void carry_out(const AnswerTelecommand& action);
  void carry_out(const TakeInPackage& action);
  void carry_out(const WriteUpdateJournal& action);
  void carry_out(const ReportRefusal& action);
  void carry_out(const ReportUpdate& action);
  void carry_out(const BuildProgram& action);
  void carry_out(const TestProgram& action);
  void carry_out(const StopLane& action);
  void carry_out(const SendLaneLog& /*action*/) {}
  void carry_out(const StoreProgram& action);
  void carry_out(const SwapProgram& action);
  void carry_out(const AddProgram& /*action*/) {}
  void carry_out(const AwaitActive& action);
  void carry_out(const EndOwnProcess& action);
  void carry_out(const RemoveWorkFolder& action);
  [[nodiscard]] update::UpdateJournal read_journal() const;
  [[nodiscard]] Result<void, std::string> write_journal(const update::UpdateJournal& journal);
  [[nodiscard]] Result<Intake, IntakeFailure> take_in(const TakeInPackage& action) const;
  [[nodiscard]] Result<StoredProgram, std::string> store(const update::Update& u);
  [[nodiscard]] Swapped swap(const update::Update& u);
  void run_lane(nanoseconds longest);
  void look(const AwaitActive& action);
  void carry_out_version_order();
  [[nodiscard]] Host& node_of(const update::Update& u) const;

  Host& host_;
  MaintenanceSurroundings around_;
  std::optional<UpdateTransaction> transaction_;
  ActionQueue<UpdateAction> actions_;
  PlayedWorker worker_;
  std::optional<std::string> asked_;             ///< file of the telecommand that waits for its answer
  std::optional<std::string> answered_at_once_;  ///< of one that does not wait
  std::uint64_t lane_runs_ = 0;                  ///< to tell one run of the lane from another
  bool lane_stopped_ = false;
};

}  // namespace srfs::simulation
