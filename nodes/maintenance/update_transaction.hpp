// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <sys/types.h>

#include <cstdint>
#include <optional>
#include <string>
#include <variant>
#include <vector>

#include <mission/structures.hpp>

#include "base/result.hpp"
#include "base/time.hpp"
#include "nodes/maintenance/lane_call.hpp"
#include "nodes/maintenance/package_intake.hpp"
#include "suite/commanding/telecommand_journal.hpp"
#include "update/update_journal.hpp"

namespace srfs {

// What the transaction decides; carried out by the adapter in the given order.

/// Ends the telecommand that asked for the installation, or for its end.
struct AnswerTelecommand {
  FailureCode code = mission::failure::none;
};
/// Verify the package and unpack it (package_intake.hpp). Answer with on_taken_in().
struct TakeInPackage {
  std::string file;
  update::UpdateJournal journal;  ///< whose counters forbid old packages
};
/// Both copies, behind all earlier writes. Answer with on_begun() where asked for.
struct WriteUpdateJournal {
  update::UpdateJournal journal;
  bool answer = false;
};
/// The package is not taken: an event for the operator.
struct ReportRefusal {
  std::string file;
  std::string reason;
};
/// Where the update stands now: an event, and a line in the log.
struct ReportUpdate {
  update::Update update;
};
/// Answer with on_lane_ended().
struct BuildProgram {
  update::Manifest manifest;
};
/// The same. A new node is tested with its own description.
struct TestProgram {
  update::Manifest manifest;
  std::string dictionary;
};
/// End the lane's process; it is followed by on_lane_ended() all the same.
struct StopLane {};
/// The lane's log goes to the ground, named after this update and its step.
struct SendLaneLog {
  update::Update update;
};
/// Add the built program to the versions of its node. Answer with on_stored().
struct StoreProgram {
  update::Update update;
};
/// Make the stored version the active one and restart its node. Answer with on_swapped().
struct SwapProgram {
  update::Update update;
};
/// The same for a node that was not there: it joins the suite, then it is started. Each may be done already.
struct AddProgram {
  update::Update update;
  update::Manifest manifest;
  std::string dictionary;
};
/// Look at the new process every few milliseconds: on_look(), until is_looking() is false.
struct AwaitActive {
  update::Update update;
  pid_t pid = 0;
};
/// The node that was swapped is the one that this process is: it exits soon, and the ring starts the other
/// version.
struct EndOwnProcess {};
/// The work folder of the update is not needed any more.
struct RemoveWorkFolder {};

using UpdateAction =
    std::variant<AnswerTelecommand, TakeInPackage, WriteUpdateJournal, ReportRefusal, ReportUpdate,
                 BuildProgram, TestProgram, StopLane, SendLaneLog, StoreProgram, SwapProgram, AddProgram,
                 AwaitActive, EndOwnProcess, RemoveWorkFolder>;

/// What became of a process of the lane.
struct LaneEnd {
  enum class How : std::uint8_t {
    reported,    ///< it wrote a report, or ended without one: `report` says which
    hung,        ///< it was killed at its deadline
    not_started  ///< `problem` says why
  };
  How how = How::reported;
  LaneReport report;
  std::string problem;
};

struct StoredProgram {
  update::VersionNumber version = update::golden;
  std::uint64_t octets = 0;
};

/// The process that was started in place of the old one.
struct StartedProgram {
  pid_t pid = 0;
  update::VersionNumber version = update::golden;
  std::string fallback;     ///< why another version than the wanted one was started; empty: not known
  MonotonicTime stopped{};  ///< when the process before it was asked to end
};

/// What is seen of a new process.
struct ProgramLook {
  bool is_active = false;  ///< it is in its desired state
  /// Of its version in the node's table; nullopt: the table does not have it
  std::optional<update::VersionState> version;
  std::string reason;  ///< why the version failed
};

/// The installation of an uplinked package: verify, build, self-test, store, swap, wait for Active. One at a
/// time. Pure: it gets what happened and says what is to be done. It may end at every instruction, with its
/// process or the computer: the journal and the node's table of versions say where it goes on.
/// What always holds: a package that was refused is never built, a version is stored once for one package,
/// nothing is started that was not to be activated, and an update that was accepted ends with a report: each
/// report comes before its record, so the next process repeats it where this one ends between them.
class UpdateTransaction {
 public:
  using Actions = std::vector<UpdateAction>;

