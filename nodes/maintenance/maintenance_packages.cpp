// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
// The installation of uplinked packages (README.md: "Packages"): verify, build, self-test, store, swap. Each
// step runs on a worker or in a process of its own; the journal and the table of versions say where it
// stands, so that it goes on wherever maintenance or the computer ended.
#include <algorithm>
#include <csignal>
#include <utility>

#include <fmt/format.h>
#include <sys/epoll.h>
#include <unistd.h>

#include "base/file.hpp"
#include "nodes/maintenance/maintenance_node.hpp"
#include "nodes/maintenance/report_downlink.hpp"
#include "ros/launcher.hpp"
#include "ros/node_addition.hpp"
#include "ros/node_versions.hpp"
#include "ros/ring/heartbeat_page.hpp"

namespace srfs {
namespace {

using update::UpdateStep;

constexpr auto longest_package_job = seconds(10);
constexpr auto longest_build =
    seconds(600);  // the lane has a limit of its own; this one is for a lane that hangs
constexpr auto beyond_self_test = seconds(30);
constexpr auto cancel_patience = seconds(5);
constexpr auto look_for_active = milliseconds(5);
constexpr auto longest_wait_for_active = seconds(10);
constexpr auto before_own_end = seconds(1);
constexpr auto between_reviews = seconds(2);
constexpr auto longest_wait_for_lock = seconds(3);
constexpr std::size_t longest_event_text = 120;
constexpr std::size_t longest_line = 200;
constexpr std::size_t largest_report = 64U << 10;
constexpr std::uint32_t unknown_ms = UINT32_MAX;

std::uint32_t to_ms(const std::optional<milliseconds>& value) {
  return value ? static_cast<std::uint32_t>(std::clamp<std::int64_t>(value->count(), 0, UINT32_MAX - 1))
               : unknown_ms;
}

mission::UpdateStep to_mission(UpdateStep step) {
  return static_cast<mission::UpdateStep>(step);
}

}  // namespace

void MaintenanceNode::open_packages() {
  package_worker_ =
      create_worker("packages", 4, std::max<milliseconds>(worker_deadline(), longest_package_job));
  auto [journal, problem] = update::read_update_journal(state_dir());
  if (!problem.empty()) log::error("update journal: {}", problem);
  updates_ = std::move(journal);
  packages_open_ = true;
  resume_pending_ = true;
  reviewing_added_ = create_timer(
      between_reviews, [this] { review_added_nodes(); }, "added nodes");
}

/// What is not done stays in the journal; the lane dies with its handle.
void MaintenanceNode::close_packages() {
  packages_open_ = false;
  reviewing_added_.reset();
  if (package_worker_) package_worker_->drain();  // what a step that ends now would begin is left
  awaiting_active_.reset();
  lane_.reset();
  taking_in_ = false;
  package_worker_.reset();
}

LaneFolders MaintenanceNode::lane_folders() const {
  const auto bin = ros::suite_bin_folder();
  return {bin / "srfs-lane", bin.parent_path(), std::filesystem::absolute(var().root) / "update" / "job",
          std::filesystem::absolute(var().root) / "update" / "lane"};
}

IntakeRules MaintenanceNode::intake_rules() const {
  IntakeRules rules{var().root / "files", var().root / "keys" / "package.pub", {}};
  for (const ros::NodeEntry& node : deployment().nodes) rules.nodes.push_back(node.name);
  return rules;
}

// ---------------------------------------------------------------- begin, end

void MaintenanceNode::install_package(const std::string& file, bool activate) {
  const update::Update& now = updates_.update();
  const bool busy = taking_in_ || updates_.is_under_way();
  if (busy) {
    // The same telecommand again, after this process was restarted: it goes on already.
    finished(now.file == file && !taking_in_ ? FailureCode::none : FailureCode::update_under_way);
    return;
  }
  struct Outcome {
    std::optional<update::UpdateJournal> journal;
    Intake intake;
    IntakeFailure failure;
  };
  auto outcome = std::make_shared<Outcome>();
  const bool taken = package_worker_->post(
      [outcome, file, activate, journal = updates_, rules = intake_rules(), folders = lane_folders(),
       state = state_dir(), ring = deployment().ring]() mutable {
        auto intake = take_in_package(rules, file, journal, folders);
        if (!intake) {
          outcome->failure = intake.error();
          return;
        }
        intake->update.activate = activate;
        // Of those that the operator has to confirm the package cannot shorten the time for it.
        if (ros::needs_confirmation(ring, intake->update.node))
          intake->update.probation =
              std::max(intake->update.probation,
                       std::chrono::ceil<seconds>(ros::default_probation(ring, intake->update.node)));
        if (!journal.begin(intake->update)) {
          outcome->failure.reason = "too many nodes in the update journal";
          return;
        }
        if (const auto written = update::write_update_journal(state, journal); !written) {
          outcome->failure.reason = written.error().message;
          return;
        }
        outcome->intake = std::move(*intake);
        outcome->journal = std::move(journal);
      },
      [this, outcome, file] {
        taking_in_ = false;
        if (!outcome->journal) {
          log::error("package refused: {}", outcome->failure.reason);
          mission::UpdateRefusedEvent event;
          event.file = file;
          event.reason = outcome->failure.reason.substr(0, longest_event_text);
          raise(event);
          finished(outcome->failure.not_found ? FailureCode::package_not_found
                                              : FailureCode::package_refused);
          return;
        }
        updates_ = std::move(*outcome->journal);
        manifest_ = std::move(outcome->intake.manifest);
        dictionary_ = std::move(outcome->intake.dictionary);
        finished(FailureCode::none);
        go_on();
      });
  taking_in_ = taken;
  if (!taken) finished(FailureCode::queue_full);
}

/// After a start of this process: what it left.
void MaintenanceNode::resume_update() {
  if (!std::exchange(resume_pending_, false) || !updates_.is_under_way()) return;
  const std::string node = updates_.update().node;
  updates_.resume(ros::read_versions(var(), node).table);
  const bool has_joined = deployment().find(node) != nullptr;
  if (updates_.update().step == UpdateStep::installed && !has_joined) updates_.set(UpdateStep::swap);
  log::warn("resuming the update of {} from {}: {} {}", node, updates_.update().file,
            to_text(updates_.update().step), updates_.update().reason);
  save_updates();
  if (!updates_.is_under_way()) {
    announce();
    return;
  }
  // The description of a new node is in its package.
  if (updates_.update().step == UpdateStep::swap && updates_.update().kind == update::PackageKind::replace) {
    go_on();
    return;
  }
  auto intake = std::make_shared<Result<Intake, IntakeFailure>>(Err(IntakeFailure{}));
  taking_in_ = package_worker_->post(
      [intake, journal = updates_, rules = intake_rules(), folders = lane_folders()] {
        *intake = take_in_package(rules, journal.update().file, journal, folders);
      },
      [this, intake] {
        taking_in_ = false;
        if (!*intake) {
          end_update(UpdateStep::failed, (*intake).error().reason);
        } else if ((*intake)->update.sha256 != updates_.update().sha256) {
          end_update(UpdateStep::failed, "the package has changed");
        } else {
          manifest_ = (*intake)->manifest;
          dictionary_ = (*intake)->dictionary;
          go_on();
        }
      });
}

FailureCode MaintenanceNode::cancel_update() {
  if (!lane_) return FailureCode::no_update;
  lane_->cancelled = true;
  lane_->child.process().signal(SIGTERM);
  lane_->deadline = create_one_shot(
      now() + cancel_patience, [this] { lane_->child.process().signal(SIGKILL); }, "lane");
  return FailureCode::none;
}

void MaintenanceNode::end_update(UpdateStep step, const std::string& reason) {
  updates_.end(step, reason);
  save_updates();
  (void)package_worker_->post([work = lane_folders().work] {
    std::error_code ec;
    std::filesystem::remove_all(work, ec);
  });
  announce();
}

/// An event for where the update is now.
void MaintenanceNode::announce() {
  const update::Update& u = updates_.update();
  switch (u.step) {
    case UpdateStep::installed: {
      log::info("{} runs version {} from {}, outage {} ms", u.node, u.version, u.file,
                u.outage ? u.outage->count() : -1);
      mission::UpdateInstalledEvent event;
      event.file = u.file;
      event.node = u.node;
      event.version = u.version;
      event.probation_s = static_cast<std::uint32_t>(u.probation.count());
      event.outage_ms = to_ms(u.outage);
      raise(event);
      break;
    }
    case UpdateStep::candidate: {
      log::info("version {} of {} from {} is a candidate", u.version, u.node, u.file);
      mission::UpdateCandidateEvent event;
      event.file = u.file;
      event.node = u.node;
      event.version = u.version;
      raise(event);
      break;
    }
    case UpdateStep::failed:
    case UpdateStep::cancelled: {
      log::error("update of {} from {} {} in {}: {}", u.node, u.file, to_text(u.step), to_text(u.ended_in),
                 u.reason);
      mission::UpdateFailedEvent event;
      event.file = u.file;
      event.step = to_mission(u.ended_in);
      event.reason = u.reason.substr(0, longest_event_text);
      raise(event);
      break;
    }
    default: {
      log::info("update of {} from {}: {}", u.node, u.file, to_text(u.step));
      mission::UpdateStepEvent event;
      event.file = u.file;
      event.step = to_mission(u.step);
      raise(event);
    }
  }
}

/// Where it stands is for people; what a restart needs is written by the steps themselves.
void MaintenanceNode::save_updates() {
  const bool taken = package_worker_->post([journal = updates_, state = state_dir()] {
    if (const auto written = update::write_update_journal(state, journal); !written)
      log::error("update journal: {}", written.error().message);
  });
  if (!taken) log::warn("update journal not written: the worker is busy");
}

mission::UpdateStatusHousekeeping MaintenanceNode::update_status() const {
  const update::Update& u = updates_.update();
  mission::UpdateStatusHousekeeping status;
  status.file = u.file.substr(0, 60);
  status.node = u.node.substr(0, 32);
  status.counter = u.counter;
  status.step = to_mission(u.step);
  status.failed_in = to_mission(u.ended_in);
  status.version = u.version;
  status.octets = static_cast<std::uint32_t>(u.octets);
  status.program_octets = static_cast<std::uint32_t>(std::min<std::uint64_t>(u.program_octets, UINT32_MAX));
  status.build_ms = to_ms(u.build);
  status.outage_ms = to_ms(u.outage);
  status.starts = static_cast<std::uint8_t>(std::min<std::uint32_t>(u.starts, UINT8_MAX));
  status.reason = u.reason.substr(0, 60);
  return status;
}

// ---------------------------------------------------------------- the steps

void MaintenanceNode::go_on() {
  if (!packages_open_) return;
  announce();
  switch (updates_.update().step) {
    case UpdateStep::build:
      run_lane(build_command(lane_folders(), manifest_), longest_build,
               [this](const LaneReport& report) { on_built(report); });
      break;
    case UpdateStep::self_test:
      if (const auto problem = describe_new_node()) {
        end_update(UpdateStep::failed, *problem);
        break;
      }
      run_lane(self_test_command(lane_folders(), manifest_, deployment().file),
               manifest_.self_test + beyond_self_test,
               [this](const LaneReport& report) { on_tested(report); });
      break;
    case UpdateStep::store:
      store_program();
      break;
    case UpdateStep::swap:
      if (updates_.update().kind == update::PackageKind::add) {
        add_program();
      } else {
        swap_program();
      }
      break;
    default:
      break;
  }
}

void MaintenanceNode::on_built(const LaneReport& report) {
  send_lane_log();
  updates_.built(milliseconds(report.took_ms));
  if (!report.good) {
    end_update(UpdateStep::failed, report.reason);
    return;
  }
  if (manifest_.binary_sha256 && *manifest_.binary_sha256 != report.program_sha256) {
    end_update(UpdateStep::failed, "the program differs from the ground build");
    return;
  }
  updates_.set(UpdateStep::self_test);
  save_updates();
  go_on();
}

void MaintenanceNode::on_tested(const LaneReport& report) {
  if (!report.good) {
    send_lane_log();
    end_update(UpdateStep::failed, report.reason);
    return;
  }
  updates_.set(UpdateStep::store);
  save_updates();
  go_on();
}

void MaintenanceNode::store_program() {
  struct Outcome {
    update::UpdateJournal journal;
    std::string problem;
  };
  auto outcome = std::make_shared<Outcome>(Outcome{updates_, {}});
  const bool taken = package_worker_->post(
      [outcome, var = var(), folders = lane_folders(), state = state_dir()] {
        const update::Update& u = outcome->journal.update();
        std::optional<update::Version> version;
        const auto stored =
            ros::change_versions(var, u.node, [&](update::VersionStore& store) -> Result<void, std::string> {
              const auto number = store.add(folders.built(u.node), origin_of(u), system_utc_now());
              if (!number) return Err(number.error());
              const auto table = store.read().table;
              if (const update::Version* found = table.find(*number)) version = *found;
              return {};
            });
        if (!stored || !version) {
          outcome->problem = stored ? "the version no longer exists" : stored.error();
          return;
        }
        outcome->journal.stored(version->number, version->octets);
        outcome->journal.set(u.activate ? UpdateStep::swap : UpdateStep::candidate);
        if (const auto written = update::write_update_journal(state, outcome->journal); !written)
          log::error("update journal: {}", written.error().message);
        std::error_code ec;
        std::filesystem::remove_all(folders.work, ec);
      },
      [this, outcome] {
        updates_ = std::move(outcome->journal);
        if (!outcome->problem.empty()) {
          end_update(UpdateStep::failed, outcome->problem);
        } else {
          go_on();
        }
      });
  if (!taken) end_update(UpdateStep::failed, "the worker is busy");
}

using Swapped = Result<std::optional<ros::Launched>, std::string>;

void MaintenanceNode::swap_program() {
  auto swapped = std::make_shared<Swapped>(Err(std::string()));
  const bool taken = package_worker_->post(
      [swapped, u = updates_.update(), deployment = deployment(), var = var(), self = name()] {
        const ros::NodeEntry* node = deployment.find(u.node);
        if (node == nullptr) {
          *swapped = Err(std::string("the deployment has no such node"));
          return;
        }
        const ros::LaunchRequest request{deployment, var, ros::suite_bin_folder(),
                                         fmt::format("version {} from {}", u.version, u.file)};
        *swapped = ros::use_version(request, *node, u.version, u.probation, self);
      },
      [this, swapped] { on_swapped(*swapped); });
  if (!taken) end_update(UpdateStep::failed, "the worker is busy");
}

/// A node that was not there: its program becomes the active version, then it joins the suite, then it is
/// started. Each may be done already.
void MaintenanceNode::add_program() {
  auto swapped = std::make_shared<Swapped>(Err(std::string()));
  const bool taken = package_worker_->post(
      [swapped, u = updates_.update(), node = ros::added_node_of(manifest_, dictionary_),
       deployment = deployment(), var = var()] {
        const auto used = ros::change_versions(var, u.node, [&](update::VersionStore& store) {
          return store.use(u.version, u.probation, "another version was requested");
        });
        const auto added = used ? ros::add_node(var, deployment, node) : used;
        if (!added) {
          *swapped = Err(added.error());
          return;
        }
        const auto reading = ros::load_deployment(deployment.file, var);
        const ros::NodeEntry* entry = reading.deployment.find(u.node);
        const auto pid =
            entry == nullptr
                ? Result<pid_t, std::string>(Err(std::string("it is not in the list of added nodes")))
                : ros::launch({reading.deployment, var, ros::suite_bin_folder(), "added by a package"},
                              *entry, longest_wait_for_lock);
        if (!pid) {
          *swapped = Err(pid.error());
          return;
        }
        ros::Launched launched;
        launched.pid = *pid;
        launched.version = u.version;
        launched.stopped = monotonic_now();
        *swapped = std::optional(launched);
      },
      [this, swapped] { on_swapped(*swapped); });
  if (!taken) end_update(UpdateStep::failed, "the worker is busy");
}

void MaintenanceNode::on_swapped(const Swapped& swapped) {
  const update::Update& u = updates_.update();
  if (!swapped) {
    end_update(UpdateStep::failed, swapped.error());
  } else if (u.node == name()) {
    own_end_ = create_one_shot(
        now() + before_own_end,
        [] {
          log::info("exiting so that the ring starts the other version");
          kill(getpid(), SIGTERM);
        },
        "own end");
  } else if (!*swapped) {
    updates_.installed(std::nullopt);  // the node does not run now
    save_updates();
    announce();
  } else if ((*swapped)->version != u.version) {
    end_update(UpdateStep::failed, (*swapped)->fallback ? ros::to_text(*(*swapped)->fallback)
                                                        : std::string("another version was started"));
  } else {
    await_active((*swapped)->pid, (*swapped)->stopped);
  }
}

/// Writes the list of added nodes that a new node's self-test reads. @return why it cannot be
std::optional<std::string> MaintenanceNode::describe_new_node() const {
  if (manifest_.kind != update::PackageKind::add) return std::nullopt;
  ros::AddedNode node = ros::added_node_of(manifest_, dictionary_);
  if (!node.slot.empty()) node.flag = deployment().slots.size();
  const ros::AddedNodes list{1, {std::move(node)}};
  const auto written = write_file_atomically(lane_folders().added_nodes(), to_text(list));
  return written ? std::nullopt : std::optional(written.error().message);
}

/// An added node has no golden version: one whose last version failed leaves the suite again.
void MaintenanceNode::review_added_nodes() {
  for (const ros::NodeEntry& node : deployment().nodes) {
    if (!node.added || updates_.is_under_way()) continue;
    const auto table = ros::read_versions(var(), node.name).table;
    if (table.active() != update::golden) continue;
    const std::string reason =
        table.versions().empty() ? "no version left" : "rolled back: " + table.versions().back().reason;
    log::error("removing {}: {}", node.name, reason);
    (void)package_worker_->post([var = var(), node = node.name] { (void)ros::remove_node(var, node); },
                                [this, node = node.name, reason] {
                                  mission::UpdateRemovedEvent event;
                                  event.node = node;
                                  event.reason = reason.substr(0, longest_event_text);
                                  raise(event);
                                });
    return;  // one at a time: the list changes
  }
}

void MaintenanceNode::remove_node(const std::string& node) {
  const ros::NodeEntry* entry = deployment().find(node);
  if (entry != nullptr && !entry->added) {
    finished(FailureCode::not_added);
    return;
  }
  run([var = var(), node] {
    const auto removed = ros::remove_node(var, node);
    if (!removed) log::error("{}", removed.error());
    return removed ? FailureCode::none : FailureCode::not_done;
  });
}

void MaintenanceNode::await_active(pid_t pid, MonotonicTime stopped) {
  const MonotonicTime give_up = now() + longest_wait_for_active;
  awaiting_active_ = create_timer(
      look_for_active,
      [this, pid, stopped, give_up] {
        const update::Update& u = updates_.update();
        const auto page = ros::HeartbeatPage::read(var(), u.node);
        const bool is_new = page && page->pid == pid;
        if (is_new && page->state != 0 && page->state == page->desired) {
          updates_.installed(std::chrono::ceil<milliseconds>(monotonic_now() - stopped));
        } else {
          const auto table = ros::read_versions(var(), u.node).table;
          const update::Version* version = table.find(u.version);
          if (version == nullptr || version->state == update::VersionState::failed) {
            updates_.end(UpdateStep::failed,
                         version == nullptr ? "the version no longer exists" : version->reason);
          } else if (now() < give_up) {
            return;
          } else {
            updates_.installed(std::nullopt);  // the ring judges it from here
          }
        }
        awaiting_active_.reset();
        save_updates();
        announce();
      },
      "new version");
}

// ---------------------------------------------------------------- the build lane

void MaintenanceNode::run_lane(const std::vector<std::string>& command, milliseconds patience,
                               std::function<void(const LaneReport&)> done) {
  std::error_code ec;
  std::filesystem::remove(lane_folders().report(), ec);
  auto with_caller = command;
  with_caller.push_back(fmt::format("--caller={}", getpid()));
  auto child = ChildProcess::start(with_caller);
  if (!child) {
    end_update(UpdateStep::failed, "cannot start the build lane: " + child.error());
    return;
  }
  lane_.emplace(Lane{std::move(*child), {}, {}, {}, {}, false, false, std::move(done)});
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
  Lane lane = std::move(*lane_);
  lane_.reset();
  if (lane.cancelled) {
    end_update(UpdateStep::cancelled, "by telecommand");
  } else if (lane.late) {
    end_update(UpdateStep::failed, "the build lane hung and was killed");
  } else {
    const auto text = read_file(lane_folders().report(), largest_report);
    lane.done(read_lane_report(text ? *text : std::string(), to_text(*end)));
  }
}

void MaintenanceNode::send_lane_log() {
  struct Outcome {
    std::optional<QueuedReport> queued;
  };
  const update::Update& u = updates_.update();
  auto outcome = std::make_shared<Outcome>();
  (void)package_worker_->post(
      [outcome, root = var().root, source = lane_folders().log(),
       as = fmt::format("{}_package_{}_{}", u.node, u.counter, to_text(u.step))] {
        auto queued = queue_report(root / "files" / "outbox", as, source);
        if (queued) {
          outcome->queued = std::move(*queued);
        } else {
          log::warn("cannot queue the build lane's log for downlink: {}", queued.error().text);
        }
      },
      [this, outcome] {
        if (!outcome->queued) return;
        mission::UpdateLogQueuedEvent event;
        event.name = outcome->queued->name;
        event.octets = static_cast<std::uint32_t>(outcome->queued->octets);
        raise(event);
      });
}

}  // namespace srfs
