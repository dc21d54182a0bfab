// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "suite/run_node.hpp"

#include <algorithm>
#include <csignal>
#include <cstdio>
#include <cstdlib>
#include <random>

#include <fmt/format.h>
#include <malloc.h>
#include <sys/epoll.h>
#include <sys/signalfd.h>
#include <unistd.h>
#include <CLI/CLI.hpp>

#include "base/background.hpp"
#include "base/file.hpp"
#include "base/process.hpp"
#include "base/signals.hpp"
#include "srfs_version.hpp"
#include "suite/added_nodes.hpp"
#include "suite/command_keys.hpp"
#include "suite/crash_report.hpp"
#include "suite/node.hpp"
#include "suite/real_time.hpp"
#include "suite/ring/heartbeat_page.hpp"
#include "suite/ring/liveness_ring.hpp"
#include "suite/ring/membership.hpp"
#include "suite/ring/node_record.hpp"
#include "suite/ring/restarter.hpp"
#include "suite/starter.hpp"

namespace srfs::suite {
namespace {

constexpr milliseconds longest_rest{200};
constexpr seconds deployment_review{1};  ///< how often a node looks for added nodes
constexpr seconds starter_review{1};
constexpr seconds self_test_turns{1};
constexpr seconds weight_reviews{10};

struct Arguments {
  std::string name;
  std::filesystem::path deployment;
  std::filesystem::path var;
  std::optional<int> domain;
  bool self_test = false;
  std::filesystem::path added_nodes;
  std::vector<ros::RemapRule> remap;
};

/// What the main of one node gives.
struct Program {
  const mission::NodeTables& tables;
  const NodeFactory& factory;
};

int code(ExitCode c) {
  return static_cast<int>(c);
}

Result<int, std::string> domain_of(const Arguments& arguments, const Deployment& deployment,
                                   const VarPaths& var) {
  if (arguments.domain) return *arguments.domain;
  if (const auto text = read_file(var.domain_file(), 64)) return std::atoi(text->c_str());
  if (deployment.domain) return *deployment.domain;
  return Err(fmt::format("no DDS domain: {} is missing; start the suite with `srfs up`, or give --domain",
                         var.domain_file().string()));
}

void check_control_group(const NodeEntry& entry) {
  constexpr std::size_t largest = 4096;
  if (entry.control_group.empty()) return;
  const std::string groups = read_file("/proc/self/cgroup", largest).value_or("");
  if (("\n" + groups).find("\n0::/" + entry.control_group + "\n") != std::string::npos) return;
  log::warn(
      "running without the limits of control group {} (missing, or no permission); the systemd units of the "
      "package create it",
      entry.control_group);
}

/// Once it was started.
int session_niceness_of(const Scheduling& scheduling) {
  if (scheduling.background) return background_niceness;
  const bool is_plain = scheduling.policy == SchedulingPolicy::other && scheduling.nice == 0;
  return is_plain ? flight_niceness : scheduling.nice;
}

}  // namespace

/// Brings a node to its desired state and keeps trying: a device that is missing now may come.
class NodeRunner {
 public:
  /// @param niceness  of its session once it was started
  NodeRunner(ros::Executor& executor, Node& node, const DesiredState& desired, int niceness)
      : executor_(executor), node_(node), desired_(desired.state), niceness_(niceness) {
    node_.set_supervisor({[this](ros::State commanded) { obey(commanded); }, [this] { recover(); }});
    node_.set_desired(desired_);
    end_order_at(desired.until);
    weight_review_ = executor_.add_timer(
        monotonic_now() + weight_reviews, weight_reviews, [this] { review_weight(); },
        "review of the weight");
    attempt();
  }
  ~NodeRunner() { node_.set_supervisor({}); }
  NodeRunner(const NodeRunner&) = delete;
  NodeRunner& operator=(const NodeRunner&) = delete;

