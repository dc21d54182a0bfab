// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
// The engineer's command: start, stop and look at a deployment.

#include <cstdio>
#include <iostream>

#include <fmt/format.h>
#include <CLI/CLI.hpp>
#include <nlohmann/json.hpp>

#include "base/log.hpp"
#include "programs/srfs/added_node_commands.hpp"
#include "programs/srfs/doctor.hpp"
#include "programs/srfs/node_commands.hpp"
#include "programs/srfs/observer.hpp"
#include "programs/srfs/ring_commands.hpp"
#include "programs/srfs/suite.hpp"
#include "programs/srfs/version_commands.hpp"
#include "ros/added_nodes.hpp"
#include "ros/launcher.hpp"
#include "ros/run_node.hpp"
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
    if (auto lock = ros::DomainLock::share(*domain, target.var.root.string()))
      options.held_domain = std::make_shared<ros::DomainLock>(std::move(*lock));
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

/// What the command line of `srfs param` says.
struct ParameterArguments {
  std::string node;
  std::string name;
  std::string value;
  std::vector<std::string> names;
  std::uint32_t generation = 0;
  bool next_start = false;
  CLI::App* command = nullptr;
};

void add_parameter_commands(CLI::App& app, ParameterArguments& a) {
  a.command = app.add_subcommand("param", "Parameters of a node");
  a.command->require_subcommand(1);
  const auto add = [&](const char* name, const char* help) {
    CLI::App* sub = a.command->add_subcommand(name, help);
    sub->add_option("node", a.node, "Node name")->required();
    return sub;
  };
  add("list", "Show all parameters with their values");
  for (const auto& [verb, help] : {std::pair{"get", "Show the value of a parameter"},
                                   {"describe", "Show type, range and meaning of a parameter"},
                                   {"set", "Change a parameter, until the node's next start"}}) {
    CLI::App* sub = add(verb, help);
    sub->add_option("name", a.name, "Parameter")->required();
    if (std::string(verb) != "set") continue;
    sub->add_option("value", a.value, "As in YAML: 5, true, text, [1, 2]")->required();
    sub->add_flag("--next-start", a.next_start, "Store it for the next start only, without a change now");
  }
  add("keep", "Keep present values across restarts of the node; guarded ones once they are confirmed")
      ->add_option("names", a.names, "Parameters; default: all that differ from the deployment");
  add("confirm", "Confirm the values on trial, and keep those that wait to be kept");
  add("history", "Show the last ten kept sets of values");
  add("restore", "Use the values of a set of the history, now and at the next starts")
      ->add_option("generation", a.generation, "Number of the set")
      ->required();
  add("reset", "Return to the deployment's values, now and at the next starts");
  add("forget", "Forget stored values; the next start uses those of the deployment")
      ->add_option("names", a.names, "Parameters; default: all");
}

int run_parameters(const Target& target, const ParameterArguments& a, bool json) {
  if (a.command->got_subcommand("list")) return list_parameters(target, a.node, json);
  if (a.command->got_subcommand("get")) return get_parameter(target, a.node, a.name, json);
  if (a.command->got_subcommand("describe")) return describe_parameter(target, a.node, a.name, json);
  if (a.command->got_subcommand("set"))
    return set_parameter(target, a.node, a.name, a.value, a.next_start, json);
  if (a.command->got_subcommand("keep")) return keep_parameters(target, a.node, a.names, json);
  if (a.command->got_subcommand("confirm")) return confirm_parameters(target, a.node, json);
  if (a.command->got_subcommand("history")) return show_parameter_history(target, a.node, json);
  if (a.command->got_subcommand("restore")) return restore_parameters(target, a.node, a.generation, json);
  if (a.command->got_subcommand("reset")) return reset_parameters(target, a.node, json);
  return forget_parameters(target, a.node, a.names, json);
}

/// What the command line of `srfs ring` and `srfs faults` says.
struct RingArguments {
  std::string node;
  std::string reason = "by the operator";
  std::string state;
  std::string since;
  CLI::App* ring = nullptr;
  CLI::App* faults = nullptr;
};

