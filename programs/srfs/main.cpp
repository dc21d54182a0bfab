// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
// The engineer's command: start, stop and look at a deployment.

#include <cstdio>
#include <functional>
#include <iostream>

#include <fmt/format.h>
#include <CLI/CLI.hpp>
#include <nlohmann/json.hpp>

#include "base/log.hpp"
#include "programs/srfs/added_node_commands.hpp"
#include "programs/srfs/diagnostics_command.hpp"
#include "programs/srfs/doctor.hpp"
#include "programs/srfs/mcap_commands.hpp"
#include "programs/srfs/new_commands.hpp"
#include "programs/srfs/node_commands.hpp"
#include "programs/srfs/observer.hpp"
#include "programs/srfs/rescue_commands.hpp"
#include "programs/srfs/ring_commands.hpp"
#include "programs/srfs/run_command.hpp"
#include "programs/srfs/suite.hpp"
#include "programs/srfs/topic_commands.hpp"
#include "programs/srfs/version_commands.hpp"
#include "suite/added_nodes.hpp"
#include "suite/launcher.hpp"
#include "suite/run_node.hpp"
#include "suite/starter.hpp"
#include "update/version_table.hpp"

namespace srfs::tool {
namespace {

using Json = nlohmann::ordered_json;

Json to_json(const std::vector<NodeStatus>& nodes) {
  Json list = Json::array();
  for (const NodeStatus& s : nodes) {
    Json j{{"name", s.name}, {"state", s.state}};
    j["pid"] = s.instance ? Json(s.instance->pid) : Json(nullptr);
    j["incarnation"] = s.instance ? Json(s.instance->incarnation) : Json(nullptr);
    j["version"] = s.instance ? Json(s.instance->version) : Json(nullptr);
    j["restarts"] = s.starts.restarts;
    j["reason"] = s.reason.empty() ? Json(nullptr) : Json(s.reason);
    j["failed_callbacks"] = s.failed_callbacks;
    j["last_restart_cause"] = s.starts.last_cause == "-" ? Json(nullptr) : Json(s.starts.last_cause);
    list.push_back(j);
  }
  return list;
}

void print_table(const std::vector<NodeStatus>& nodes) {
  fmt::print("{:<18} {:<14} {:>8} {:>12} {:>8} {:>9}  {}\n", "NODE", "STATE", "PID", "INCARNATION", "VERSION",
             "RESTARTS", "LAST RESTART");
  for (const NodeStatus& s : nodes) {
    fmt::print("{:<18} {:<14} {:>8} {:>12} {:>8} {:>9}  {}\n", s.name, s.state,
               s.instance ? std::to_string(s.instance->pid) : "-",
               s.instance ? std::to_string(s.instance->incarnation) : "-",
               s.instance ? s.instance->version : "-", s.starts.restarts, s.starts.last_cause);
  }
  for (const NodeStatus& s : nodes) {
    if (!s.reason.empty()) fmt::print("{}: {}\n", s.name, s.reason);
  }
}

/// @return 0: all awaited ones are in their desired state; 1: not all, the ring goes on with them; 3: none
/// runs
int show_up(const UpReport& report, bool json) {
  if (json) {
    std::cout << Json{{"ok", report.all_reached}, {"took_ms", report.took.count()},
                      {"domain", report.domain},  {"problems", report.problems},
                      {"advice", report.advice},  {"held", report.held},
                      {"coming", report.coming},  {"nodes", to_json(report.nodes)}}
                     .dump()
              << "\n";
  } else {
    for (const auto* lines : {&report.held, &report.problems, &report.advice})
      for (const std::string& line : *lines) fmt::print(stderr, "srfs up: {}\n", line);
    if (report.all_reached) {
      fmt::print(
          "{} nodes up in {} ms, DDS domain {} (for ROS 2 tools: export ROS_DOMAIN_ID={} "
          "ROS_LOCALHOST_ONLY=1)\n",
          report.nodes.size() - report.held.size() - report.coming.size(), report.took.count(), report.domain,
          report.domain);
      if (!report.coming.empty())
        fmt::print("still starting, not needed for flight: {}\n", fmt::join(report.coming, ", "));
    }
  }
  if (report.all_reached) return 0;
  const bool one_runs = std::any_of(report.nodes.begin(), report.nodes.end(),
                                    [](const NodeStatus& s) { return s.instance.has_value(); });
  return one_runs ? 1 : 3;
}

int show_down(const DownReport& report, bool json) {
  if (json) {
    std::cout << Json{{"ok", report.left.empty()},
                      {"killed", report.killed},
                      {"starved", report.starved},
                      {"left", report.left}}
                     .dump()
              << "\n";
  } else {
    for (const std::string& name : report.killed) {
      const bool starved =
          std::find(report.starved.begin(), report.starved.end(), name) != report.starved.end();
      fmt::print(stderr, "srfs down: {} did not stop in time and was killed{}\n", name,
                 starved ? ": the machine was too busy for it to stop" : "");
    }
    for (const std::string& name : report.left) fmt::print(stderr, "srfs down: {} is still running\n", name);
  }
  return report.left.empty() ? 0 : 1;
}

/// @param if_up  not a suite that was stopped (`srfs down`)
int run_restart(const Target& target, UpOptions options, bool if_up, bool json) {
  constexpr milliseconds patience{500};
  if (options.cause == "up") options.cause = "restart by command";
  if (const auto domain = running_domain(target)) {
    if (auto lock = suite::DomainLock::share(*domain, target.var.root.string()))
      options.held_domain = std::make_shared<suite::DomainLock>(std::move(*lock));
  }
  const RestartReport report = restart(target, patience, options, if_up);
  if (report.up) return show_up(*report.up, json);
  if (report.down.left.empty()) fmt::print(stderr, "srfs restart: the suite was stopped meanwhile\n");
  return show_down(report.down, json);
}

int run_status(const Target& target, bool json) {
  const auto nodes = status(target, milliseconds(2000));
  if (json) {
    std::cout << to_json(nodes).dump(2, ' ', false, Json::error_handler_t::replace) << "\n";
  } else {
    print_table(nodes);
  }
  const bool all_up = std::all_of(nodes.begin(), nodes.end(), [](const NodeStatus& s) {
    return s.instance && s.state != "not answering";
  });
  return all_up ? 0 : 1;
}

/// What `--deployment` means: a file, or the name of one in launch_config here, of the installation, or of
/// the tree that this was built from.
std::string deployment_file_of(const std::string& named) {
  namespace fs = std::filesystem;
  const fs::path file = "launch_config/" + named + ".yaml";
  const fs::path installed = suite::suite_bin_folder().parent_path() / "share/srfs" / file;
  std::error_code ec;
  if (named.find('/') != std::string::npos || fs::is_regular_file(named, ec)) return named;
  const fs::path source = SRFS_LAUNCH_SOURCE_DIR "/" + named + ".yaml";
  for (const fs::path& candidate : {file, installed, source})
    if (fs::is_regular_file(candidate, ec)) return candidate;
  return named;
}

/// What the command line says to all commands, and the exit code of the one that it names.
struct CommandLine {
  std::string deployment = "sim";
  std::string var = "var";
  bool json = false;
  int exit_code = 0;
};

using Action = std::function<int(const Target&)>;

/// Does @p action when the command line names @p command, and no subcommand of it.
void on(CLI::App* command, CommandLine& line, Action action) {
  command->final_callback([command, &line, action = std::move(action)] {
    if (!command->get_subcommands().empty()) return;
    line.deployment = deployment_file_of(line.deployment);
    const suite::VarPaths paths = suite::VarPaths::at(line.var);
    auto reading = suite::load_deployment(line.deployment, paths);
    for (const std::string& problem : reading.problems) fmt::print(stderr, "srfs: {}\n", problem);
    line.exit_code = action({std::move(reading.deployment), paths});
  });
}

/// Of `srfs up`, `down` and `restart`.
struct SuiteArguments {
  UpOptions up;
  int deadline_s = static_cast<int>(UpOptions{}.deadline.count());
  int patience_ms = 3000;
  bool only_if_up = false;
};

int run_up(const Target& target, SuiteArguments& a, const CommandLine& line) {
  a.up.deadline = seconds(a.deadline_s);
  for (const std::string& name : a.up.only) {
    if (target.deployment.find(name) == nullptr)
      throw ConfigError(fmt::format("{}: 'nodes': expected a node named '{}'", line.deployment, name));
  }
  return show_up(up(target, a.up), line.json);
}

void add_up(CLI::App& app, SuiteArguments& a, CommandLine& line) {
  CLI::App* command = app.add_subcommand("up",
                                         "Start all nodes, those that flight needs first; wait until these "
                                         "are in their desired state, then exit");
  command
      ->add_option("--domain", a.up.domain,
                   "DDS domain; default: the deployment's, or the first free from 42")
      ->check(CLI::Range(0, 101));
  command
      ->add_option("--deadline", a.deadline_s,
                   "Seconds to wait without progress of an awaited node; ten times as long in all")
      ->check(CLI::Range(1, 600))
      ->capture_default_str();
  command->add_option("--only", a.up.only, "Start only these nodes; a ring starts the others");
  command->add_flag("--all", a.up.all, "Wait also for nodes that flight does not need");
  on(command, line, [&](const Target& target) { return run_up(target, a, line); });
}

void add_down_and_restart(CLI::App& app, SuiteArguments& a, CommandLine& line) {
  CLI::App* down_command = app.add_subcommand("down", "Stop all nodes in reverse order");
  down_command
      ->add_option("--patience", a.patience_ms,
                   "Milliseconds before SIGKILL, not counting time in which a node waits for a CPU")
      ->check(CLI::Range(10, 60000))
      ->capture_default_str();
  on(down_command, line,
     [&](const Target& target) { return show_down(down(target, milliseconds(a.patience_ms)), line.json); });
  CLI::App* restart_command =
      app.add_subcommand("restart", "Down and up again, as after a reset of the computer");
  restart_command->add_flag(
      "--if-up", a.only_if_up,
      "Do nothing if the suite was stopped by `srfs down`: for a watchdog, whose order may come late");
  restart_command->add_option("--cause", a.up.cause, "Cause to write into the nodes' start records")
      ->default_str("restart by command");
  on(restart_command, line,
     [&](const Target& target) { return run_restart(target, a.up, a.only_if_up, line.json); });
}

/// Of `srfs lifecycle`, `stats`, `topics`, `graph`, `record`, `play` and `echo`.
struct ObserverArguments {
  std::string node;
  std::string transition;
  int transition_ms = 2000;
  bool reset = false;
  int duration_s = 0;
  int wait_ms = static_cast<int>(GraphOrder{}.wait.count());
  McapRecording recording;
  McapPlay play;
  int play_wait_ms = static_cast<int>(McapPlay{}.wait.count());
  GraphOrder graph;
  TopicEcho echo;
  int period_ms = 1000;
  int patience_s = static_cast<int>(TopicEcho{}.patience.count());
};

constexpr const char* interfaces_help =
    "Folder with definitions of messages, PACKAGE/msg/NAME.msg, besides those of this installation and of "
    "the "
    "ROS 2 of this shell (AMENT_PREFIX_PATH)";

void add_status_and_lifecycle(CLI::App& app, ObserverArguments& a, CommandLine& line) {
  on(app.add_subcommand("status", "Show lifecycle state, pid, incarnation, version, restarts of every node"),
     line, [&](const Target& target) { return run_status(target, line.json); });
  CLI::App* lifecycle = app.add_subcommand("lifecycle", "Request a lifecycle transition");
  lifecycle->add_option("node", a.node, "Node name")->required();
  lifecycle->add_option("transition", a.transition, "configure, activate, deactivate, cleanup or shutdown")
      ->required()
      ->check(CLI::IsMember({"configure", "activate", "deactivate", "cleanup", "shutdown"}));
  lifecycle
      ->add_option("--deadline", a.transition_ms,
                   "Milliseconds to wait for its end; exit code 3 if it is still running then")
      ->check(CLI::Range(1, 600000))
      ->capture_default_str();
  on(lifecycle, line, [&](const Target& target) {
    return change_state(target, a.node, a.transition, milliseconds(a.transition_ms), line.json);
  });
}

void add_stats(CLI::App& app, ObserverArguments& a, CommandLine& line) {
  CLI::App* stats =
      app.add_subcommand("stats", "Show run times of a node's callbacks and losses at its inputs");
  stats->add_option("node", a.node, "Node name")->required();
  stats->add_flag("--reset", a.reset, "Reset the counters afterwards");
  on(stats, line, [&](const Target& target) { return show_statistics(target, a.node, a.reset, line.json); });
}

void add_record(CLI::App& app, ObserverArguments& a, CommandLine& line) {
  CLI::App* command = app.add_subcommand("record", "Print what the nodes publish as JSON lines");
  command->add_option("--duration", a.duration_s, "Seconds; 0: until Ctrl-C")
      ->check(CLI::Range(0, 86400))
      ->capture_default_str();
  CLI::Option* file =
      command->add_option("--mcap", a.recording.file,
                          "Record all topics, of other programs too, into this new MCAP file instead");
  command->add_option("--topic", a.recording.topics, "Record only these topics: /timing/tick")->needs(file);
  command->add_option("--domain", a.recording.domain, "DDS domain; default: that of the running suite")
      ->check(CLI::Range(0, 232))
      ->needs(file);
  command->add_option("--most-mib", a.recording.most_mib, "Size at which the recording ends, MiB")
      ->check(CLI::Range(1, 1 << 20))
      ->capture_default_str()
      ->needs(file);
  command->add_option("--largest-mib", a.recording.largest_mib, "Larger samples are dropped and counted, MiB")
      ->check(CLI::Range(1, 16))
      ->capture_default_str()
      ->needs(file);
  command->add_option("--interfaces", a.recording.interfaces, interfaces_help)
      ->check(CLI::ExistingDirectory)
      ->allow_extra_args(false)
      ->needs(file);
  on(command, line, [&](const Target& target) {
    if (a.recording.file.empty()) return record(target, seconds(a.duration_s));
    a.recording.duration = seconds(a.duration_s);
    return record_mcap(target, a.recording);
  });
}

void add_topics(CLI::App& app, ObserverArguments& a, CommandLine& line) {
  CLI::App* command = app.add_subcommand("topics", "Show the topics of the domain, also of other programs");
  command->add_option("--domain", a.recording.domain, "DDS domain; default: that of the running suite")
      ->check(CLI::Range(0, 232));
  command->add_option("--wait", a.wait_ms, "Milliseconds to listen")
      ->check(CLI::Range(1, 60000))
      ->capture_default_str();
  on(command, line, [&](const Target& target) {
    return show_topics(target, a.recording.domain, milliseconds(a.wait_ms), line.json);
  });
}

void add_graph(CLI::App& app, ObserverArguments& a, CommandLine& line) {
  CLI::App* command = app.add_subcommand(
      "graph",
      "Show the nodes of the domain with their topics, services and actions, also of other programs");
  command->add_option("node", a.graph.node, "Only this node: /timing or timing");
  command->add_option("--domain", a.graph.domain, "DDS domain; default: that of the running suite")
      ->check(CLI::Range(0, 232));
  command->add_option("--wait", a.wait_ms, "Milliseconds to listen")
      ->check(CLI::Range(1, 60000))
      ->capture_default_str();
  on(command, line, [&](const Target& target) {
    a.graph.wait = milliseconds(a.wait_ms);
    return show_graph(target, a.graph, line.json);
  });
}

void add_echo(CLI::App& app, ObserverArguments& a, CommandLine& line) {
  CLI::App* command = app.add_subcommand("echo", "Print the messages of a topic, of any type, as JSON lines");
  command->add_option("topic", a.echo.topic, "/timing/tick; `srfs topics` shows all")->required();
  command->add_option("--count", a.echo.count, "Messages; 0: until Ctrl-C")->capture_default_str();
  command->add_option("--patience", a.patience_s, "Seconds to wait for a message")
      ->check(CLI::Range(1, 86400))
      ->capture_default_str();
  command->add_option("--most", a.echo.most, "Elements of each array that are shown")->capture_default_str();
  command->add_option("--domain", a.echo.domain, "DDS domain; default: that of the running suite")
      ->check(CLI::Range(0, 232));
  command->add_option("--interfaces", a.echo.interfaces, interfaces_help)
      ->check(CLI::ExistingDirectory)
      ->allow_extra_args(false);
  on(command, line, [&](const Target& target) {
    a.echo.patience = seconds(a.patience_s);
    return echo_topic(target, a.echo);
  });
}

void add_diagnostics(CLI::App& app, ObserverArguments& a, CommandLine& line) {
  CLI::App* command = app.add_subcommand(
      "diagnostics", "Publish the health of all nodes on /diagnostics and /diagnostics_agg, for ROS 2 tools");
  command->add_option("--period", a.period_ms, "Milliseconds")
      ->check(CLI::Range(100, 60000))
      ->capture_default_str();
  on(command, line,
     [&](const Target& target) { return publish_diagnostics(target, milliseconds(a.period_ms)); });
}

void add_play(CLI::App& app, ObserverArguments& a, CommandLine& line) {
  CLI::App* command =
      app.add_subcommand("play", "Publish what an MCAP file holds, at the intervals of its recording");
  command->add_option("file", a.play.file, "MCAP file")->required()->check(CLI::ExistingFile);
  command->add_option("--domain", a.play.domain, "DDS domain, not that of the running suite")
      ->required()
      ->check(CLI::Range(0, 232));
  command->add_option("--rate", a.play.rate, "Times as fast")
      ->check(CLI::Range(0.01, 1000.0))
      ->capture_default_str();
  command->add_option("--topic", a.play.topics, "Publish only these topics");
  command->add_option("--wait", a.play_wait_ms, "Milliseconds for subscriptions to match, before the first")
      ->check(CLI::Range(0, 600000))
      ->capture_default_str();
  on(command, line, [&](const Target& target) {
    a.play.wait = milliseconds(a.play_wait_ms);
    return play_mcap(target, a.play);
  });
}

/// Of `srfs param`.
struct ParameterArguments {
  std::string node;
  std::string name;
  std::string value;
  std::vector<std::string> names;
  std::uint32_t generation = 0;
  bool next_start = false;
};

void add_parameter_commands(CLI::App& app, ParameterArguments& a, CommandLine& line) {
  CLI::App* command = app.add_subcommand("param", "Parameters of a node");
  command->require_subcommand(1);
  const auto add = [&](const char* name, const char* help, Action action) {
    CLI::App* sub = command->add_subcommand(name, help);
    sub->add_option("node", a.node, "Node name")->required();
    on(sub, line, std::move(action));
    return sub;
  };
  const auto add_name = [&](CLI::App* sub) { sub->add_option("name", a.name, "Parameter")->required(); };
  add("list", "Show all parameters with their values",
      [&](const Target& target) { return list_parameters(target, a.node, line.json); });
  add_name(add("get", "Show the value of a parameter",
               [&](const Target& target) { return get_parameter(target, a.node, a.name, line.json); }));
  add("describe", "Show type, range and meaning of a parameter, or of all", [&](const Target& target) {
    return describe_parameter(target, a.node, a.name, line.json);
  })->add_option("name", a.name, "Parameter; default: all");
  CLI::App* set = add("set", "Change a parameter, until the node's next start", [&](const Target& target) {
    return set_parameter(target, a.node, a.name, a.value, a.next_start, line.json);
  });
  add_name(set);
  set->add_option("value", a.value, "As in YAML: 5, true, text, [1, 2]")->required();
  set->add_flag("--next-start", a.next_start, "Store it for the next start only, without a change now");
  add("keep", "Keep present values across restarts of the node; guarded ones once they are confirmed",
      [&](const Target& target) { return keep_parameters(target, a.node, a.names, line.json); })
      ->add_option("names", a.names, "Parameters; default: all that differ from the deployment");
  add("confirm", "Confirm the values on trial, and keep those that wait to be kept",
      [&](const Target& target) { return confirm_parameters(target, a.node, line.json); });
  add("history", "Show the last ten kept sets of values",
      [&](const Target& target) { return show_parameter_history(target, a.node, line.json); });
  add("restore", "Use the values of a set of the history, now and at the next starts",
      [&](const Target& target) { return restore_parameters(target, a.node, a.generation, line.json); })
      ->add_option("generation", a.generation, "Number of the set")
      ->required();
  add("reset", "Return to the deployment's values, now and at the next starts",
      [&](const Target& target) { return reset_parameters(target, a.node, line.json); });
  add("forget", "Forget stored values; the next start uses those of the deployment",
      [&](const Target& target) { return forget_parameters(target, a.node, a.names, line.json); })
      ->add_option("names", a.names, "Parameters; default: all");
}

/// Of `srfs ring` and `srfs faults`.
struct RingArguments {
  std::string node;
  std::string reason = "by the operator";
  std::string state;
  std::string since;
};

void add_ring_commands(CLI::App& app, RingArguments& a, CommandLine& line) {
  CLI::App* faults = app.add_subcommand("faults", "Show the fault ledger; also works when nothing runs");
  faults->add_option("--since", a.since, "A time (2026-11-21T08:00:00Z) or how long ago (90s, 15m, 2h)");
  faults->add_option("--node", a.node, "Only faults of this node");
  on(faults, line, [&](const Target& target) { return show_faults(target, a.since, a.node, line.json); });
  CLI::App* ring = app.add_subcommand("ring", "What the ring does with a node that dies");
  ring->require_subcommand(1);
  on(ring->add_subcommand("status", "Show deaths, back-off, quarantine and holds of every node"), line,
     [&](const Target& target) { return show_ring(target, line.json); });
  CLI::App* hold = ring->add_subcommand("hold", "Keep the node from being restarted until it is released");
  hold->add_option("node", a.node, "Node name")->required();
  hold->add_option("--reason", a.reason, "Note for the next operator")->capture_default_str();
  on(hold, line, [&](const Target& target) { return hold_node(target, a.node, a.reason, line.json); });
  CLI::App* release = ring->add_subcommand("release", "Lift hold, back-off and quarantine");
  release->add_option("node", a.node, "Node name")->required();
  release->add_option("--state", a.state, "State of its next start; default: unchanged")
      ->check(CLI::IsMember({"active", "inactive", "unconfigured"}));
  on(release, line, [&](const Target& target) { return release_node(target, a.node, a.state, line.json); });
}

/// Of `srfs rescue`.
struct RescueArguments {
  std::vector<std::string> folders;
  bool up = false;
};

void add_rescue_commands(CLI::App& app, RescueArguments& a, CommandLine& line) {
  CLI::App* rescue = app.add_subcommand("rescue", "The program that answers when the suite cannot start");
  rescue->require_subcommand(1);
  CLI::App* prepare = rescue->add_subcommand("prepare",
                                             "Fill folders with srfs_rescue, its settings (keys included) "
                                             "and their digests: again after each change "
                                             "of the deployment's link or keys");
  prepare->add_option("--into", a.folders, "Folder; two, on different partitions where there are some")
      ->required()
      ->expected(1, 4);
  on(prepare, line, [&](const Target& target) { return prepare_rescue(target, a.folders, line.json); });
  CLI::App* step = rescue->add_subcommand("step", "Show in which step the suite was started, and why");
  step->add_flag("--up", a.up, "The next start is a normal one again");
  on(step, line, [&](const Target& target) { return show_step(target, a.up, line.json); });
}

/// Of `srfs versions`.
struct VersionArguments {
  std::string node;
  std::string version;
  std::string file;
  std::string origin;
  bool check = false;
  std::optional<int> probation_s;
};

void add_version_commands(CLI::App& app, VersionArguments& a, CommandLine& line) {
  CLI::App* command =
      app.add_subcommand("versions", "Versions of the nodes' programs; without a subcommand: list them");
  command->require_subcommand(0, 1);
  command->add_option("--node", a.node, "Only this node");
  command->add_flag("--check", a.check,
                    "Compare the programs with their SHA-256; exit code 1: one is damaged");
  on(command, line, [&](const Target& target) { return show_versions(target, a.node, a.check, line.json); });
  const auto add = [&](const char* name, const char* help, Action action) {
    CLI::App* sub = command->add_subcommand(name, help);
    sub->add_option("node", a.node, "Node name")->required();
    on(sub, line, std::move(action));
    return sub;
  };
  const auto add_version = [&](CLI::App* sub, const char* help) {
    sub->add_option("version", a.version, help)->required();
  };
  CLI::App* store = add("add", "Store a program as a version; it is not started", [&](const Target& target) {
    return tool::add_version(target, a.node, a.file, a.origin, line.json);
  });
  store->add_option("file", a.file, "Program")->required();
  store->add_option("--origin", a.origin, "Origin shown in the list; default: the file's path");
  CLI::App* use = add(
      "use", "Restart the node in a version, on probation unless it is golden or the last good one",
      [&](const Target& target) {
        return use_version(target, a.node, a.version,
                           a.probation_s ? std::optional(seconds(*a.probation_s)) : std::nullopt, line.json);
      });
  add_version(use, "Number, golden or previous");
  use->add_option("--probation", a.probation_s,
                  "Seconds; if the node dies within this time, the last good version returns. Default: 300, "
                  "or 1800 for nodes whose versions must be confirmed")
      ->check(CLI::Range(1, static_cast<int>(update::VersionTable::longest_probation / seconds(1))));
  add_version(
      add("confirm", "End a probation with success: it becomes the last good version",
          [&](const Target& target) { return confirm_version(target, a.node, a.version, line.json); }),
      "Number");
  add_version(add("remove", "Remove a version; not the active or the last good one",
                  [&](const Target& target) { return remove_version(target, a.node, a.version, line.json); }),
              "Number");
}

/// Of `srfs node`.
struct NodeArguments {
  std::string node;
  std::string folder;
  std::string program;
  int probation_s = 0;
};

void add_node_commands(CLI::App& app, NodeArguments& a, CommandLine& line) {
  CLI::App* command = app.add_subcommand("node", "Nodes added to the suite, besides those of the deployment");
  command->require_subcommand(1);
  CLI::App* add =
      command->add_subcommand("add", "Add a node to the suite, also to a running one, and start it");
  add->add_option("folder", a.folder, "Folder with package.yaml, the manifest of the node's package")
      ->required()
      ->check(CLI::ExistingDirectory);
  add->add_option("--program", a.program, "Its program, which becomes its active version")
      ->required()
      ->check(CLI::ExistingFile);
  add->add_option("--probation", a.probation_s, "Seconds; 0: none. A node that dies on probation stays down")
      ->check(CLI::Range(0, static_cast<int>(update::VersionTable::longest_probation / seconds(1))))
      ->capture_default_str();
  on(add, line, [&](const Target& target) {
    return add_node(target, a.folder, a.program, seconds(a.probation_s), line.json);
  });
  CLI::App* remove = command->add_subcommand("remove", "Stop an added node and remove it from the suite");
  remove->add_option("node", a.node, "Node name")->required();
  on(remove, line, [&](const Target& target) { return remove_node(target, a.node, line.json); });
  on(command->add_subcommand("list", "List the added nodes"), line,
     [&](const Target& target) { return list_added_nodes(target, line.json); });
}

void add_run(CLI::App& app, RunOrder& order, CommandLine& line) {
  CLI::App* command = app.add_subcommand("run",
                                         "Run a node's program without a deployment: `srfs run my_node "
                                         "--ros-args -p NAME:=VALUE --params-file FILE -r "
                                         "FROM:=TO`. It belongs to no suite, and obeys everyone in its DDS "
                                         "domain. What is behind the program is the "
                                         "program's");
  command->add_option("program", order.program, "A path, or a name beside srfs")->required();
  command->add_option("--name", order.node, "Name of the node; default: the program's, without _node");
  command
      ->add_option("--domain", order.domain,
                   "DDS domain; default: ROS_DOMAIN_ID, else the running suite's, else 42")
      ->check(CLI::Range(0, 101));
  command->add_option(
      "--folder", order.folder,
      "Folder for its deployment, state and kept parameters; default: ~/.local/state/srfs/run/NAME");
  command->prefix_command()->fallthrough(false);  // what is behind the program is not for srfs
  on(command, line, [&order, command](const Target& target) {
    order.arguments = command->remaining();
    return run_program(target, order);
  });
}

void add_new(CLI::App& app, NewOrder& order, CommandLine& line) {
  CLI::App* command = app.add_subcommand(
      "new",
      "Write the first files of something new: they build, pass their test and fly at once. Nothing is "
      "overwritten. Shows what was written, with numbers that are free in the mission dictionary, and what "
      "to "
      "type next");
  command->require_subcommand(1);
  order.in = ".";
  const auto add = [&](const char* kind, const char* help, const char* in, auto action) {
    CLI::App* sub = command->add_subcommand(kind, help);
    sub->add_option("name", order.name, "Lower-case words joined by '_': star_tracker")->required();
    CLI::Option* folder = sub->add_option("--in", order.in, in)->capture_default_str();
    on(sub, line, [&, action](const Target& target) {
      order.json = line.json;
      return action(target, order);
    });
    return folder;
  };
  const char* parent = "Folder that gets the new one; a CMakeLists.txt there gets its add_subdirectory()";
  add("node", "A node NAME with telemetry, a telecommand, an event and a parameter", parent, new_node)
      ->check(CLI::ExistingDirectory);
  add("method", "A method of image processing, the node image_NAME, which receives each frame", parent,
      new_method)
      ->check(CLI::ExistingDirectory);
  add("payload", "A payload, the node payload_NAME, with a slot on the CAN bus and a simulated peripheral",
      "Folder of a mission; it is made if it is not there. Its sim.yaml, else the deployment, gets the slot",
      new_payload)
      ->required();
  add("interfaces", "A package of ROS 2 interfaces, for nodes of SRFS and for a ROS 2 workspace",
      "Folder that gets the new one", new_interfaces)
      ->check(CLI::ExistingDirectory);
  add("telecommand",
      "A telecommand with its handler and its test, for a node or a payload that `srfs new` wrote",
      "Folder of the node", new_telecommand)
      ->check(CLI::ExistingDirectory);
}

void add_doctor(CLI::App& app, CommandLine& line) {
  constexpr const char* help =
      "Check whether this machine is ready for the deployment. One line per check: OK, note, unknown, WARN "
      "or FAIL, what was found, what is expected, and the command that fixes it. Starts and changes nothing. "
      "--deployment, --var and --json as for every command. Exit code 0: no FAIL; 1: at least one";
  on(app.add_subcommand("doctor", help), line,
     [&](const Target& target) { return doctor(target.deployment, target.var.root, line.json); });
}

struct StarterArguments {
  std::string node;
  std::string trust;
};

/// What srfs-starter becomes; not for people.
void add_starter(CLI::App& app, StarterArguments& a, CommandLine& line) {
  CLI::App* command = app.add_subcommand("serve-starter", "The starter of a node, executed by srfs-starter");
  command->group("");
  command->add_option("node", a.node)->required();
  command->add_option("trust", a.trust)->required();
  on(command, line, [&a](const Target& target) {
    const auto trust = a.trust == to_text(suite::Trust::own) ? suite::Trust::own : suite::Trust::foreign;
    return suite::serve_starter(Fd(suite::starter_fd), target.deployment.file, target.var, a.node, trust);
  });
}

int run(int argc, char** argv) {
  CLI::App app{"Starts, stops and shows a deployment of SRFS."};
  app.require_subcommand(1);
  app.fallthrough();
  app.set_version_flag("--version", suite::version());
  CommandLine line;
  app.add_option("--deployment", line.deployment, "Deployment file, or its name: sim")
      ->capture_default_str()
      ->envname("SRFS_DEPLOYMENT");
  app.add_option("--var", line.var, "Folder of the running deployment")
      ->capture_default_str()
      ->envname("SRFS_VAR");
  app.add_flag("--json", line.json, "Machine-readable output");

  SuiteArguments suite;
  ObserverArguments observer;
  ParameterArguments parameters;
  RingArguments ring;
  RescueArguments rescue;
  VersionArguments versions;
  NodeArguments nodes;
  NewOrder new_order;
  RunOrder run_order;
  StarterArguments starter;
  add_up(app, suite, line);  // the order is that of --help
  add_down_and_restart(app, suite, line);
  add_status_and_lifecycle(app, observer, line);
  add_stats(app, observer, line);
  add_parameter_commands(app, parameters, line);
  add_ring_commands(app, ring, line);
  add_rescue_commands(app, rescue, line);
  add_version_commands(app, versions, line);
  add_node_commands(app, nodes, line);
  add_run(app, run_order, line);
  add_new(app, new_order, line);
  add_doctor(app, line);
  add_topics(app, observer, line);
  add_graph(app, observer, line);
  add_record(app, observer, line);
  add_play(app, observer, line);
  add_echo(app, observer, line);
  add_diagnostics(app, observer, line);
  add_starter(app, starter, line);
  try {
    app.parse(argc, argv);
    return line.exit_code;
  } catch (const CLI::ParseError& e) {
    return app.exit(e) == 0 ? 0 : static_cast<int>(CommandExit::usage);
  }
}

}  // namespace
}  // namespace srfs::tool

int main(int argc, char** argv) {
  srfs::log::set_name("srfs");
  try {
    return srfs::tool::run(argc, argv);
  } catch (const std::exception& e) {
    fmt::print(stderr, "srfs: {}\n", e.what());
    return 2;
  }
}
