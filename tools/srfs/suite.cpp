#include "tools/srfs/suite.hpp"

#include <algorithm>
#include <csignal>
#include <cstdlib>
#include <map>

#include <fcntl.h>
#include <fmt/format.h>
#include <poll.h>
#include <sys/file.h>
#include <unistd.h>
#include <lifecycle_msgs/srv/get_state.hpp>
#include <srfs_msgs/srv/get_node_status.hpp>

#include "base/file.hpp"
#include "base/process.hpp"
#include "hw/open.hpp"
#include "hw/watchdog.hpp"
#include "ros/launcher.hpp"
#include "ros/lifecycle.hpp"
#include "ros/ring/node_record.hpp"
#include "tools/srfs/bus.hpp"

namespace srfs::tool {
namespace {

using lifecycle_msgs::srv::GetState;

constexpr milliseconds ask_deadline{1000};  // an answer may take 200 ms on an emulated processor

/// Asks nodes for their lifecycle state until told to stop.
class StateQuestions {
 public:
  StateQuestions(Bus& bus, const std::vector<std::string>& nodes) {
    for (const std::string& node : nodes) clients_[node] = bus.client<GetState>("/" + node + "/get_state");
  }
  void ask(const std::string& node) {
    if (asking_[node]) return;
    asking_[node] = true;
    clients_.at(node)->call({}, ask_deadline, 1,
                            [this, node](const Result<GetState::Response, ros::CallError>& answer) {
                              asking_[node] = false;
                              if (answer) states_[node] = answer->current_state.label;
                            });
  }
  void forget(const std::string& node) { states_.erase(node); }
  [[nodiscard]] std::string state(const std::string& node) const {
    const auto found = states_.find(node);
    return found == states_.end() ? "" : found->second;
  }