void add_ring_commands(CLI::App& app, RingArguments& a) {
  a.faults = app.add_subcommand("faults", "Show the fault ledger; also works when nothing runs");
  a.faults->add_option("--since", a.since, "A time (2026-11-21T08:00:00Z) or how long ago (90s, 15m, 2h)");
  a.faults->add_option("--node", a.node, "Only faults of this node");
  a.ring = app.add_subcommand("ring", "What the ring does with a node that dies");
  a.ring->require_subcommand(1);
  a.ring->add_subcommand("status", "Show deaths, back-off, quarantine and holds of every node");
  CLI::App* hold = a.ring->add_subcommand("hold", "Keep the node from being restarted until it is released");
  hold->add_option("node", a.node, "Node name")->required();
  hold->add_option("--reason", a.reason, "Note for the next operator")->capture_default_str();
  CLI::App* release = a.ring->add_subcommand("release", "Lift hold, back-off and quarantine");
  release->add_option("node", a.node, "Node name")->required();
  release->add_option("--state", a.state, "State of its next start; default: unchanged")
      ->check(CLI::IsMember({"active", "inactive", "unconfigured"}));
}

int run_ring(const Target& target, const RingArguments& a, bool json) {
  if (a.ring->got_subcommand("hold")) return hold_node(target, a.node, a.reason, json);
  if (a.ring->got_subcommand("release")) return release_node(target, a.node, a.state, json);
  return show_ring(target, json);
}

/// What the command line of `srfs versions` says.
struct VersionArguments {
  std::string node;
  std::string version;
  std::string file;
  std::string origin;
  bool check = false;
  std::optional<int> probation_s;
  CLI::App* command = nullptr;
};

void add_version_commands(CLI::App& app, VersionArguments& a) {
  a.command =
      app.add_subcommand("versions", "Versions of the nodes' programs; without a subcommand: list them");
  a.command->require_subcommand(0, 1);
  a.command->add_option("--node", a.node, "Only this node");
  a.command->add_flag("--check", a.check,
                      "Compare the programs with their SHA-256; exit code 1: one is damaged");
  const auto add = [&](const char* name, const char* help, const char* version) {
    CLI::App* sub = a.command->add_subcommand(name, help);
    sub->add_option("node", a.node, "Node name")->required();
    if (version != nullptr) sub->add_option("version", a.version, version)->required();
    return sub;
  };
  CLI::App* store = add("add", "Store a program as a version; it is not started", nullptr);
  store->add_option("file", a.file, "Program")->required();
  store->add_option("--origin", a.origin, "Origin shown in the list; default: the file's path");
  add("use", "Restart the node in a version, on probation unless it is golden or the last good one",
      "Number, golden or previous")
      ->add_option("--probation", a.probation_s,
                   "Seconds; if the node dies within this time, the last good version returns. Default: 300, "
                   "or 1800 for nodes whose versions must be confirmed")
      ->check(CLI::Range(1, static_cast<int>(update::VersionTable::longest_probation / seconds(1))));
  add("confirm", "End a probation with success: it becomes the last good version", "Number");
  add("remove", "Remove a version; not the active or the last good one", "Number");
}

int run_versions(const Target& target, const VersionArguments& a, bool json) {
  if (a.command->got_subcommand("add")) return add_version(target, a.node, a.file, a.origin, json);
  if (a.command->got_subcommand("use"))
    return use_version(target, a.node, a.version,
                       a.probation_s ? std::optional(seconds(*a.probation_s)) : std::nullopt, json);
  if (a.command->got_subcommand("confirm")) return confirm_version(target, a.node, a.version, json);
  if (a.command->got_subcommand("remove")) return remove_version(target, a.node, a.version, json);
  return show_versions(target, a.node, a.check, json);
}

/// What the command line of `srfs node` says.
struct NodeArguments {
  std::string node;
  std::string folder;
  std::string program;
  int probation_s = 0;
  CLI::App* command = nullptr;
};