  /// From the end of the swap; then the ring judges the new process alone.
  static constexpr nanoseconds longest_wait_for_active = seconds(10);

  /// @param journal  as it is on the disk. @param own_node  that this process is
  UpdateTransaction(update::UpdateJournal journal, std::string own_node);

  [[nodiscard]] const update::Update& update() const { return journal_.update(); }
  /// A package is verified or installed.
  [[nodiscard]] bool is_busy() const { return is_taking_in() || journal_.is_under_way(); }
  [[nodiscard]] bool is_looking() const { return waiting_ == Waiting::active; }

  /// A telecommand. While another package is under way it is answered with `update_under_way`; for the same
  /// one, sent again, with success.
  [[nodiscard]] Actions install(const std::string& file, bool activate);
  /// A telecommand: ends the lane's process. `no_update` when the lane does not run.
  [[nodiscard]] Actions cancel();
  /// The mode allows no installation: what has not begun to swap ends, and none begins. @param rests  or no
  /// more
  [[nodiscard]] Actions rest(bool rests);
  /// Once, after a start of this process: what an earlier one left goes on.
  /// @param table  of the update's node. @param is_in_suite  the deployment has the node
  [[nodiscard]] Actions resume(const update::VersionTable& table, bool is_in_suite);
  /// The node is deconfigured: nothing new begins, what is under way may still be answered.
  void stop() { stopped_ = true; }

  [[nodiscard]] Actions on_taken_in(Result<Intake, IntakeFailure> taken);
  [[nodiscard]] Actions on_begun(const Result<void, std::string>& written);
  [[nodiscard]] Actions on_lane_ended(const LaneEnd& end);
  [[nodiscard]] Actions on_stored(const Result<StoredProgram, std::string>& stored);
  /// @param started  nullopt: the node does not run now
  [[nodiscard]] Actions on_swapped(const Result<std::optional<StartedProgram>, std::string>& started,
                                   MonotonicTime now);
  [[nodiscard]] Actions on_look(const ProgramLook& look, MonotonicTime now);

 private:
  enum class Waiting : std::uint8_t { nothing, intake, begin, intake_again, lane, store, swap, active };

  [[nodiscard]] bool is_taking_in() const {
    return waiting_ == Waiting::intake || waiting_ == Waiting::begin || waiting_ == Waiting::intake_again;
  }
  /// An answer counts once, and only where it is waited for.
  [[nodiscard]] bool take(Waiting expected);
  [[nodiscard]] Actions refuse(FailureCode code, const std::string& reason);
  /// When the step began: a swap of an earlier process may be half done.
  enum class Begins : std::uint8_t { now, before };
  [[nodiscard]] Actions next_step(Begins begins = Begins::now);
  [[nodiscard]] Actions begin_step(update::UpdateStep step);
  [[nodiscard]] Actions end(update::UpdateStep step, const std::string& reason);
  [[nodiscard]] Actions installed(std::optional<milliseconds> outage);

  update::UpdateJournal journal_;
  const std::string own_node_;
  Waiting waiting_ = Waiting::nothing;
  bool stopped_ = false;
  bool cancelled_ = false;
  bool rests_ = false;
  std::string asked_file_;  ///< while it is taken in
  bool asked_to_activate_ = true;
  update::Manifest manifest_;     ///< of the update under way
  std::string dictionary_;        ///< the fragment that it brings; empty: none
  MonotonicTime swap_begun_{};    ///< while the new process is awaited
  MonotonicTime looking_ends_{};  ///< the same
};

}  // namespace srfs