 private:
  std::map<std::string, std::unique_ptr<ros::Client<GetState>>> clients_;
  std::map<std::string, bool> asking_;
  std::map<std::string, std::string> states_;
};

std::string desired(const Target& target, const std::string& node) {
  const auto text = read_file(target.var.state(node) / "desired_state", 64);
  const std::string label = text ? text->substr(0, text->find('\n')) : "active";
  const auto state = ros::primary_state(label);
  return state && *state != ros::State::finalized ? label : "active";
}

std::vector<std::string> names(const ros::Deployment& deployment) {
  std::vector<std::string> all;
  all.reserve(deployment.nodes.size());
  for (const auto& node : deployment.nodes) all.push_back(node.name);
  return all;
}

std::vector<NodeStatus> local_status(const Target& target) {
  std::vector<NodeStatus> all;
  for (const auto& node : target.deployment.nodes) {
    NodeStatus s;
    s.name = node.name;
    s.instance = ros::find_instance(target.var, node.name);
    s.starts = ros::read_start_record(target.var, node.name);
    if (s.instance) s.state = "not answering";
    all.push_back(s);
  }
  return all;
}

/// The domain of the suite that runs in VAR, or a fresh one held for it. @param running one of its nodes does
Result<std::shared_ptr<ros::DomainLock>, std::string> take_domain(const Target& target,
                                                                  const UpOptions& options, bool running) {
  const auto old = running_domain(target);
  std::shared_ptr<ros::DomainLock> held = options.held_domain;
  if (!held) {
    auto lock = running && old
                    ? ros::DomainLock::share(*old)
                    : ros::DomainLock::allocate(options.domain ? options.domain : target.deployment.domain);
    if (!lock) return Err(lock.error());
    held = std::make_shared<ros::DomainLock>(std::move(*lock));
  }
  if (const auto written =
          write_file_atomically(target.var.domain_file(), fmt::format("{}\n", held->domain()));
      !written) {
    return Err(written.error().message);
  }
  // What a restart by any node gives its node, too.
  if (const auto written = write_file_atomically(target.var.environment_file(), ros::environment_for_nodes());
      !written) {
    return Err(written.error().message);
  }
  held->downgrade();
  return held;
}

/// One `up` or `down` of a deployment at a time: the second waits for the first. No file is left behind: the
/// lock is on the folder itself.
Fd lock_suite(const Target& target) {
  std::error_code ec;
  std::filesystem::create_directories(target.var.root, ec);
  Fd folder(open(target.var.root.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC));
  if (folder) flock(folder.get(), LOCK_EX);
  return folder;
}

struct NodeProcess {
  std::string node;
  std::optional<Process> process;  ///< nullopt: it is gone
};

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

void disarm_simulated_watchdog(const Target& target) {
  const auto uri = target.deployment.devices.find("watchdog");
  if (uri == target.deployment.devices.end() || !uri->second.starts_with("sim:")) return;
  constexpr seconds unused{1};  // the simulated watchdog has its own timeout
  if (auto watchdog = hw::open_watchdog(uri->second, target.var.root, unused)) (void)(*watchdog)->disarm();
}

constexpr milliseconds between_looks{100};     // at locks and files of the nodes
constexpr seconds patience_with_a_restart{4};  // by a neighbour, of a node that ended a moment ago

/// Held while nodes are started one after the other: the ring does not miss who has not had its turn.
Fd lock_starting(const ros::VarPaths& var) {
  Fd lock(open(var.starting_lock().c_str(), O_RDWR | O_CREAT | O_CLOEXEC, 0644));
  if (lock) flock(lock.get(), LOCK_EX | LOCK_NB);  // one `up` at a time: nobody else locks it for writing
  return lock;
}

/// Sets the flag while nobody is starting anything: whoever starts a node afterwards sees it. A starter that
/// holds its lock for longer than a second is overtaken; the loop of down() over instances still finds its
/// node.
void set_stopping_flag(const Target& target) {
  std::error_code ec;
  std::filesystem::create_directories(target.var.run(), ec);
  std::vector<Fd> locks;
  const MonotonicTime deadline = monotonic_now() + seconds(1);
  for (const auto& node : target.deployment.nodes) {
    Fd lock(open(target.var.restart_lock(node.name).c_str(), O_RDWR | O_CREAT | O_CLOEXEC, 0644));
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
    std::erase_if(selected.deployment.nodes, [&](const ros::NodeEntry& node) {
      return std::find(only.begin(), only.end(), node.name) == only.end();
    });
  }
  return selected;
}

}  // namespace

ros::ParticipantOptions participant_options(const ros::Deployment& deployment, int domain,
                                            ros::Executor& executor) {
  ros::ParticipantOptions options{
      domain, deployment.interfaces, &executor,
      ros::SuiteIdentity{deployment.name, "srfs", static_cast<std::uint32_t>(getpid())}};
  if (deployment.ring.enabled) options.lease = ros::lease_beside_the_ring;
  return options;
}

std::optional<int> running_domain(const Target& target) {
  const auto text = read_file(target.var.domain_file(), 64);
  if (!text) return std::nullopt;
  const int domain = std::atoi(text->c_str());
  return domain >= 0 && domain <= 101 ? std::optional(domain) : std::nullopt;
}

UpReport up(const Target& suite, const UpOptions& options) {
  UpReport report;
  const Fd suite_lock = lock_suite(suite);
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
  const Target target = selection(suite, options.only);
  Bus bus(target.deployment, report.domain);  // before the nodes, so that it does not slow their start
  StateQuestions questions(bus, names(target.deployment));

  const MonotonicTime start = monotonic_now();
  const ros::LaunchRequest request{suite.deployment, target.var, ros::suite_bin_folder(), options.cause};
  std::vector<NodeProcess> processes;
  // With a ring every node may be started as soon as one runs.
  for (const auto& node : (suite.deployment.ring.enabled ? suite : target).deployment.nodes) {
    if (!ros::find_instance(suite.var, node.name)) ros::count_suite_start(request, node);
  }
  Fd starting = lock_starting(target.var);
  for (const auto& node : target.deployment.nodes) {
    if (const auto why = ros::held_because(target.var, node.name)) {
      report.held.push_back(fmt::format("{} is held: {}", node.name, *why));
      processes.push_back({node.name, std::nullopt});
      continue;
    }
    const auto started = ros::launch(request, node, patience_with_a_restart);
    if (!started) report.problems.push_back(fmt::format("{}: {}", node.name, started.error()));
    processes.push_back({node.name, started ? Process::open(*started) : std::nullopt});
  }
  starting.reset();
  // By node; a held one is not waited for. Read now and then only: the condition below is asked after every
  // sample, and reading files each time, from a slow file system, leaves no time for the answers.
  std::map<std::string, std::string> awaited;
  const auto read_awaited = [&] {
    awaited.clear();
    for (const auto& node : target.deployment.nodes) {
      if (!ros::held_because(target.var, node.name)) awaited[node.name] = desired(target, node.name);
    }
  };
  const auto reached = [&] {
    bool all = true;
    for (const auto& [node, state] : awaited) {
      if (questions.state(node) == state) continue;
      all = false;
      questions.ask(node);
    }
    return all;
  };
  // A node that ended (a bad parameter, a missing library) will not come by waiting for it. But its
  // neighbours in the ring start it again where it was killed: on a busy machine, the switcher may fence a
  // holder that was late.
  const nanoseconds patience = suite.deployment.ring.enabled ? patience_with_a_restart : nanoseconds(0);
  std::vector<std::optional<MonotonicTime>> first_gone(processes.size());
  MonotonicTime next_look = start;
  bool ended = false;
  const auto reached_or_ended = [&] {
    if (monotonic_now() < next_look) return reached();
    read_awaited();
    if (reached()) return true;
    // One that has no instance lock yet may still be loading.
    const auto now = local_status(target);
    for (std::size_t i = 0; i < now.size(); ++i) {
      if (!awaited.contains(now[i].name)) continue;
      const auto& process = processes[i].process;
      if (now[i].instance || (process && !process->wait_for_exit(nanoseconds(0)))) continue;
      if (!first_gone[i]) first_gone[i] = monotonic_now();
      ended = ended || monotonic_now() - *first_gone[i] >= patience;
    }
    next_look = monotonic_now() + between_looks;
    return ended;
  };
  report.all_reached = bus.executor.spin_until(reached_or_ended, start + options.deadline) && !ended &&
                       report.problems.empty();
  report.took = std::chrono::duration_cast<milliseconds>(monotonic_now() - start);
  report.nodes = local_status(target);
  for (NodeStatus& s : report.nodes) {
    const std::string state = questions.state(s.name);
    if (!state.empty() && s.instance) s.state = state;
    const auto wanted = awaited.find(s.name);
    if (wanted != awaited.end() && s.state != wanted->second) {
      report.problems.push_back(fmt::format("{} is {} instead of {}; see {}", s.name, s.state, wanted->second,
                                            target.var.log(s.name).string()));
    }
  }
  return report;
}

DownReport down(const Target& target, milliseconds patience) {
  DownReport report;
  const Fd suite_lock = lock_suite(target);
  set_stopping_flag(target);
  disarm_simulated_watchdog(target);
  std::vector<NodeProcess> running;
  for (auto node = target.deployment.nodes.rbegin(); node != target.deployment.nodes.rend(); ++node) {
    auto process = ros::open_instance(target.var, node->name);
    if (!process) {
      // One on the way to its instance lock would come up after all of this.
      if (auto starting = ros::find_starting(target.var, node->name)) process = std::move(starting->process);
    }
    if (!process) continue;
    process->signal(SIGTERM);
    process->signal(SIGCONT);  // a stopped process would sleep through its SIGTERM
    running.push_back({node->name, std::move(process)});
  }
  const MonotonicTime deadline = monotonic_now() + patience;
  for (const NodeProcess& one : running) {
    if (one.process->wait_for_exit(std::max<nanoseconds>(deadline - monotonic_now(), milliseconds(1))))
      continue;
    one.process->signal(SIGKILL);
    report.killed.push_back(one.node);
    if (!one.process->wait_for_exit(milliseconds(2000))) report.left.push_back(one.node);
  }
  std::error_code ec;
  if (report.left.empty()) {
    for (const auto& node : target.deployment.nodes) {
      std::filesystem::remove(target.var.instance_lock(node.name), ec);
      std::filesystem::remove(target.var.restart_lock(node.name), ec);
    }
    if (const auto domain = running_domain(target))
      (void)ros::DomainLock::share(*domain);  // removes the lock of killed nodes
    std::filesystem::remove(target.var.domain_file(), ec);
    std::filesystem::remove(target.var.environment_file(), ec);
    std::filesystem::remove_all(target.var.memory(), ec);
    std::filesystem::remove(target.var.starting_lock(), ec);
    std::filesystem::remove(target.var.stopping_flag(), ec);
  }
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
  Bus bus(target.deployment, *domain);
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
