// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
// Carries out what the installation of uplinked packages decides (update_transaction.hpp; README.md:
// "Packages"). Each step runs on a worker or in a process of its own.
#include <algorithm>
#include <csignal>
#include <utility>

#include <fmt/format.h>
#include <sys/epoll.h>
#include <unistd.h>

#include <mission/structures.hpp>

#include "base/file.hpp"
#include "nodes/maintenance/maintenance_node.hpp"
#include "nodes/maintenance/report_downlink.hpp"
#include "nodes/maintenance/update_line.hpp"
#include "nodes/maintenance/version_rules.hpp"
#include "suite/launcher.hpp"
#include "suite/node_addition.hpp"
#include "suite/node_versions.hpp"
#include "suite/ring/heartbeat_page.hpp"

namespace srfs {
namespace {

constexpr auto longest_package_job = seconds(10);
constexpr auto longest_build =
    seconds(600);  // the lane has a limit of its own; this one is for a lane that hangs
constexpr auto beyond_self_test = seconds(30);
constexpr auto cancel_patience = seconds(5);
constexpr auto look_for_active = milliseconds(5);
constexpr auto between_reviews = seconds(2);
constexpr auto longest_wait_for_lock = seconds(3);
constexpr std::size_t longest_line = 200;
constexpr std::size_t largest_report = 64U << 10;
/// Waits for disks and locks, so it runs on the worker.
Result<StoredProgram, std::string> store(const suite::VarPaths& var, const update::Update& u,
                                         const std::filesystem::path& program) {
  std::optional<update::Version> version;
  const auto stored =
      suite::change_versions(var, u.node, [&](update::VersionStore& store) -> Result<void, std::string> {
        const auto number = store.add(program, origin_of(u), system_utc_now());
        if (!number) return Err(number.error());
        const auto table = store.read().table;
        if (const update::Version* found = table.find(*number)) version = *found;
        return {};
      });
  if (!stored) return Err(stored.error());
  if (!version) return Err(std::string("the version no longer exists"));
  return StoredProgram{version->number, version->octets};
}

using Swapped = Result<std::optional<StartedProgram>, std::string>;

Swapped swap(const update::Update& u, const suite::Deployment& deployment, const suite::VarPaths& var,
             const std::string& self) {
  const suite::NodeEntry* node = deployment.find(u.node);
  if (node == nullptr) return Err(std::string("the deployment has no such node"));
  const suite::LaunchRequest request{deployment, var, suite::suite_bin_folder(),
                                     fmt::format("version {} from {}", u.version, u.file)};
  const auto launched = suite::use_version(request, *node, u.version, u.probation, self);
  if (!launched) return Err(launched.error());
  if (!*launched) return std::optional<StartedProgram>();
  const suite::Launched& l = **launched;
  return std::optional(
      StartedProgram{l.pid, l.version, l.fallback ? suite::to_text(*l.fallback) : std::string(), l.stopped});
}

Swapped add(const AddProgram& action, const suite::Deployment& deployment, const suite::VarPaths& var) {
  const update::Update& u = action.update;
  const auto used = suite::change_versions(var, u.node, [&](update::VersionStore& store) {
    return store.use(u.version, u.probation, "another version was requested");
  });
  if (!used) return Err(used.error());
  if (const auto added =
          suite::add_node(var, deployment, suite::added_node_of(action.manifest, action.dictionary));
      !added)
    return Err(added.error());
  const auto reading = suite::load_deployment(deployment.file, var);
  const suite::NodeEntry* entry = reading.deployment.find(u.node);
  if (entry == nullptr) return Err(std::string("it is not in the list of added nodes"));
  const auto pid = suite::launch({reading.deployment, var, suite::suite_bin_folder(), "added by a package"},
                                 *entry, longest_wait_for_lock);
  if (!pid) return Err(pid.error());
  return std::optional(StartedProgram{*pid, u.version, {}, monotonic_now()});
}

}  // namespace

void MaintenanceNode::open_packages() {
  package_worker_ =
      create_worker("packages", 8, std::max<milliseconds>(worker_deadline(), longest_package_job));
  auto journal = update::update_journal_file(state_dir()).load().state;
  transaction_.emplace(journal ? std::move(*journal) : update::UpdateJournal{}, name());
  run(transaction_->rest(!mode_reaction().work));
  resume_pending_ = true;
  reviewing_added_ = create_timer(
      between_reviews, [this] { review_added_nodes(); }, "added nodes");
}

/// What is not done stays in the journal; the lane dies with its handle.
void MaintenanceNode::close_packages() {
  reviewing_added_.reset();
  if (transaction_) transaction_->stop();
  if (package_worker_) package_worker_->drain();
  awaiting_active_.reset();
  lane_.reset();
  package_worker_.reset();
  update_actions_.clear();
  transaction_.reset();
}

LaneFolders MaintenanceNode::lane_folders() const {
  const auto bin = suite::suite_bin_folder();
  const auto var_folder = std::filesystem::absolute(var().root);
  LaneFolders folders{bin / "srfs-lane",
                      bin.parent_path(),
                      var_folder / "update" / "job",
                      var_folder / "update" / "lane",
                      {}};
  if (const auto structures = deployment().dictionary / "structures";
      !deployment().dictionary.empty() && std::filesystem::exists(structures / "mission/structures.cpp"))
    folders.structures = structures;
  const auto line = deployment().devices.find("rs422");
  if (line != deployment().devices.end() && suite::is_hardware_line(line->second, var_folder))
    folders.required = {"user", "files", "processes", "network", "system_calls", "limits"};
  return folders;
}

IntakeRules MaintenanceNode::intake_rules() const {
  IntakeRules rules{var().root / "files", var().root / "keys" / "package.pub", {}, deployment().ring};
  for (const suite::NodeEntry& node : deployment().nodes) rules.nodes.push_back(node.name);
  return rules;
}

/// After a start of this process.
void MaintenanceNode::resume_update() {
  if (!std::exchange(resume_pending_, false) || !transaction_->is_busy()) return;
  const std::string node = transaction_->update().node;
  log::warn("resuming the update of {} from {}", node, transaction_->update().file);
  run(transaction_->resume(suite::read_versions(var(), node).table, deployment().find(node) != nullptr));
}

// ---------------------------------------------------------------- begin, end

void MaintenanceNode::carry_out(const TakeInPackage& action) {
  const bool taken = package_worker_->ask(
      [action, rules = intake_rules(), folders = lane_folders()] {
        return take_in_package(rules, action.file, action.journal, folders);
      },
      [this](auto intake) { run(transaction_->on_taken_in(std::move(intake))); });
  if (!taken)
    run(transaction_->on_taken_in(Err(IntakeFailure{mission::failure::queue_full, "the worker is busy"})));
}

void MaintenanceNode::carry_out(const WriteUpdateJournal& action) {
  const bool taken = package_worker_->ask(
      [action, state = state_dir()]() -> Result<void, std::string> {
        const auto stored = update::update_journal_file(state).store(action.journal);
        if (stored.problem.empty()) return {};
        log::error("update journal: {}", stored.problem);
        return Err(stored.problem);
      },
      [this, answer = action.answer](const Result<void, std::string>& written) {
        if (answer) run(transaction_->on_begun(written));
      });
  if (taken) return;
  log::warn("update journal not written: the worker is busy");
  if (action.answer) run(transaction_->on_begun(Err(std::string("the worker is busy"))));
}

void MaintenanceNode::carry_out(const RemoveWorkFolder& /*action*/) {
  (void)package_worker_->post([work = lane_folders().work] {
    std::error_code ec;
    std::filesystem::remove_all(work, ec);
  });
}

void MaintenanceNode::carry_out(const ReportRefusal& action) {
  log::error("package refused: {}", action.reason);
  raise(mission::UpdateRefusedEvent{.file = action.file,
                                    .reason = action.reason.substr(0, longest_update_text)});
}

void MaintenanceNode::carry_out(const ReportUpdate& action) {
  const UpdateNews news = news_of(action.update);
  if (news.is_bad) {
    log::error("{}", news.line);
  } else {
    log::info("{}", news.line);
  }
  raise_event(news.event.id, news.event.severity, news.event.data);
}

// ---------------------------------------------------------------- the steps

void MaintenanceNode::carry_out(const BuildProgram& action) {
  run_lane(build_command(lane_folders(), action.manifest), longest_build);
}

void MaintenanceNode::carry_out(const TestProgram& action) {
  if (const auto problem = describe_new_node(action)) {
    run(transaction_->on_lane_ended({LaneEnd::How::not_started, {}, *problem}));
    return;
  }
  run_lane(self_test_command(lane_folders(), action.manifest, deployment().file),
           action.manifest.self_test + beyond_self_test);
}

/// Writes the list of added nodes that a new node's self-test reads. @return why it cannot be
std::optional<std::string> MaintenanceNode::describe_new_node(const TestProgram& action) const {
  if (action.manifest.kind != update::PackageKind::add) return std::nullopt;
  suite::AddedNode node = suite::added_node_of(action.manifest, action.dictionary);
  if (!node.slot.empty()) node.flag = deployment().buses.front().slots.size();
  const suite::AddedNodes list{1, {std::move(node)}};
  const auto written = write_file_atomically(lane_folders().added_nodes(), to_text(list));
  return written ? std::nullopt : std::optional(written.error().message);
}

void MaintenanceNode::carry_out(const StoreProgram& action) {
  const bool taken = package_worker_->ask(
      [u = action.update, var = var(), program = lane_folders().built(action.update.node)] {
        return store(var, u, program);
      },
      [this](const Result<StoredProgram, std::string>& stored) { run(transaction_->on_stored(stored)); });
  if (!taken) run(transaction_->on_stored(Err(std::string("the worker is busy"))));
}

void MaintenanceNode::carry_out(const SwapProgram& action) {
  swap_on_worker([u = action.update, deployment = deployment(), var = var(), self = name()] {
    return swap(u, deployment, var, self);
  });
}

void MaintenanceNode::carry_out(const AddProgram& action) {
  swap_on_worker([action, deployment = deployment(), var = var()] { return add(action, deployment, var); });
}

void MaintenanceNode::swap_on_worker(std::function<Swapped()> job) {
  const bool taken = package_worker_->ask(
      std::move(job), [this](const Swapped& swapped) { run(transaction_->on_swapped(swapped, now())); });
  if (!taken) run(transaction_->on_swapped(Err(std::string("the worker is busy")), now()));
}

void MaintenanceNode::carry_out(const AwaitActive& action) {
  awaiting_active_ = create_timer(
      look_for_active,
      [this, action] {
        ProgramLook look;
        const auto page = suite::HeartbeatPage::read(var(), action.update.node);
        look.is_active = page && page->pid == action.pid && page->state != 0 && page->state == page->desired;
        const MonotonicTime seen = monotonic_now();
        if (!look.is_active) {
          const auto table = suite::read_versions(var(), action.update.node).table;
          if (const update::Version* version = table.find(action.update.version)) {
            look.version = version->state;
            look.reason = version->reason;
          }
        }
        run(transaction_->on_look(look, seen));
        if (!transaction_->is_looking()) awaiting_active_.reset();
      },
      "new version");
}

// ---------------------------------------------------------------- added nodes

void MaintenanceNode::review_added_nodes() {
  for (const suite::NodeEntry& node : deployment().nodes) {
    if (!node.added || transaction_->is_busy()) continue;
    const auto reason = why_removed(suite::read_versions(var(), node.name).table);
    if (!reason) continue;
    log::error("removing {}: {}", node.name, *reason);
    (void)package_worker_->post(
        [var = var(), node = node.name] { (void)suite::remove_node(var, node); },
        [this, node = node.name, reason = *reason] {
          raise(mission::UpdateRemovedEvent{.node = node, .reason = reason.substr(0, longest_update_text)});
        });
    return;  // one at a time: the list changes
  }
}

// ---------------------------------------------------------------- the build lane

void MaintenanceNode::run_lane(const std::vector<std::string>& command, milliseconds patience) {
  std::error_code ec;
  std::filesystem::remove(lane_folders().report(), ec);
  auto with_caller = command;
  with_caller.push_back(fmt::format("--caller={}", getpid()));
  auto child = ChildProcess::start(with_caller);
  if (!child) {
    run(transaction_->on_lane_ended(
        {LaneEnd::How::not_started, {}, "cannot start the build lane: " + child.error()}));
    return;
  }
  lane_.emplace(Lane{std::move(*child), {}, {}, {}, {}, false});
  lane_->output = watch_fd(
      lane_->child.output(), EPOLLIN, [this](std::uint32_t) { read_lane_output(); }, "lane");
  lane_->ended = watch_fd(
      lane_->child.process().fd(), EPOLLIN, [this](std::uint32_t) { on_lane_end(); }, "lane");
  lane_->deadline = create_one_shot(
      now() + patience,
      [this] {
        lane_->late = true;
        lane_->child.process().signal(SIGKILL);
      },
      "lane");
}

/// Its progress goes into the log, line by line; a long line is cut.
void MaintenanceNode::read_lane_output() {
  char buffer[4096];
  const ssize_t n = read(lane_->child.output(), buffer, sizeof buffer);
  if (n == 0) lane_->output.reset();
  for (ssize_t i = 0; i < n; ++i) {
    if (buffer[i] != '\n') {
      if (lane_->line.size() < longest_line) lane_->line += buffer[i];
      continue;
    }
    log::info("lane: {}", lane_->line);
    lane_->line.clear();
  }
}

void MaintenanceNode::on_lane_end() {
  const auto end = lane_->child.take_end();
  if (!end) return;
  LaneEnd ended;
  if (lane_->late) {
    ended.how = LaneEnd::How::hung;
  } else {
    const auto text = read_file(lane_folders().report(), largest_report);
    ended.report = read_lane_report(text ? *text : std::string(), to_text(*end));
  }
  lane_.reset();
  run(transaction_->on_lane_ended(ended));
}

void MaintenanceNode::carry_out(const StopLane& /*action*/) {
  if (!lane_) return;  // it could not be started
  lane_->child.process().signal(SIGTERM);
  lane_->deadline = create_one_shot(
      now() + cancel_patience, [this] { lane_->child.process().signal(SIGKILL); }, "lane");
}

void MaintenanceNode::carry_out(const SendLaneLog& action) {
  const update::Update& u = action.update;
  (void)package_worker_->ask(
      [root = var().root, source = lane_folders().log(),
       as = fmt::format("{}_package_{}_{}", u.node, u.counter, to_text(u.step))] {
        auto queued = queue_report(root / "files" / "outbox", as, source);
        if (!queued) log::warn("cannot queue the build lane's log for downlink: {}", queued.error().text);
        return queued;
      },
      [this](const auto& queued) {
        if (!queued) return;
        raise(mission::UpdateLogQueuedEvent{.name = queued->name,
                                            .octets = static_cast<std::uint32_t>(queued->octets)});
      });
}

}  // namespace srfs
