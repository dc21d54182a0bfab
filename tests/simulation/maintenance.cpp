// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "tests/simulation/maintenance.hpp"

#include <fmt/format.h>

namespace srfs::simulation {
namespace {

constexpr auto job_program = "job/program";
constexpr nanoseconds longest_build = seconds(20);
constexpr nanoseconds longest_self_test = seconds(5);
constexpr milliseconds look_period{50};
constexpr milliseconds own_end{100};
constexpr seconds probation{60};

std::string hash_of(const PackageRecord::Package& package) {
  return fmt::format("{:064x}", package.node * 1'000'000 + package.counter);
}

}  // namespace

// ---------------------------------------------------------------- packages

std::string PackageRecord::make(std::size_t nodes) {
  Package package;
  package.node = random_.below(nodes);
  package.counter = ++counters_.made;
  package.sound = !random_.one_in(10);
  package.builds = !random_.one_in(6);
  package.activate = !random_.one_in(4);
  package.program.name = fmt::format("program{}", package.counter);
  package.passes_test = !random_.one_in(12);
  // Some die before they are Active.
  const std::uint64_t longest_life_ms = random_.one_in(4) ? 40 : 20'000;
  if (random_.one_in(3)) package.program.lives = milliseconds(1 + random_.below(longest_life_ms));
  const std::string file = fmt::format("packages/{}.pkg", package.counter);
  packages_.emplace(file, package);
  return file;
}

/// While another one is under way, or the same is taken in again, a request says nothing of its package.
void PackageRecord::on_answer(const std::string& file, FailureCode code) {
  const auto found = packages_.find(file);
  if (found == packages_.end()) return;
  Package& package = found->second;
  if (code == mission::failure::package_refused && !package.accepted) package.refused = true;
  if (code != mission::failure::none) return;
  package.refused = false;
  package.accepted = kernel_.now();
}

void PackageRecord::on_report(const update::Update& update) {
  const auto found = packages_.find(update.file);
  if (found == packages_.end()) return;
  found->second.origin = origin_of(update);
  found->second.last = update.step;
  if (!update::is_over(update.step)) return;
  if (!found->second.ended && update.step == update::UpdateStep::installed) ++counters_.installed;
  found->second.ended = true;
}

void PackageRecord::on_build(const std::string& file) const {
  const Package& package = packages_.at(file);
  if (package.refused || !package.sound)
    throw Violation{"F6", "a package that was refused is built: " + file};
}

void PackageRecord::on_use(const std::string& file) const {
  if (!packages_.at(file).activate)
    throw Violation{"F6", "a program is used that was to be stored only: " + file};
}

void PackageRecord::check_ends(MonotonicTime accepted_before) const {
  for (const auto& [file, package] : packages_) {
    if (package.accepted && *package.accepted < accepted_before && !package.ended)
      throw Violation{"F6", "an installation was accepted, and no end of it reported: " + file};
  }
}

void PackageRecord::on_use_ordered(const std::string& origin) {
  for (auto& [file, package] : packages_) package.is_used = package.is_used || package.origin == origin;
}

void PackageRecord::check_running(const std::string& origin) const {
  for (const auto& [file, package] : packages_) {
    const bool is_out =
        package.last == update::UpdateStep::failed || package.last == update::UpdateStep::cancelled;
    if (package.origin == origin && is_out && !package.is_used)
      throw Violation{"F6", "a program runs whose installation was reported as failed or cancelled: " + file};
  }
}

void PackageRecord::check_stored(const std::string& origin) const {
  for (const auto& [file, package] : packages_) {
    if (package.origin == origin && package.last == update::UpdateStep::cancelled)
      throw Violation{"F6", "a program is stored whose installation was reported as cancelled: " + file};
  }
}

// ---------------------------------------------------------------- the node

Maintenance::Maintenance(Host& host, MaintenanceSurroundings surroundings)
    : host_(host), around_(std::move(surroundings)), worker_(host, around_.disk) {}

/// The worker's first job is done in part.
Maintenance::~Maintenance() {
  MaintenanceFlash& flash = around_.flash;
  flash.writes_left = static_cast<unsigned>(flash.in_flight.below(3));
  for (const Host* node : around_.nodes)
    around_.versions.disk(*node).calls_until_loss = flash.in_flight.below(12);
  try {
    worker_.finish_first();
  } catch (const update::PowerLoss&) {
  } catch (const Violation& violation) {
    host_.kernel().report(violation);
  }
  for (const Host* node : around_.nodes) around_.versions.disk(*node).calls_until_loss.reset();
  flash.writes_left.reset();
}

void Maintenance::start() {
  transaction_.emplace(read_journal(), host_.name());
  rest(around_.rests);
  if (around_.flash.version_order) carry_out_version_order();
  if (!transaction_->is_busy()) return;
  run(transaction_->resume(around_.versions.read(node_of(transaction_->update())), true));
}

Host& Maintenance::node_of(const update::Update& u) const {
  for (Host* node : around_.nodes) {
    if (node->name() == u.node) return *node;
  }
  throw Violation{"F6", "an update of no node: " + u.node};
}

void Maintenance::run(UpdateTransaction::Actions actions) {
  actions_.run(std::move(actions), [this](const UpdateAction& action) {
    host_.action_point();
    std::visit([this](const auto& a) { carry_out(a); }, action);
  });
}

void Maintenance::install(const std::string& file) {
  (transaction_->is_busy() ? answered_at_once_ : asked_) = file;
  run(transaction_->install(file, around_.flash.packages.of(file).activate));
  answered_at_once_.reset();
}

void Maintenance::cancel() {
  answered_at_once_ = "no package";
  run(transaction_->cancel());
  answered_at_once_.reset();
}

void Maintenance::use_version(const std::string& node, update::VersionNumber version) {
  around_.flash.version_order = MaintenanceFlash::VersionOrder{node, version};
  carry_out_version_order();
}

/// A telecommand: the next process carries it out again.
void Maintenance::carry_out_version_order() {
  update::Update wanted;
  wanted.node = around_.flash.version_order->node;
  wanted.version = around_.flash.version_order->version;
  wanted.probation = probation;
  const update::VersionTable table = around_.versions.read(node_of(wanted));
  if (const update::Version* const version = table.find(wanted.version))
    around_.flash.packages.on_use_ordered(version->origin);
  worker_.ask([this, wanted] { (void)swap(wanted); },
              [this, is_own = wanted.node == host_.name()] {
                around_.flash.version_order.reset();
                if (is_own) carry_out(EndOwnProcess{});
              });
}

void Maintenance::carry_out(const AnswerTelecommand& action) {
  const bool accepted = action.code == mission::failure::none;
  host_.trace(Lane::ground, accepted ? "installation accepted" : "installation refused", action.code);
  if (answered_at_once_) return around_.flash.packages.on_answer(*answered_at_once_, action.code);
  if (asked_) around_.flash.packages.on_answer(*asked_, action.code);
  asked_.reset();
}

void Maintenance::carry_out(const ReportRefusal& /*action*/) {}

void Maintenance::carry_out(const ReportUpdate& action) {
  host_.trace(Lane::ground, "update", static_cast<std::uint64_t>(action.update.step), action.update.counter);
  host_.kernel().coverage().note(StateTable::update, action.update.counter,
                                 static_cast<std::uint8_t>(action.update.step));
  around_.flash.packages.on_report(action.update);
}

// ---------------------------------------------------------------- the journal

update::UpdateJournal Maintenance::read_journal() const {
  update::UpdateJournal newest;
  for (const std::string& copy : around_.flash.journal) {
    auto journal = update::decode_update_journal(copy);
    if (journal && journal->revision() > newest.revision()) newest = std::move(*journal);
  }
  return newest;
}

/// Both copies, the older one first; each may fail by itself.
Result<void, std::string> Maintenance::write_journal(const update::UpdateJournal& journal) {
  MaintenanceFlash& flash = around_.flash;
  const auto revision_of = [](const std::string& copy) {
    const auto decoded = update::decode_update_journal(copy);
    return decoded ? decoded->revision() : 0;
  };
  const std::size_t older = revision_of(flash.journal[0]) > revision_of(flash.journal[1]) ? 1 : 0;
  bool all = true;
  for (const std::size_t i : {older, 1 - older}) {
    if (flash.writes_left && (*flash.writes_left)-- == 0) throw update::PowerLoss{};
    if (around_.disk.failing() && !flash.in_flight.one_in(3)) {
      all = false;
      continue;
    }
    flash.journal.at(i) = encode(journal);
  }
  if (!all) return Err(std::string("no space"));
  return {};
}

void Maintenance::carry_out(const WriteUpdateJournal& action) {
  const auto written = std::make_shared<Result<void, std::string>>();
  worker_.ask([this, journal = action.journal, written] { *written = write_journal(journal); },
              [this, answer = action.answer, written] {
                if (answer) run(transaction_->on_begun(*written));
              });
}

// ---------------------------------------------------------------- the steps

Result<Intake, IntakeFailure> Maintenance::take_in(const TakeInPackage& action) const {
  const PackageRecord::Package& package = around_.flash.packages.of(action.file);
  const std::string node = around_.nodes.at(package.node)->name();
  const std::string sha256 = hash_of(package);
  if (!package.sound) return Err(IntakeFailure{mission::failure::package_refused, "wrong signature"});
  if (package.counter <= action.journal.last_counter(node, sha256))
    return Err(IntakeFailure{mission::failure::package_refused, "an old package"});
  Intake intake;
  intake.update.file = action.file;
  intake.update.sha256 = sha256;
  intake.update.node = node;
  intake.update.counter = package.counter;
  intake.update.probation = probation;
  intake.manifest.node = node;
  intake.manifest.counter = package.counter;
  intake.manifest.probation = probation;
  return intake;
}

void Maintenance::carry_out(const TakeInPackage& action) {
  const auto taken = std::make_shared<std::optional<Result<Intake, IntakeFailure>>>();
  worker_.ask([this, action, taken] { *taken = take_in(action); },
              [this, taken] { run(transaction_->on_taken_in(std::move(**taken))); });
}

void Maintenance::run_lane(nanoseconds longest) {
  const auto number = ++lane_runs_;
  lane_stopped_ = false;
  const nanoseconds took = around_.flash.in_flight.between(milliseconds(200), longest);
  host_.later(took, [this, number] {
    if (number != lane_runs_ || lane_stopped_) return;
    const PackageRecord::Package& package = around_.flash.packages.of(transaction_->update().file);
    around_.versions.disk(*around_.nodes.at(package.node)).elsewhere[job_program] = to_text(package.program);
    const bool is_test = transaction_->update().step == update::UpdateStep::self_test;
    LaneEnd end;
    end.report.good = is_test ? package.passes_test : package.builds;
    if (!end.report.good) end.report.reason = is_test ? "self_test_failed" : "compiler_failed";
    run(transaction_->on_lane_ended(end));
  });
}

void Maintenance::carry_out(const BuildProgram& /*action*/) {
  around_.flash.packages.on_build(transaction_->update().file);
  run_lane(longest_build);
}

void Maintenance::carry_out(const TestProgram& /*action*/) {
  run_lane(longest_self_test);
}

void Maintenance::carry_out(const StopLane& /*action*/) {
  lane_stopped_ = true;
  host_.later(milliseconds(50), [this, number = lane_runs_] {
    if (number != lane_runs_) return;
    LaneEnd end;
    end.report.reason = "stopped";
    run(transaction_->on_lane_ended(end));
  });
}

Result<StoredProgram, std::string> Maintenance::store(const update::Update& u) {
  std::optional<update::Version> version;
  const auto stored =
      around_.versions.change(node_of(u), [&](update::VersionStore& versions) -> Result<void, std::string> {
        const auto number = versions.add(job_program, origin_of(u), UtcTime(seconds(1'795'000'000)));
        if (!number) return Err(number.error());
        const auto table = versions.read().table;
        if (const update::Version* found = table.find(*number)) version = *found;
        return {};
      });
  if (!stored) return Err(stored.error());
  if (!version) return Err(std::string("the version no longer exists"));
  return StoredProgram{version->number, version->octets};
}

void Maintenance::carry_out(const StoreProgram& action) {
  const auto stored = std::make_shared<std::optional<Result<StoredProgram, std::string>>>();
  worker_.ask([this, u = action.update, stored] { *stored = store(u); },
              [this, stored] { run(transaction_->on_stored(**stored)); });
}

/// As suite::use_version().
Maintenance::Swapped Maintenance::swap(const update::Update& u) {
  Host& node = node_of(u);
  Versions& versions = around_.versions;
  if (around_.is_locked(node)) return Err(std::string("another process restarts it"));
  const auto changed = versions.change(node, [&](update::VersionStore& store) -> Result<void, std::string> {
    const update::VersionTable table = store.read().table;
    if (const update::Version* wanted = table.find(u.version)) {
      if (const auto bad = store.damage(*wanted)) return Err(*bad);
    }
    return store.use(u.version, u.probation, "another version was requested");
  });
  if (!changed) return Err(changed.error());
  const bool runs_already = node.pid() != 0 && versions.running(node) == u.version;
  if (node.pid() == 0 || runs_already || &node == &host_ || !around_.powered)
    return std::optional<StartedProgram>();
  const MonotonicTime stopped = host_.now();
  const pid_t pid = around_.restart(node);
  return std::optional(StartedProgram{pid, versions.running(node), {}, stopped});
}

void Maintenance::carry_out(const SwapProgram& action) {
  around_.flash.packages.on_use(action.update.file);
  const auto swapped = std::make_shared<std::optional<Swapped>>();
  worker_.ask([this, u = action.update, swapped] { *swapped = swap(u); },
              [this, swapped] { run(transaction_->on_swapped(**swapped, host_.now())); });
}

void Maintenance::carry_out(const AwaitActive& action) {
  look(action);
}

void Maintenance::look(const AwaitActive& action) {
  host_.later(look_period, [this, action] {
    const Host& node = node_of(action.update);
    ProgramLook seen;
    seen.is_active = node.pid() == action.pid && node.runs();
    if (!seen.is_active) {
      const auto table = around_.versions.read(node);
      if (const update::Version* version = table.find(action.update.version)) {
        seen.version = version->state;
        seen.reason = version->reason;
      }
    }
    run(transaction_->on_look(seen, host_.now()));
    if (transaction_->is_looking()) look(action);
  });
}

void Maintenance::carry_out(const EndOwnProcess& /*action*/) {
  host_.later(own_end, [] { throw Host::Killed{}; });
}

void Maintenance::carry_out(const RemoveWorkFolder& /*action*/) {
  for (const Host* node : around_.nodes) around_.versions.disk(*node).elsewhere.clear();
}

}  // namespace srfs::simulation
