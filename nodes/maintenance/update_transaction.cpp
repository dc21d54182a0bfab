// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "nodes/maintenance/update_transaction.hpp"

#include <utility>

#include <mission/structures.hpp>

namespace srfs {

using update::UpdateStep;
using Actions = UpdateTransaction::Actions;

namespace {

constexpr const char* ended_by_mode = "not in this mode";

Actions operator+(Actions first, Actions second) {
  first.insert(first.end(), std::make_move_iterator(second.begin()), std::make_move_iterator(second.end()));
  return first;
}

}  // namespace

UpdateTransaction::UpdateTransaction(update::UpdateJournal journal, std::string own_node)
    : journal_(std::move(journal)), own_node_(std::move(own_node)) {}

bool UpdateTransaction::take(Waiting expected) {
  if (waiting_ != expected) return false;
  waiting_ = Waiting::nothing;
  return true;
}

// ---------------------------------------------------------------- begin

Actions UpdateTransaction::install(const std::string& file, bool activate) {
  if (rests_) return {AnswerTelecommand{mission::failure::wrong_mode}};
  if (is_busy()) {
    const bool is_same = !is_taking_in() && update().file == file;
    return {AnswerTelecommand{is_same ? mission::failure::none : mission::failure::update_under_way}};
  }
  waiting_ = Waiting::intake;
  asked_file_ = file;
  asked_to_activate_ = activate;
  return {TakeInPackage{file, journal_}};
}

Actions UpdateTransaction::on_taken_in(Result<Intake, IntakeFailure> taken) {
  if (take(Waiting::intake_again)) {
    if (!taken) return end(UpdateStep::failed, taken.error().reason);
    if (taken->update.sha256 != update().sha256) return end(UpdateStep::failed, "the package has changed");
    manifest_ = std::move(taken->manifest);
    dictionary_ = std::move(taken->dictionary);
    return Actions{ReportUpdate{update()}} + next_step(Begins::before);
  }
  if (!take(Waiting::intake)) return {};
  if (!taken) return refuse(taken.error().code, taken.error().reason);
  taken->update.activate = asked_to_activate_;
  if (!journal_.begin(std::move(taken->update)))
    return refuse(mission::failure::package_refused, "too many nodes in the update journal");
  manifest_ = std::move(taken->manifest);
  dictionary_ = std::move(taken->dictionary);
  waiting_ = Waiting::begin;
  return {WriteUpdateJournal{journal_, true}};
}

Actions UpdateTransaction::refuse(FailureCode code, const std::string& reason) {
  return {ReportRefusal{asked_file_, reason}, AnswerTelecommand{code}};
}

Actions UpdateTransaction::on_begun(const Result<void, std::string>& written) {
  if (!take(Waiting::begin)) return {};
  if (written) return Actions{AnswerTelecommand{}} + begin_step(UpdateStep::build);
  // One copy of the journal may have been written. If this is not, the next start ends it and reports so.
  journal_.end(UpdateStep::failed, written.error());
  return Actions{WriteUpdateJournal{journal_}, RemoveWorkFolder{}} +
         refuse(mission::failure::package_refused, written.error());
}

Actions UpdateTransaction::resume(const update::VersionTable& table, bool is_in_suite) {
  if (!journal_.is_under_way()) return {};
  const bool was_in_swap = update().step == UpdateStep::swap;
  journal_.resume(table);
  // The table has the version before its process runs: the old one may still be there.
  const bool may_run_another =
      was_in_swap && update().kind == update::PackageKind::replace && update().node != own_node_;
  if (update().step == UpdateStep::installed && (!is_in_suite || may_run_another))
    journal_.set(UpdateStep::swap);
  if (!journal_.is_under_way()) return {ReportUpdate{update()}, WriteUpdateJournal{journal_}};
  const Actions actions{WriteUpdateJournal{journal_}};
  // Of a swap only the description of a new node is needed, and that is in its package.
  if (update().step == UpdateStep::swap && update().kind == update::PackageKind::replace)
    return actions + Actions{ReportUpdate{update()}} + next_step(Begins::before);
  waiting_ = Waiting::intake_again;
  return actions + Actions{TakeInPackage{update().file, journal_}};
}

// ---------------------------------------------------------------- the steps

Actions UpdateTransaction::begin_step(UpdateStep step) {
  journal_.set(step);
  return Actions{ReportUpdate{update()}, WriteUpdateJournal{journal_}} + next_step();
}

Actions UpdateTransaction::next_step(Begins begins) {
  if (stopped_) return {};
  const bool may_be_half_done = update().step == UpdateStep::swap && begins == Begins::before;
  if (rests_ && update().step <= UpdateStep::swap && !may_be_half_done)
    return end(UpdateStep::cancelled, ended_by_mode);
  switch (update().step) {
    case UpdateStep::build:
      waiting_ = Waiting::lane;
      return {BuildProgram{manifest_}};
    case UpdateStep::self_test:
      waiting_ = Waiting::lane;
      return {TestProgram{manifest_, dictionary_}};
    case UpdateStep::store:
      waiting_ = Waiting::store;
      return {StoreProgram{update()}};
    case UpdateStep::swap:
      waiting_ = Waiting::swap;
      if (update().kind == update::PackageKind::add) return {AddProgram{update(), manifest_, dictionary_}};
      return {SwapProgram{update()}};
    default:
      return {};
  }
}

Actions UpdateTransaction::on_lane_ended(const LaneEnd& end_of_lane) {
  if (!take(Waiting::lane)) return {};
  if (std::exchange(cancelled_, false))
    return end(UpdateStep::cancelled, rests_ ? ended_by_mode : "by telecommand");
  switch (end_of_lane.how) {
    case LaneEnd::How::hung:
      return end(UpdateStep::failed, "the build lane hung and was killed");
    case LaneEnd::How::not_started:
      return end(UpdateStep::failed, end_of_lane.problem);
    case LaneEnd::How::reported:
      break;
  }
  const LaneReport& report = end_of_lane.report;
  const Actions log{SendLaneLog{update()}};
  if (update().step == UpdateStep::self_test) {
    if (report.good) return begin_step(UpdateStep::store);
    return log + end(UpdateStep::failed, report.reason);
  }
  journal_.built(milliseconds(report.took_ms));
  if (!report.good) return log + end(UpdateStep::failed, report.reason);
  if (manifest_.binary_sha256 && *manifest_.binary_sha256 != report.program_sha256)
    return log + end(UpdateStep::failed, "the program differs from the ground build");
  return log + begin_step(UpdateStep::self_test);
}

Actions UpdateTransaction::on_stored(const Result<StoredProgram, std::string>& stored) {
  if (!take(Waiting::store)) return {};
  if (!stored) return end(UpdateStep::failed, stored.error());
  journal_.stored(stored->version, stored->octets);
  return Actions{RemoveWorkFolder{}} +
         begin_step(update().activate ? UpdateStep::swap : UpdateStep::candidate);
}

Actions UpdateTransaction::on_swapped(const Result<std::optional<StartedProgram>, std::string>& started,
                                      MonotonicTime now) {
  if (!take(Waiting::swap)) return {};
  if (!started) return end(UpdateStep::failed, started.error());
  if (update().node == own_node_) return {EndOwnProcess{}};
  if (!*started) return installed(std::nullopt);
  const StartedProgram& program = **started;
  if (program.version != update().version)
    return end(UpdateStep::failed,
               program.fallback.empty() ? std::string("another version was started") : program.fallback);
  if (stopped_) return {};
  waiting_ = Waiting::active;
  swap_begun_ = program.stopped;
  looking_ends_ = now + longest_wait_for_active;
  return {AwaitActive{update(), program.pid}};
}

Actions UpdateTransaction::on_look(const ProgramLook& look, MonotonicTime now) {
  if (waiting_ != Waiting::active) return {};
  if (look.is_active) return installed(std::chrono::ceil<milliseconds>(now - swap_begun_));
  if (!look.version) return end(UpdateStep::failed, "the version no longer exists");
  if (*look.version == update::VersionState::failed) return end(UpdateStep::failed, look.reason);
  if (now < looking_ends_) return {};
  return installed(std::nullopt);  // the ring judges it from here
}

// ---------------------------------------------------------------- end

Actions UpdateTransaction::cancel() {
  if (waiting_ != Waiting::lane) return {AnswerTelecommand{mission::failure::no_update}};
  cancelled_ = true;
  return {StopLane{}, AnswerTelecommand{}};
}

Actions UpdateTransaction::rest(bool rests) {
  rests_ = rests;
  if (!rests_ || waiting_ != Waiting::lane) return {};
  cancelled_ = true;
  return {StopLane{}};
}

Actions UpdateTransaction::installed(std::optional<milliseconds> outage) {
  waiting_ = Waiting::nothing;
  journal_.installed(outage);
  return {ReportUpdate{update()}, WriteUpdateJournal{journal_}};
}

Actions UpdateTransaction::end(UpdateStep step, const std::string& reason) {
  waiting_ = Waiting::nothing;
  journal_.end(step, reason);
  return {ReportUpdate{update()}, WriteUpdateJournal{journal_}, RemoveWorkFolder{}};
}

}  // namespace srfs