 private:
  /// An operator's order ends what was going on before.
  void obey(ros::State commanded) {
    desired_ = commanded;
    node_.set_desired(commanded);
    retry_.reset();
    end_order_at(commanded == ros::State::active || commanded == ros::State::finalized
                     ? std::nullopt
                     : end_of_order(node_.deployment(), node_.name(), monotonic_now()));
  }
  /// After an error the node is brought up again, later and later while it fails soon after.
  void recover() {
    if (node_.state() != ros::State::finalized && retry_) return;  // on its way already
    constexpr nanoseconds lasting = seconds(60);
    if (reached_ && monotonic_now() - *reached_ > lasting) attempts_ = 0;
    reached_.reset();
    if (node_.state() == ros::State::finalized || node_.state() == desired_) {
      attempt();
    } else {
      retry_later();
    }
  }

  void attempt() {
    if (node_.state() == ros::State::finalized) {
      log::error("finalized after an error; restart the node to use it again");
      return;
    }
    const bool reached = node_.go_to(desired_);
    set_weight(niceness_);
    if (reached) {
      malloc_trim(0);  // configuring takes memory that working does not need (YAML, tables being built)
      reached_ = monotonic_now();
      return;
    }
    retry_later();
  }
  /// The launcher gave the session starting_niceness, and who lends it a CPU changes it for a while. The
  /// kernel changes one session in 100 ms without CAP_SYS_ADMIN, and the nodes of a suite start together.
  void set_weight(int niceness) {
    weight_timer_.reset();
    if (getsid(0) != getpid()) return;  // started by hand: the session is the user's
    const int error = set_session_niceness(niceness);
    if (error == EAGAIN) {
      weight_timer_ = executor_.add_timer(
          monotonic_now() + milliseconds(150), nanoseconds(0), [this, niceness] { set_weight(niceness); },
          "weight of the session");
    } else if (error != 0 && niceness < 0) {
      set_weight(0);
    } else if (error == 0) {
      weight_ = niceness;
    }
  }
  /// A lender may end before it takes its loan back, or be refused, as in set_weight(). One that still lends
  /// does it again.
  void review_weight() {
    const auto now = session_niceness(getpid());
    if (weight_ && now && *now != *weight_ && !weight_timer_) set_weight(*weight_);
  }
  /// A node of the command path comes back by itself: there may be no other way to order it.
  void end_order_at(std::optional<MonotonicTime> end) {
    order_end_.reset();
    if (!end) return;
    order_end_ = executor_.add_timer(
        *end, nanoseconds(0),
        [this] {
          log::warn("{} for {} s, the limit on the command path: going to {}", label(desired_),
                    std::chrono::duration_cast<seconds>(node_.deployment().ring.command_path_limit).count(),
                    label(ros::State::active));
          order_end_.reset();
          retry_.reset();
          desired_ = ros::State::active;
          node_.set_desired(desired_);
          attempt();
        },
        "end of an order");
  }
  void retry_later() {
    constexpr std::array<seconds, 4> waits{seconds(1), seconds(2), seconds(5), seconds(10)};
    const seconds wait = waits[std::min(attempts_++, waits.size() - 1)];
    log::warn("not {} yet, next attempt in {} s", label(desired_), wait.count());
    retry_ = executor_.add_timer(
        monotonic_now() + wait, nanoseconds(0),
        [this] {
          retry_.reset();
          attempt();
        },
        bring_up_timer);
  }

  ros::Executor& executor_;
  Node& node_;
  ros::State desired_;
  int niceness_;
  std::size_t attempts_ = 0;
  std::optional<MonotonicTime> reached_;  ///< when the desired state was reached last
  ros::Timer retry_;
  ros::Timer order_end_;
  ros::Timer weight_timer_;
  ros::Timer weight_review_;
  std::optional<int> weight_;  ///< what the session was given last
};

namespace {

/// The node's half of the liveness ring, and the hand it restarts others with.
struct RingPart {
  /// @param starter  of this node; nullopt: it has the privileges to start others
  RingPart(Node& node, std::optional<StarterClient> starter, std::function<void()> exit)
      : own_starter(std::move(starter)),
        restarter(node.deployment(), node.var(), node.name()),
        ring(node, {[this](const Accusation& accusation) { return restart(accusation); },
                    [this](const std::string& subject, std::uint32_t incarnation, MonotonicTime at) {
                      if (own_starter) return own_starter->recovered(subject, incarnation, at);
                      restarter.on_recovered(subject, incarnation, at);
                    },
                    [this](const std::string& subject, std::uint32_t version) {
                      if (own_starter) return own_starter->commit(subject, version);
                      restarter.commit(subject, version);
                    },
                    std::move(exit)}) {
    restarter.set_generation_source(
        [&node] { return read_membership(node.var(), node.deployment()).membership.generation; });
    restarter.set_deployment_source([&node]() -> const Deployment& { return node.deployment(); });
  }