void add_node_commands(CLI::App& app, NodeArguments& a) {
  a.command = app.add_subcommand("node", "Nodes added to the suite, besides those of the deployment");
  a.command->require_subcommand(1);
  CLI::App* add =
      a.command->add_subcommand("add", "Add a node to the suite, also to a running one, and start it");
  add->add_option("folder", a.folder, "Folder with package.yaml, the manifest of the node's package")
      ->required()
      ->check(CLI::ExistingDirectory);
  add->add_option("--program", a.program, "Its program, which becomes its active version")
      ->required()
      ->check(CLI::ExistingFile);
  add->add_option("--probation", a.probation_s, "Seconds; 0: none. A node that dies on probation stays down")
      ->check(CLI::Range(0, static_cast<int>(update::VersionTable::longest_probation / seconds(1))))
      ->capture_default_str();
  a.command->add_subcommand("remove", "Stop an added node and remove it from the suite")
      ->add_option("node", a.node, "Node name")
      ->required();
  a.command->add_subcommand("list", "List the added nodes");
}

int run_node_command(const Target& target, const NodeArguments& a, bool json) {
  if (a.command->got_subcommand("add"))
    return add_node(target, a.folder, a.program, seconds(a.probation_s), json);
  if (a.command->got_subcommand("remove")) return remove_node(target, a.node, json);
  return list_added_nodes(target, json);
}

/// What `--deployment` means: a file, or the name of one in launch_config here, of the installation, or of
/// the tree that this was built from.
std::string deployment_file_of(const std::string& named) {
  namespace fs = std::filesystem;
  const fs::path file = "launch_config/" + named + ".yaml";
  const fs::path installed = ros::suite_bin_folder().parent_path() / "share/srfs" / file;
  std::error_code ec;
  if (named.find('/') != std::string::npos || fs::is_regular_file(named, ec)) return named;
  const fs::path source = SRFS_LAUNCH_SOURCE_DIR "/" + named + ".yaml";
  for (const fs::path& candidate : {file, installed, source})
    if (fs::is_regular_file(candidate, ec)) return candidate;
  return named;
}

constexpr const char* doctor_help =
    "Check whether this machine is ready for the deployment. One line per check: OK, note, unknown, WARN or "
    "FAIL, what was found, what is expected, and the command that fixes it. Starts and changes nothing. "
    "--deployment, --var and --json as for every command. Exit code 0: no FAIL; 1: at least one";

