// The engineer's command: start, stop and look at a deployment.

#include <cstdio>
#include <iostream>

#include <fmt/format.h>
#include <CLI/CLI.hpp>
#include <nlohmann/json.hpp>

#include "base/log.hpp"
#include "ros/run_node.hpp"
#include "tools/srfs/observer.hpp"
#include "tools/srfs/suite.hpp"

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
}

int run_up(const Target& target, const UpOptions& options, bool json) {
  const UpReport report = up(target, options);
  if (json) {
    std::cout << Json{{"ok", report.all_reached},
                      {"took_ms", report.took.count()},
                      {"domain", report.domain},
                      {"problems", report.problems},
                      {"nodes", to_json(report.nodes)}}
                     .dump()
              << "\n";
  } else {
    for (const std::string& problem : report.problems) fmt::print(stderr, "srfs up: {}\n", problem);
    if (report.all_reached) {
      fmt::print(
          "{} nodes up in {} ms, DDS domain {} (export ROS_DOMAIN_ID={} ROS_LOCALHOST_ONLY=1 to look at them "
          "with ROS 2)\n",
          report.nodes.size(), report.took.count(), report.domain, report.domain);
    }
  }
  return report.all_reached ? 0 : 1;
}

int run_down(const Target& target, int patience_ms, bool json) {
  const DownReport report = down(target, milliseconds(patience_ms));
  if (json) {
    std::cout << Json{{"ok", report.left.empty()}, {"killed", report.killed}, {"left", report.left}}.dump()
              << "\n";
  } else {
    for (const std::string& name : report.killed)
      fmt::print(stderr, "srfs down: {} did not stop in time and was killed\n", name);
    for (const std::string& name : report.left) fmt::print(stderr, "srfs down: {} is still there\n", name);
  }
  return report.left.empty() ? 0 : 1;
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

int run_transition(const Target& target, const std::string& node, const std::string& label, bool json) {
  if (target.deployment.find(node) == nullptr) {
    fmt::print(stderr, "srfs lifecycle: {} has no node '{}'\n", target.deployment.file.string(), node);
    return 2;
  }
  const TransitionOutcome outcome = transition(target, node, label, milliseconds(3000));
  if (json) {
    std::cout << Json{{"ok", outcome.success},
                      {"node", node},
                      {"state", outcome.state},
                      {"error", outcome.error}}
                     .dump()
              << "\n";
  } else if (outcome.success) {
    fmt::print("/{} is {}\n", node, outcome.state);
  } else {
    fmt::print(stderr, "srfs lifecycle: {}\n", outcome.error);
  }
  return outcome.success ? 0 : 1;
}

int run(int argc, char** argv) {
  CLI::App app{"Starts, stops and shows a deployment of SRFS."};
  app.require_subcommand(1);
  app.fallthrough();
  app.set_version_flag("--version", ros::version());
  std::string deployment_file = "launch_config/sim.yaml";
  std::string var = "var";
  bool json = false;
  app.add_option("--deployment", deployment_file, "Deployment file")->capture_default_str();
  app.add_option("--var", var, "Folder of the running deployment")->capture_default_str();
  app.add_flag("--json", json, "Machine-readable output");

  UpOptions up_options;
  int deadline_s = 15;
  int patience_ms = 3000;
  std::string node;
  std::string label;
  int duration_s = 0;
  auto* up_command = app.add_subcommand(
      "up", "Start all nodes in list order, wait until they are in their desired state, exit");
  up_command
      ->add_option("--domain", up_options.domain,
                   "DDS domain; default: the deployment's, or the first free from 42")
      ->check(CLI::Range(0, 101));
  up_command->add_option("--deadline", deadline_s, "Seconds to wait")
      ->check(CLI::Range(1, 600))
      ->capture_default_str();
  auto* down_command = app.add_subcommand("down", "Stop all nodes in reverse order");
  down_command->add_option("--patience", patience_ms, "Milliseconds before SIGKILL")
      ->check(CLI::Range(10, 60000))
      ->capture_default_str();
  auto* restart_command =
      app.add_subcommand("restart", "down and up again, as after a reset of the computer");
  restart_command->add_option("--cause", up_options.cause, "Cause written into the nodes' start records")
      ->default_str("restart by command");
  auto* status_command =
      app.add_subcommand("status", "Lifecycle state, pid, incarnation, version, restarts of every node");
  auto* lifecycle_command = app.add_subcommand("lifecycle", "Request a lifecycle transition");
  lifecycle_command->add_option("node", node, "Node name")->required();
  lifecycle_command->add_option("transition", label, "configure, activate, deactivate, cleanup or shutdown")
      ->required()
      ->check(CLI::IsMember({"configure", "activate", "deactivate", "cleanup", "shutdown"}));
  auto* record_command = app.add_subcommand("record", "Print what the nodes publish as JSON lines");
  record_command->add_option("--duration", duration_s, "Seconds; 0: until Ctrl-C")
      ->check(CLI::Range(0, 86400))
      ->capture_default_str();
  CLI11_PARSE(app, argc, argv);

  const Target target{ros::Deployment::load(deployment_file), ros::VarPaths{std::filesystem::absolute(var)}};
  up_options.deadline = seconds(deadline_s);
  if (*up_command) return run_up(target, up_options, json);
  if (*down_command) return run_down(target, patience_ms, json);
  if (*status_command) return run_status(target, json);
  if (*lifecycle_command) return run_transition(target, node, label, json);
  if (*record_command) return record(target, seconds(duration_s));
  if (*restart_command) {
    if (up_options.cause == "up") up_options.cause = "restart by command";
    if (const auto domain = running_domain(target)) {
      if (auto lock = ros::DomainLock::share(*domain)) {
        up_options.held_domain = std::make_shared<ros::DomainLock>(std::move(*lock));
      }
    }
    const int stopped = run_down(target, 500, false);
    return stopped != 0 ? stopped : run_up(target, up_options, json);
  }
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