  RestartOutcome restart(const Accusation& accusation) {
    if (!own_starter) return restarter.restart(accusation);
    auto outcome = own_starter->restart(accusation);
    if (outcome) return std::move(*outcome);
    // One that has worked can be had again: the node upstream replaces both. One that never did would not
    // work beside the next process either, and the node does its own work.
    if (own_starter->has_answered()) {
      log::error("{}; this process ends, to be started again with one", outcome.error());
      kill(getpid(), SIGTERM);
    }
    return {RestartOutcome::What::cannot_start, 0, {}, outcome.error()};
  }

  /// To be called each second, first a second after the start: a starter that was there and is gone was
  /// killed, and can be had again as above.
  void watch_starter() {
    if (!own_starter) return;
    const bool is_there = !own_starter->is_gone();
    if (!is_there && starter_was_there) {
      log::error("the node's starter was killed; this process ends, to be started again with one");
      kill(getpid(), SIGTERM);
    }
    starter_was_there = is_there;
  }

  std::optional<StarterClient> own_starter;
  bool starter_was_there = false;
  Restarter restarter;
  LivenessRing ring;
};

/// Proves from now on that the node runs here. @return its incarnation
std::uint32_t begin_incarnation(InstanceLock& lock, const VarPaths& var, const std::string& node,
                                std::optional<HeartbeatPage>& page) {
  const auto incarnation = next_incarnation(var, node);
  if (!incarnation.not_durable_because.empty()) {
    log::error("incarnation {} is not durable: {}", incarnation.number, incarnation.not_durable_because);
  }
  lock.publish(incarnation.number, version());
  if (auto created = HeartbeatPage::create(var, node, incarnation.number)) {
    page = std::move(*created);
    install_crash_handler(*page);
  } else {
    log::error("no heartbeat page, so the ring treats silence as death: {}", created.error());
  }
  return incarnation.number;
}

void follow_added_nodes(LiveDeployment& live, Node& node, LivenessRing* ring) {
  if (!live.refresh()) return;
  for (const std::string& problem : live.current().added_problems) log::error("{}", problem);
  log::info("the suite has {} added nodes (revision {})", live.current().added.size(),
            live.current().added_revision);
  if (ring != nullptr) ring->on_deployment_changed();
  node.on_deployment_changed();
}

/// Until it is told to stop. @param signals  of the end, on a descriptor
ExitCode work(ros::Executor& executor, Node& node, LiveDeployment& live, const NodeEntry& entry,
              const Fd& signals, std::optional<StarterClient> starter) {
  bool stopping = false;
  ExitCode exit_code = ExitCode::stopped;
  const auto signal_watch = executor.add_fd(
      signals.get(), EPOLLIN,
      [&](std::uint32_t) {
        signalfd_siginfo info{};
        if (read(signals.get(), &info, sizeof info) != sizeof info) return;
        log::info("stopping: signal {} from pid {}", info.ssi_signo, info.ssi_pid);
        stopping = true;
      },
      "signals");
  std::optional<RingPart> ring;
  if (live.first().ring.enabled) {
    ring.emplace(node, std::move(starter), [&] {
      exit_code = ExitCode::deaf;
      stopping = true;
    });
  }
  const ros::Timer changes = executor.add_timer(
      monotonic_now() + deployment_review, deployment_review,
      [&] { follow_added_nodes(live, node, ring ? &ring->ring : nullptr); }, "added nodes");
  const ros::Timer starter_watch = executor.add_timer(
      monotonic_now() + starter_review, starter_review,
      [&] {
        if (ring) ring->watch_starter();
      },
      "starter");
  const NodeRunner runner(executor, node,
                          suite::desired_state(node.var(), live.first(), node.name(), monotonic_now()),
                          session_niceness_of(entry.scheduling));
  while (!stopping && executor.spin_once(nanoseconds::max())) {
  }
  return exit_code;
}

/// In order: what deactivation set going (the release of the bus) gets its time before the devices are
/// closed.
void shut_down(ros::Executor& executor, Node& node) {
  if (node.is_active()) node.go_to(ros::State::inactive);
  executor.spin_until([&] { return node.is_at_rest(); }, monotonic_now() + longest_rest);
  node.go_to(ros::State::unconfigured);
  node.go_to(ros::State::finalized);
}

/// mission::Dictionary::default_folder() is the deployment's from now on.
void use_dictionary_of(const Deployment& deployment) {
  if (!deployment.dictionary.empty()) setenv("SRFS_MISSION_DIR", deployment.dictionary.c_str(), 1);
}

void seal_datagrams_of(const VarPaths& var, const std::string& node) {
  auto keys = seal_keys(var, node);
  if (!keys) {
    log::error("the other nodes take this one for foreign, and it all others, until there is a key: {}",
               keys.error());
    const auto none = random_key();
    if (!none) throw ConfigError(none.error());
    keys = ros::SealKeys{*none};
  }
  if (!keys->limited_to.empty())
    log::info("uplinked: the other nodes believe {} for itself alone", keys->limited_to);
  // The GUID shows for good whether a node is uplinked.
  ros::seal_datagrams(*keys, [var, node, limited_to = keys->limited_to] {
    auto found = find_seal_keys(var, node);
    return found && found->limited_to == limited_to ? found : std::nullopt;
  });
}

/// @param page this process' heartbeat page, once there is one
int run(const Arguments& arguments, const Program& program, std::optional<HeartbeatPage>& page) {
  auto starter = StarterClient::of_this_process();
  const Fd signals = termination_signals();
  ignore_broken_pipes();
  const VarPaths var = VarPaths::at(arguments.var);
  LiveDeployment live(Deployment::load(arguments.deployment), var);
  use_dictionary_of(live.first());
  for (const std::string& problem : live.current().added_problems) log::error("{}", problem);
  const Deployment& deployment = live.first();
  const NodeEntry* entry = deployment.find(arguments.name);
  if (entry == nullptr) {
    throw ConfigError(
        fmt::format("{}: 'nodes': expected a node named '{}'", deployment.file.string(), arguments.name));
  }
  auto lock = InstanceLock::take(var, arguments.name);
  if (!lock) {
    log::error("{}", lock.error());
    return code(ExitCode::already_running);
  }
  const std::uint32_t incarnation = begin_incarnation(*lock, var, arguments.name, page);
  arrange_real_time(*entry);
  check_control_group(*entry);

  const auto domain = domain_of(arguments, deployment, var);
  if (!domain) throw ConfigError(domain.error());
  const auto domain_lock = DomainLock::share(*domain, var.root.string());
  if (!domain_lock) log::warn("{}", domain_lock.error());

  // Few threads, small heaps: one arena instead of one per thread saves about 1 MB a node.
  mallopt(M_ARENA_MAX, 1);
  ros::Executor executor;
  if (page) executor.on_turn([&page](MonotonicTime now) { page->beat(now); });
  ros::ParticipantOptions options{*domain, deployment.interfaces, &executor,
                                  ros::SuiteIdentity{deployment.name, arguments.name, incarnation}};
  options.drop_foreign = deployment.drop_foreign;
  if (deployment.ring.enabled) options.lease = lease_beside_the_ring;
  if (!deployment.open_orders) seal_datagrams_of(var, arguments.name);
  auto participant = ros::Participant::create(options);
  if (!participant) {
    log::error("{}", participant.error());
    return code(ExitCode::middleware);
  }
  NodeContext context{arguments.name,
                      deployment,
                      var,
                      incarnation,
                      executor,
                      **participant,
                      page ? &*page : nullptr,
                      &live,
                      arguments.remap,
                      program.tables};
  const std::unique_ptr<Node> node = program.factory(context);
  node->finish_declarations();
  log::info("up: incarnation {}, version {}, pid {}, DDS domain {}", incarnation, version(), getpid(),
            *domain);
  const ros::Timer descriptors = executor.add_timer(
      monotonic_now(), seconds(1),
      [&page] {
        if (page) page->descriptors(count_descriptors(getpid()));
      },
      "descriptors");
  const ExitCode exit_code = work(executor, *node, live, *entry, signals, std::move(starter));
  shut_down(executor, *node);
  return code(exit_code);
}

/// Devices that are never there: a test drives no hardware.
void take_devices_away(Deployment& deployment) {
  for (auto& [key, uri] : deployment.devices) {
    const bool serial = uri.starts_with("serial:");
    uri = fmt::format("{}:none/{}", serial ? "serial" : "sim", key);
  }
}

/// Random keys: a test must not need the spacecraft's.
void replace_keys(Deployment& deployment, const VarPaths& var) {
  std::random_device random;
  use_self_test_keys(deployment.link);
  for (const std::string& key_file : key_files_of(deployment.link)) {
    std::string digits;
    for (int i = 0; i < 8; ++i) digits += fmt::format("{:08x}", random());
    const auto file = var.root / key_file;
    if (const auto written = write_file_atomically(file, digits + "\n"); !written)
      throw ConfigError(written.error().message);
    std::filesystem::permissions(file, std::filesystem::perms::owner_read);
  }
}

/// @return what is wrong with the node
Result<void, std::string> try_out(ros::Executor& executor, Node& node) {
  const auto failure = [&](const char* what) {
    return Err(
        fmt::format("{}: {}", what, node.failure_reason().empty() ? "see the log" : node.failure_reason()));
  };
  if (!node.go_to(ros::State::inactive)) return failure("it cannot be configured");
  if (!node.go_to(ros::State::active)) return failure("it cannot be activated");
  executor.spin_until([&] { return !node.is_active(); }, monotonic_now() + self_test_turns);
  if (!node.is_active()) return failure("it does not stay active");
  if (node.failed_callbacks() > 0)
    return Err(fmt::format("{} callbacks ended with an exception", node.failed_callbacks()));
  if (auto own = node.self_test(); !own) return own;
  if (!node.go_to(ros::State::inactive)) return failure("it cannot be deactivated");
  executor.spin_until([&] { return node.is_at_rest(); }, monotonic_now() + longest_rest);
  if (!node.go_to(ros::State::unconfigured)) return failure("it cannot be cleaned up");
  if (!node.go_to(ros::State::finalized)) return failure("it cannot be finalized");
  return {};
}

Deployment deployment_of_test(const Arguments& arguments) {
  Deployment file = Deployment::load(arguments.deployment);
  if (arguments.added_nodes.empty()) return file;
  const auto text = read_file(arguments.added_nodes);
  if (!text) throw ConfigError(text.error().message);
  const auto added = added_nodes_from_text(*text);
  if (!added) throw ConfigError(fmt::format("{}: {}", arguments.added_nodes.string(), added.error()));
  auto [deployment, problems] = with_added(std::move(file), *added);
  if (!problems.empty()) throw ConfigError(problems.front());
  return deployment;
}

int run_self_test(const Arguments& arguments, const Program& program) {
  if (!arguments.domain) throw ConfigError("--self-test needs --domain, one that is not in use");
  ignore_broken_pipes();
  // A node that is to be added stands in the list of the VAR that it tests itself in.
  Deployment deployment = deployment_of_test(arguments);
  use_dictionary_of(deployment);
  take_devices_away(deployment);
  deployment.ring.enabled = false;
  if (deployment.find(arguments.name) == nullptr)
    throw ConfigError(fmt::format("{}: no node '{}'", deployment.file.string(), arguments.name));
  const VarPaths var = VarPaths::at(arguments.var);
  replace_keys(deployment, var);
  auto lock = InstanceLock::take(var, arguments.name);
  if (!lock) {
    log::error("{}", lock.error());
    return code(ExitCode::already_running);
  }
  mallopt(M_ARENA_MAX, 1);
  ros::Executor executor;
  auto participant = ros::Participant::create({*arguments.domain, deployment.interfaces, &executor});
  if (!participant) {
    log::error("{}", participant.error());
    return code(ExitCode::middleware);
  }
  NodeContext context{arguments.name, deployment, var, 1, executor, **participant};
  context.tables = program.tables;
  const std::unique_ptr<Node> node = program.factory(context);
  node->finish_declarations();
  const auto tried = try_out(executor, *node);
  if (!tried) {
    log::error("self-test failed: {}", tried.error());
    return code(ExitCode::self_test_failed);
  }
  log::info("self-test passed");
  return code(ExitCode::stopped);
}

/// @return the exit code where the program ends with that
std::optional<int> read_arguments(CLI::App& app, int argc, char** argv, Arguments& arguments) {
  auto line = ros::read_command_line(argc, argv);
  if (!line) {
    fmt::print(stderr, "{}\n", line.error());
    return code(ExitCode::configuration);
  }
  app.name(argv[0]);
  std::reverse(line->others.begin(), line->others.end());  // the parser takes the last one first
  try {
    app.parse(line->others);
  } catch (const CLI::ParseError& e) {
    return app.exit(e);
  }
  for (const ros::RemapRule& rule : line->remap) {
    if (const std::string refusal = refusal_of_remap(rule, arguments.name); !refusal.empty()) {
      fmt::print(stderr, "{}\n", refusal);
      return code(ExitCode::configuration);
    }
  }
  arguments.remap = std::move(line->remap);
  return std::nullopt;
}

}  // namespace

const char* version() {
  return SRFS_VERSION;
}

int run_node(int argc, char** argv, const mission::NodeTables& tables, const NodeFactory& factory) {
  const Program program{tables, factory};
  CLI::App app{"A lifecycle node of SRFS. Usually started by `srfs up`."};
  Arguments arguments;
  app.add_option("--name", arguments.name, "Name of the node in the deployment file, without slash")
      ->required();
  app.add_option("--deployment", arguments.deployment, "Deployment file (launch_config/NAME.yaml)")
      ->required();
  app.add_option("--var", arguments.var, "Folder of the running deployment")->default_val("var");
  app.add_option("--domain", arguments.domain,
                 "DDS domain; default: VAR/run/dds_domain, then the deployment file")
      ->check(
          CLI::Range(0, 232));  // above 101: ports that the kernel gives out, good enough for a test alone
  app.add_flag(
      "--self-test", arguments.self_test,
      "Go to Active and back without devices or ring, with its own --var and --domain; exit code 6: failed");
  app.add_option("--added-nodes", arguments.added_nodes,
                 "With --self-test of an added node: the list of added nodes");
  app.set_version_flag("--version", version());
  app.footer(
      "--ros-args -r FROM:=TO gives a topic or service another name, as in ROS 2, until the ring restarts "
      "the "
      "node; `remap` of the deployment does so for good.");
  if (const auto ended = read_arguments(app, argc, argv, arguments)) return *ended;
  log::set_name(arguments.name);
  std::optional<HeartbeatPage> page;
  int exit_code = code(ExitCode::bug);
  try {
    exit_code = arguments.self_test ? run_self_test(arguments, program) : run(arguments, program, page);
  } catch (const ConfigError& e) {
    log::error("{}", e.what());
    exit_code = code(ExitCode::configuration);
  } catch (const std::exception& e) {
    log::fatal("{}", e.what());
  }
  if (page) page->end(EndKind::exit, static_cast<std::uint32_t>(exit_code));
  return exit_code;
}

}  // namespace srfs::suite