int run(int argc, char** argv) {
  CLI::App app{"Starts, stops and shows a deployment of SRFS."};
  app.require_subcommand(1);
  app.fallthrough();
  app.set_version_flag("--version", ros::version());
  std::string deployment_file = "sim";
  std::string var = "var";
  bool json = false;
  app.add_option("--deployment", deployment_file, "Deployment file, or its name: sim")
      ->capture_default_str()
      ->envname("SRFS_DEPLOYMENT");
  app.add_option("--var", var, "Folder of the running deployment")
      ->capture_default_str()
      ->envname("SRFS_VAR");
  app.add_flag("--json", json, "Machine-readable output");

  UpOptions up_options;
  bool only_if_up = false;
  int deadline_s = 15;
  int patience_ms = 3000;
  std::string node;
  std::string label;
  int duration_s = 0;
  int transition_ms = 2000;
  auto* up_command = app.add_subcommand("up",
                                        "Start all nodes, those that flight needs first; wait until these "
                                        "are in their desired state, then exit");
  up_command
      ->add_option("--domain", up_options.domain,
                   "DDS domain; default: the deployment's, or the first free from 42")
      ->check(CLI::Range(0, 101));
  up_command
      ->add_option("--deadline", deadline_s,
                   "Seconds to wait without progress of an awaited node; ten times as long in all")
      ->check(CLI::Range(1, 600))
      ->capture_default_str();
  up_command->add_option("--only", up_options.only, "Start only these nodes; a ring starts the others");
  up_command->add_flag("--all", up_options.all, "Wait also for nodes that flight does not need");
  auto* down_command = app.add_subcommand("down", "Stop all nodes in reverse order");
  down_command
      ->add_option("--patience", patience_ms,
                   "Milliseconds before SIGKILL, not counting time in which a node waits for a CPU")
      ->check(CLI::Range(10, 60000))
      ->capture_default_str();
  auto* restart_command =
      app.add_subcommand("restart", "Down and up again, as after a reset of the computer");
  restart_command->add_flag(
      "--if-up", only_if_up,
      "Do nothing if the suite was stopped by `srfs down`: for a watchdog, whose order may come late");
  restart_command->add_option("--cause", up_options.cause, "Cause to write into the nodes' start records")
      ->default_str("restart by command");
  auto* status_command =
      app.add_subcommand("status", "Show lifecycle state, pid, incarnation, version, restarts of every node");
  auto* lifecycle_command = app.add_subcommand("lifecycle", "Request a lifecycle transition");
  lifecycle_command->add_option("node", node, "Node name")->required();
  lifecycle_command->add_option("transition", label, "configure, activate, deactivate, cleanup or shutdown")
      ->required()
      ->check(CLI::IsMember({"configure", "activate", "deactivate", "cleanup", "shutdown"}));
  lifecycle_command
      ->add_option("--deadline", transition_ms,
                   "Milliseconds to wait for its end; exit code 3 if it is still running then")
      ->check(CLI::Range(1, 600000))
      ->capture_default_str();
  bool reset = false;
  auto* stats_command =
      app.add_subcommand("stats", "Show run times of a node's callbacks and losses at its inputs");
  stats_command->add_option("node", node, "Node name")->required();
  stats_command->add_flag("--reset", reset, "Reset the counters afterwards");
  ParameterArguments parameters;
  add_parameter_commands(app, parameters);
  RingArguments ring;
  add_ring_commands(app, ring);
  VersionArguments versions;
  add_version_commands(app, versions);
  NodeArguments nodes;
  add_node_commands(app, nodes);
  auto* doctor_command = app.add_subcommand("doctor", doctor_help);
  auto* record_command = app.add_subcommand("record", "Print what the nodes publish as JSON lines");
  record_command->add_option("--duration", duration_s, "Seconds; 0: until Ctrl-C")
      ->check(CLI::Range(0, 86400))
      ->capture_default_str();
  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& e) {
    return app.exit(e) == 0 ? 0 : static_cast<int>(CommandExit::usage);
  }

  deployment_file = deployment_file_of(deployment_file);
  const ros::VarPaths paths = ros::VarPaths::at(var);
  auto reading = ros::load_deployment(deployment_file, paths);
  for (const std::string& problem : reading.problems) fmt::print(stderr, "srfs: {}\n", problem);
  const Target target{std::move(reading.deployment), paths};
  if (*doctor_command) return doctor(target.deployment, target.var.root, json);
  up_options.deadline = seconds(deadline_s);
  for (const std::string& name : up_options.only) {
    if (target.deployment.find(name) == nullptr)
      throw ConfigError(fmt::format("{}: 'nodes': expected a node named '{}'", deployment_file, name));
  }
  if (*up_command) return show_up(up(target, up_options), json);
  if (*down_command) return show_down(down(target, milliseconds(patience_ms)), json);
  if (*status_command) return run_status(target, json);
  if (*lifecycle_command) return change_state(target, node, label, milliseconds(transition_ms), json);
  if (*stats_command) return show_statistics(target, node, reset, json);
  if (*parameters.command) return run_parameters(target, parameters, json);
  if (*ring.ring) return run_ring(target, ring, json);
  if (*ring.faults) return show_faults(target, ring.since, ring.node, json);
  if (*versions.command) return run_versions(target, versions, json);
  if (*nodes.command) return run_node_command(target, nodes, json);
  if (*record_command) return record(target, seconds(duration_s));
  if (*restart_command) return run_restart(target, up_options, only_if_up, json);
  return 2;
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
