// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "programs/srfs/suite.hpp"

#include <algorithm>
#include <csignal>
#include <cstdlib>
#include <map>

#include <fcntl.h>
#include <fmt/format.h>
#include <poll.h>
#include <sys/file.h>
#include <unistd.h>
#include <srfs_msgs/srv/get_node_status.hpp>

#include "base/file.hpp"
#include "base/private_file.hpp"
#include "base/process.hpp"
#include "hw/open.hpp"
#include "hw/watchdog.hpp"
#include "programs/srfs/bus.hpp"
#include "programs/srfs/process_cpu.hpp"
#include "programs/srfs/start.hpp"
#include "programs/srfs/state_questions.hpp"
#include "suite/command_keys.hpp"
#include "suite/departures.hpp"
#include "suite/launcher.hpp"
#include "suite/node_processes.hpp"
#include "suite/set_aside.hpp"

namespace srfs::tool {
namespace {

std::vector<NodeStatus> local_status(const Target& target) {
  std::vector<NodeStatus> all;
  for (const auto& node : target.deployment.nodes) {
    NodeStatus s;
    s.name = node.name;
    s.instance = suite::find_instance(target.var, node.name);
    s.starts = suite::read_start_record(target.var, node.name);
    if (s.instance) s.state = "not answering";
    all.push_back(s);
  }
  return all;
}

/// The domain of the suite that runs in VAR, or a fresh one held for it. @param running one of its nodes does
Result<std::shared_ptr<suite::DomainLock>, std::string> take_domain(const Target& target,
                                                                    const UpOptions& options, bool running) {
  if (const auto made = target.var.make_run_folder(); !made) return Err(made.error());
  const auto old = running_domain(target);
  const std::string suite = target.var.root.string();
  std::shared_ptr<suite::DomainLock> held = options.held_domain;
  if (!held) {
    auto lock = running && old
                    ? suite::DomainLock::share(*old, suite)
                    : suite::DomainLock::allocate(options.domain ? options.domain : target.deployment.domain,
                                                  suite::DomainLock::first_domain, suite);
    if (!lock) return Err(lock.error());
    held = std::make_shared<suite::DomainLock>(std::move(*lock));
  }
  if (const auto written =
          write_file_atomically(target.var.domain_file(), fmt::format("{}\n", held->domain()));
      !written) {
    return Err(written.error().message);
  }
  // What a restart by any node gives its node, too.
  if (const auto written =
          write_file_atomically(target.var.environment_file(), suite::environment_for_nodes());
      !written) {
    return Err(written.error().message);
  }
  held->downgrade();
  return held;
}

/// One `up` or `down` of a deployment at a time: the second waits for the first. No file is left behind: the
/// lock is on the folder of locks itself, which others cannot open.
Fd lock_suite(const Target& target) {
  target.var.make_run_folder();
  Fd folder(open(target.var.run().c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC));
  if (folder) flock(folder.get(), LOCK_EX);
  return folder;
}

using suite::NodeProcess;

/// Every process that runs as a node of this suite, the last of the list first, whether it holds its lock or
/// not.
std::vector<NodeProcess> processes_of(const Target& target) {
  std::map<std::string, std::vector<Process>> found;
  for (NodeProcess& one : suite::node_processes(target.var.root))
    found[one.node].push_back(std::move(one.process));
  std::vector<NodeProcess> running;
  for (auto node = target.deployment.nodes.rbegin(); node != target.deployment.nodes.rend(); ++node) {
    auto& of_node = found[node->name];
    if (of_node.empty()) {
      if (auto process = suite::open_instance(target.var, node->name)) of_node.push_back(std::move(*process));
    }
    for (Process& process : of_node) running.push_back({node->name, std::move(process)});
  }
  return running;
}

/// They end with their nodes; one that is stopped or hangs would start a node later.
void end_starters(const Target& target) {
  constexpr seconds patience{3};  // what they write meanwhile has 2 s
  const MonotonicTime give_up = monotonic_now() + patience;
  for (const Process& starter : suite::starter_processes(target.var.root)) {
    if (starter.wait_for_exit(std::max<nanoseconds>(give_up - monotonic_now(), nanoseconds(0)))) continue;
    starter.signal(SIGKILL);
    (void)starter.wait_for_exit(seconds(1));
  }
}

/// Why nodes are not as they should be, by themselves. Blocks for 0.5 s at most.
void add_reasons(Bus& bus, std::vector<NodeStatus>& nodes) {
  using srfs_msgs::srv::GetNodeStatus;
  std::vector<std::unique_ptr<ros::Client<GetNodeStatus>>> clients;
  std::size_t open = 0;
  for (NodeStatus& s : nodes) {
    if (!s.instance || s.state == "not answering") continue;
    clients.push_back(bus.client<GetNodeStatus>("/" + s.name + "/get_status"));
    ++open;
    clients.back()->call({}, milliseconds(500), 1,
                         [&](const Result<GetNodeStatus::Response, ros::CallError>& answer) {
                           --open;
                           if (!answer) return;
                           s.reason = answer->last_reason;
                           s.failed_callbacks = answer->failed_callbacks;
                         });
  }
  bus.executor.spin_until([&] { return open == 0; }, monotonic_now() + seconds(1));
}

constexpr milliseconds between_readings{100};  // at processes that end
constexpr milliseconds longest_kill{10'000};   // a killed process needs a CPU to end

void disarm_simulated_watchdog(const Target& target) {
  const auto uri = target.deployment.devices.find("watchdog");
  if (uri == target.deployment.devices.end() || !uri->second.starts_with("sim:")) return;
  constexpr seconds unused{1};  // the simulated watchdog has its own timeout
  if (auto watchdog = hw::open_watchdog(uri->second, target.var.root, unused)) (void)(*watchdog)->disarm();
}

/// Held while nodes are started one after the other: the ring does not miss a node that waits for its turn.
Fd lock_starting(const suite::VarPaths& var) {
  Fd lock = open_lock_file(var.starting_lock());
  if (lock) flock(lock.get(), LOCK_EX | LOCK_NB);  // one `up` at a time: only `up` locks it for writing
  return lock;
}

/// Sets the flag while no node is being started: every later starter sees it. A starter that holds its lock
/// for longer than a second is overtaken; down() checks again after its end.
void set_stopping_flag(const Target& target) {
  std::vector<Fd> locks;
  const MonotonicTime deadline = monotonic_now() + seconds(1);
  for (const auto& node : target.deployment.nodes) {
    Fd lock = open_lock_file(target.var.restart_lock(node.name));
    while (lock && flock(lock.get(), LOCK_EX | LOCK_NB) != 0 && monotonic_now() < deadline)
      poll(nullptr, 0, 5);
    locks.push_back(std::move(lock));
  }
  (void)write_file_atomically(target.var.stopping_flag(), "down\n");
}

/// The same suite with these nodes alone; all when none is named.
Target selection(const Target& suite, const std::vector<std::string>& only) {
  Target selected = suite;
  if (!only.empty()) {
    std::erase_if(selected.deployment.nodes, [&](const suite::NodeEntry& node) {
      return std::find(only.begin(), only.end(), node.name) == only.end();
    });
  }
  return selected;
}

}  // namespace

ros::ParticipantOptions participant_options(const Target& target, int domain, ros::Executor& executor) {
  const suite::Deployment& deployment = target.deployment;
  ros::ParticipantOptions options{
      domain, deployment.interfaces, &executor,
      ros::SuiteIdentity{deployment.name, "srfs", static_cast<std::uint32_t>(getpid())}};
  if (deployment.ring.enabled) options.lease = suite::lease_beside_the_ring;
  // Who may not read the key sees the suite, and orders nothing.
  const auto key = deployment.open_orders ? std::nullopt : suite::find_seal_key(target.var);
  if (key) {
    ros::seal_datagrams({*key}, [var = target.var] {
      const auto now = suite::find_seal_key(var);
      return now ? std::optional(ros::SealKeys{*now}) : std::nullopt;
    });
  }
  return options;
}

std::optional<int> running_domain(const Target& target) {
  const auto text = read_file(target.var.domain_file(), 64);
  if (!text) return std::nullopt;
  const int domain = std::atoi(text->c_str());
  return domain >= 0 && domain <= 101 ? std::optional(domain) : std::nullopt;
}

namespace {

UpReport up_locked(const Target& suite, const UpOptions& options) {
  UpReport report;
  if (auto unsafe = suite::unsafe_link(suite.deployment, suite.var.root); !unsafe.empty()) {
    report.problems.push_back(std::move(unsafe));
    return report;
  }
  std::error_code ec;
  std::filesystem::remove(suite.var.stopping_flag(), ec);
  const auto before = local_status(suite);
  const bool running =
      std::any_of(before.begin(), before.end(), [](const NodeStatus& s) { return s.instance.has_value(); });
  const auto domain = take_domain(suite, options, running);
  if (!domain) {
    report.problems.push_back(domain.error());
    return report;
  }
  report.domain = (*domain)->domain();
  if (!running) suite::forget_command_keys(suite.var);
  (void)suite::suite_seal_key(suite.var);  // the nodes say what is wrong with it
  const Target target = selection(suite, options.only);
  Bus bus(target, report.domain);  // before the nodes, so that it does not slow their start
  Start start(target, options, bus);
  const suite::LaunchRequest request{suite.deployment, target.var, suite::suite_bin_folder(), options.cause};
  // Without timing nobody tells whether the suite becomes healthy.
  const auto& started = (suite.deployment.ring.enabled ? suite : target).deployment.nodes;
  const bool judged = std::any_of(started.begin(), started.end(), [](const suite::NodeEntry& node) {
    return std::filesystem::path(node.executable).filename() == "timing_node";
  });
  if (!running && judged) suite::begin_suite_start(suite.var, suite.deployment);
  // With a ring every node may be started as soon as one runs.
  for (const auto& node : started) {
    if (!suite::find_instance(suite.var, node.name)) suite::count_suite_start(request, node);
  }
  Fd starting = lock_starting(target.var);
  start.launch(request);
  starting.reset();
  start.wait();
  start.tell(report);
  report.nodes = local_status(target);
  for (NodeStatus& s : report.nodes) s.state = start.state(s);
  return report;
}

/// Ends these and adds those that needed more than SIGTERM to the report.
void end_all(const std::vector<NodeProcess>& running, milliseconds patience, DownReport& report) {
  struct Ending {
    const NodeProcess* one;
    ProcessCpu cpu;
  };
  std::vector<Ending> ending;
  for (const NodeProcess& one : running) {
    ending.push_back({&one, ProcessCpu(one.process.pid(), ProcessCpu::From::first_reading)});
    ending.back().cpu.read(monotonic_now());
    one.process.signal(SIGTERM);
    one.process.signal(SIGCONT);  // a stopped process would sleep through its SIGTERM
  }
  const MonotonicTime begin = monotonic_now();
  constexpr int most_patience = 10;
  for (Ending& e : ending) {
    bool hung = false;
    bool starved = false;
    while (!hung && !starved && !e.one->process.wait_for_exit(std::min(between_readings, patience))) {
      for (Ending& other : ending) other.cpu.read(monotonic_now());
      const nanoseconds elapsed = monotonic_now() - begin;
      hung = elapsed - e.cpu.waited() >= patience;
      starved = elapsed >= most_patience * patience;
    }
    if (!hung && !starved) continue;
    e.one->process.signal(SIGKILL);
    report.killed.push_back(e.one->node);
    if (!hung) report.starved.push_back(e.one->node);
    if (!e.one->process.wait_for_exit(longest_kill)) report.left.push_back(e.one->node);
  }
}

DownReport down_locked(const Target& target, milliseconds patience) {
  DownReport report;
  set_stopping_flag(target);
  disarm_simulated_watchdog(target);
  // A starter that was overtaken may have made one more process since the last look.
  constexpr int most_rounds = 5;
  for (int round = 0; round < most_rounds; ++round) {
    auto running = processes_of(target);
    if (running.empty()) {
      end_starters(target);
      running = processes_of(target);
    }
    if (running.empty() || !report.left.empty()) break;
    end_all(running, patience, report);
  }
  if (report.left.empty()) {
    for (const NodeProcess& one : processes_of(target)) report.left.push_back(one.node);
  }
  std::error_code ec;
  if (report.left.empty()) {
    for (const auto& node : target.deployment.nodes) {
      std::filesystem::remove(target.var.instance_lock(node.name), ec);
      std::filesystem::remove(target.var.restart_lock(node.name), ec);
    }
    if (const auto domain = running_domain(target))
      (void)suite::DomainLock::share(*domain, target.var.root.string());  // removes the lock of killed nodes
    std::filesystem::remove(target.var.domain_file(), ec);
    std::filesystem::remove(target.var.environment_file(), ec);
    suite::forget_command_keys(target.var);
    std::filesystem::remove_all(target.var.memory(), ec);
    std::filesystem::remove(target.var.memory_link(), ec);
    std::filesystem::remove(target.var.run() / "domains", ec);  // there where the user has no other place
    std::filesystem::remove(target.var.starting_lock(), ec);
    std::filesystem::remove(target.var.stopping_flag(), ec);
  }
  return report;
}

}  // namespace

UpReport up(const Target& suite, const UpOptions& options) {
  const Fd suite_lock = lock_suite(suite);
  return up_locked(suite, options);
}

DownReport down(const Target& target, milliseconds patience) {
  const Fd suite_lock = lock_suite(target);
  DownReport report = down_locked(target, patience);
  if (report.left.empty())
    suite::forget_suite_starts(target.var);  // not in a restart, which may be the watchdog's
  return report;
}

RestartReport restart(const Target& target, milliseconds patience, const UpOptions& options, bool if_up) {
  const bool was_up = if_up || running_domain(target).has_value();
  const Fd suite_lock = lock_suite(target);
  if (was_up && !running_domain(target)) return {};  // a `srfs down` came before
  RestartReport report;
  if (auto unsafe = suite::unsafe_link(target.deployment, target.var.root); !unsafe.empty()) {
    report.up.emplace().problems.push_back(std::move(unsafe));  // what runs, runs on
    return report;
  }
  report.down = down_locked(target, patience);
  if (report.down.left.empty()) report.up = up_locked(target, options);
  return report;
}

std::vector<NodeStatus> status(const Target& target, milliseconds deadline) {
  std::vector<NodeStatus> all = local_status(target);
  std::vector<std::string> running;
  for (const auto& s : all) {
    if (s.instance) running.push_back(s.name);
  }
  const auto domain = running_domain(target);
  if (running.empty() || !domain) return all;
  Bus bus(target, *domain);
  StateQuestions questions(bus, running);
  bus.executor.spin_until(
      [&] {
        bool complete = true;
        for (const std::string& node : running) {
          if (!questions.state(node).empty()) continue;
          complete = false;
          questions.ask(node);
        }
        return complete;
      },
      monotonic_now() + deadline);
  for (NodeStatus& s : all) {
    if (const std::string state = questions.state(s.name); !state.empty()) s.state = state;
  }
  add_reasons(bus, all);
  return all;
}

}  // namespace srfs::tool
