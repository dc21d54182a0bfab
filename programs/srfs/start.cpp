// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "programs/srfs/start.hpp"

#include <algorithm>
#include <cstdio>

#include <fmt/format.h>
#include <unistd.h>

#include "base/file.hpp"
#include "programs/srfs/busy_machine.hpp"
#include "suite/ring/heartbeat_page.hpp"
#include "suite/ring/node_record.hpp"

namespace srfs::tool {
namespace {

constexpr milliseconds between_looks{100};  // at locks and files of the nodes
constexpr seconds between_lines{5};
constexpr seconds between_lines_on_a_terminal{2};

std::string desired(const Target& target, const std::string& node) {
  return std::string(
      ros::label(suite::desired_state(target.var, target.deployment, node, monotonic_now()).state));
}

std::vector<std::string> names(const suite::Deployment& deployment) {
  std::vector<std::string> all;
  all.reserve(deployment.nodes.size());
  for (const auto& node : deployment.nodes) all.push_back(node.name);
  return all;
}

double in_seconds(nanoseconds time) {
  return std::chrono::duration<double>(time).count();
}

}  // namespace

Start::Start(const Target& target, const UpOptions& options, Bus& bus)
    : target_(target),
      bus_(bus),
      questions_(bus, names(target.deployment)),
      begin_(monotonic_now()),
      deadline_(options.deadline),
      patience_(options.deadline, begin_),
      terminal_(isatty(STDERR_FILENO) != 0),
      next_show_(begin_ + (terminal_ ? between_lines_on_a_terminal : between_lines)) {
  for (const bool needed : {true, false}) {
    for (const auto& entry : target.deployment.nodes) {
      if (entry.needed == needed) nodes_.push_back({&entry, needed || options.all || !options.only.empty()});
    }
  }
}

void Start::launch(const suite::LaunchRequest& request) {
  for (Node& node : nodes_) {
    node.held = suite::held_because(target_.var, target_.deployment, node.entry->name, monotonic_now());
    if (node.held) continue;
    const auto started = suite::launch(request, *node.entry, patience_with_a_restart);
    // Another process may be starting it: what counts is whether the node comes up.
    if (!started) node.launch_problem = started.error();
    if (started) node.launched = Process::open(*started);
    read(node, monotonic_now());
  }
}

void Start::wait() {
  for (Node& node : nodes_)
    node.gone_since.reset();  // counted from now on: launching the others took its time
  MonotonicTime next_look = begin_;
  // Files are read now and then only: the condition is asked after every sample, and reading them each time,
  // from a slow file system, leaves no time for the answers.
  const auto done = [&] {
    const MonotonicTime now = monotonic_now();
    if (now < next_look) return all_there();
    look(now);
    reached_ = all_there();
    if (reached_ || ended_ || patience_.is_over()) return true;
    show(now);
    next_look = monotonic_now() + between_looks;
    return false;
  };
  constexpr seconds turn{60};  // the patience ends it
  while (!bus_.executor.spin_until(done, monotonic_now() + turn)) {
  }
  reached_ = all_there();
  wipe();
}

bool Start::is_there(const Node& node) const {
  return node.held.has_value() || questions_.state(node.entry->name) == node.wanted;
}

bool Start::all_there() {
  bool all = true;
  for (const Node& node : nodes_) {
    if (is_there(node)) continue;
    all = all && !node.awaited;
    questions_.ask(node.entry->name);
  }
  return all;
}

void Start::read(Node& node, MonotonicTime now) {
  const std::string& name = node.entry->name;
  node.wanted = desired(target_, name);
  pid_t pid = 0;
  if (const auto instance = suite::find_instance(target_.var, name)) {
    pid = instance->pid;
  } else if (const auto starting = suite::find_starting(target_.var, name)) {
    pid = starting->process.pid();
  } else if (node.launched && !node.launched->wait_for_exit(nanoseconds(0))) {
    pid = node.launched->pid();
  }
  node.reading = {name, pid};
  if (pid == 0) {
    node.cpu.reset();
    if (!node.gone_since) node.gone_since = now;
    return;
  }
  node.gone_since.reset();
  if (!node.cpu || node.cpu->pid() != pid) node.cpu.emplace(pid, ProcessCpu::From::start_of_the_process);
  node.cpu->read(now);
  node.reading.cpu = node.cpu->ran() + node.cpu->waited();
  node.reading.waited = node.cpu->waited();
  if (const auto page = suite::HeartbeatPage::read(target_.var, name); page && page->pid == pid)
    node.reading.state = static_cast<ros::State>(page->state);
}

void Start::look(MonotonicTime now) {
  std::vector<StartReading> awaited;
  for (Node& node : nodes_) {
    node.held = suite::held_because(target_.var, target_.deployment, node.entry->name, monotonic_now());
    if (node.held || (is_there(node) && suite::find_instance(target_.var, node.entry->name))) continue;
    read(node, now);
    if (!node.awaited) continue;
    awaited.push_back(node.reading);
    // A node that ended (a bad parameter, a missing library) may come by a restart alone.
    if (node.gone_since)
      ended_ = ended_ || now - *node.gone_since >=
                             patience_with_gone(target_.deployment.ring.enabled, cpu_pressure(), deadline_);
  }
  patience_.on_readings(awaited, now);
}

std::string Start::state_of(const Node& node) const {
  using ros::State;
  if (const std::string answer = questions_.state(node.entry->name); answer == node.wanted) return answer;
  if (node.reading.pid == 0) return "not running";
  if (node.reading.state == State::unknown) return "loading";
  const std::string state(ros::label(node.reading.state));
  return state == node.wanted ? state + ", without an answer yet" : state;
}

std::string Start::state(const NodeStatus& node) const {
  const std::string answer = questions_.state(node.name);
  return answer.empty() || !node.instance ? node.state : answer;
}

void Start::wipe() {
  if (shown_ > 0) fmt::print(stderr, "\033[{}A\033[J", shown_);
  shown_ = 0;
}

std::string Start::cpu_of(const Node& node) {
  if (!node.cpu) return "";
  return fmt::format("; {:.1f} s of CPU used, {:.1f} s waited for a CPU", in_seconds(node.cpu->ran()),
                     in_seconds(node.cpu->waited()));
}

void Start::show(MonotonicTime now) {
  if (now < next_show_) return;
  next_show_ = now + (terminal_ ? between_lines_on_a_terminal : between_lines);
  wipe();
  for (const Node& node : nodes_) {
    if (is_there(node)) continue;
    fmt::print(stderr, "{}: {}{}{}\n", node.entry->name, state_of(node), cpu_of(node),
               node.awaited ? "" : "; flight does not need it");
    if (terminal_) ++shown_;
  }
  std::fflush(stderr);
}

void Start::tell(UpReport& report) {
  report.took = std::chrono::duration_cast<milliseconds>(monotonic_now() - begin_);
  report.all_reached = reached_;
  for (const auto& entry : target_.deployment.nodes) {
    const auto node =
        std::find_if(nodes_.begin(), nodes_.end(), [&](const Node& n) { return n.entry == &entry; });
    if (node->held) report.held.push_back(fmt::format("{} is held: {}", entry.name, *node->held));
    if (is_there(*node)) continue;
    if (!node->launch_problem.empty())
      report.problems.push_back(fmt::format("{}: {}", entry.name, node->launch_problem));
    if (!node->awaited) {
      report.coming.push_back(entry.name);
      continue;
    }
    report.problems.push_back(fmt::format("{} is {} instead of {}{}; see {}", entry.name, state_of(*node),
                                          node->wanted, cpu_of(*node), target_.var.log(entry.name).string()));
  }
  if (reached_) return;
  report.advice = advice_on(look_at_machine());
  report.advice.insert(
      report.advice.begin(),
      ended_ ? fmt::format("gave up after {:.0f} s: a node ended and nobody started it again",
                           in_seconds(monotonic_now() - begin_))
             : fmt::format("gave up after {:.0f} s, of which the last {:.0f} s without progress",
                           in_seconds(monotonic_now() - begin_), in_seconds(patience_.idle())));
}

}  // namespace srfs::tool
