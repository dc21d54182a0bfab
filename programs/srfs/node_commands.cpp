// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "programs/srfs/node_commands.hpp"

#include <algorithm>
#include <iostream>

#include <fmt/format.h>
#include <fmt/ranges.h>
#include <yaml-cpp/yaml.h>
#include <lifecycle_msgs/srv/change_state.hpp>
#include <nlohmann/json.hpp>
#include <rcl_interfaces/srv/describe_parameters.hpp>
#include <rcl_interfaces/srv/get_parameters.hpp>
#include <rcl_interfaces/srv/list_parameters.hpp>
#include <rcl_interfaces/srv/set_parameters.hpp>
#include <srfs_msgs/srv/get_executor_statistics.hpp>
#include <srfs_msgs/srv/get_node_status.hpp>
#include <srfs_msgs/srv/save_parameters.hpp>

#include "programs/srfs/bus.hpp"
#include "programs/srfs/ring_commands.hpp"
#include "ros/callback_statistics.hpp"
#include "ros/datagram_seal.hpp"
#include "ros/lifecycle.hpp"
#include "ros/parameters.hpp"
#include "suite/command_keys.hpp"
#include "suite/ring/heartbeat_page.hpp"

namespace srfs::tool {
namespace {

using lifecycle_msgs::srv::ChangeState;
using ros::ParameterValue;
using srfs_msgs::srv::GetExecutorStatistics;
using srfs_msgs::srv::GetNodeStatus;
using srfs_msgs::srv::SaveParameters;

constexpr milliseconds answer_deadline{2000};
constexpr milliseconds discovery_deadline{5000};

int code(CommandExit e) {
  return static_cast<int>(e);
}

/// The bus of the running suite, or why a command cannot reach the node.
struct Reach {
  std::unique_ptr<Bus> bus;
  std::string problem;
  CommandExit exit = CommandExit::done;
};

Reach reach(const Target& target, const std::string& node) {
  Reach r;
  const auto domain = running_domain(target);
  if (target.deployment.find(node) == nullptr) {
    r.problem = fmt::format("{} has no node '{}'", target.deployment.file.string(), node);
    r.exit = CommandExit::usage;
  } else if (!domain) {
    r.problem = "the suite is not running (no " + target.var.domain_file().string() + ")";
    r.exit = CommandExit::no_answer;
  } else {
    r.bus = std::make_unique<Bus>(target, *domain);
  }
  return r;
}

/// Why the nodes obey no order of this user; empty: they do.
std::string why_foreign(const Target& target) {
  if (target.deployment.open_orders || ros::datagram_seal()) return {};
  return fmt::format(
      "dds.orders is proven, and this user cannot read the suite's keys in {}: run srfs as the user that the "
      "suite runs as",
      suite::order_keys(target.var).string());
}

Json to_json(const ParameterValue& value) {
  return std::visit([](const auto& v) { return Json(v); }, value);
}

std::string to_text(const ParameterValue& value) {
  return to_json(value).dump(-1, ' ', false, Json::error_handler_t::replace);
}

/// @param like  a value of the type that is wanted. Throws YAML::Exception when the text is no such value
ParameterValue parse_value(const std::string& text, const ParameterValue& like) {
  const YAML::Node node = YAML::Load(text);
  return std::visit([&](const auto& v) { return ParameterValue(node.as<std::decay_t<decltype(v)>>()); },
                    like);
}

/// The values of some parameters, or an answer with an exit code.
Result<std::vector<std::optional<ParameterValue>>, ros::CallError> values_of(
    Bus& bus, const std::string& node, const std::vector<std::string>& names) {
  rcl_interfaces::srv::GetParameters_Request request;
  request.names = names;
  const auto answer =
      bus.ask<rcl_interfaces::srv::GetParameters>("/" + node + "/get_parameters", request, answer_deadline);
  if (!answer) return Err(answer.error());
  std::vector<std::optional<ParameterValue>> values;
  for (const auto& value : answer->values) values.push_back(ros::from_message(value));
  values.resize(names.size());
  return values;
}

std::string no_answer(const std::string& node, ros::CallError error) {
  return fmt::format("/{}: {}", node, ros::to_text(error));
}

Result<ChangeState::Response, ros::CallError> request_transition(Bus& bus, const std::string& node,
                                                                 const std::string& label,
                                                                 milliseconds deadline) {
  const auto client = bus.client<ChangeState>("/" + node + "/change_state");
  bus.executor.spin_until([&] { return client->is_ready(); }, monotonic_now() + discovery_deadline);
  ChangeState::Request request;
  request.transition.label = label;
  std::optional<Result<ChangeState::Response, ros::CallError>> answer;
  client->call(request, deadline, 1, [&](const auto& a) { answer = a; });
  bus.executor.spin_until([&] { return answer.has_value(); }, monotonic_now() + deadline + seconds(1));
  if (!answer) return Err(ros::CallError::timeout);
  return *answer;
}

/// What the node wrote into its page. Also works while the node's thread is busy with a transition and does
/// not answer.
ros::State state_in_memory(const Target& target, const std::string& node) {
  const auto page = suite::HeartbeatPage::read(target.var, node);
  return page ? static_cast<ros::State>(page->state) : ros::State::unknown;
}

int print_outcome(const std::string& node, const std::string& state, CommandExit exit, const std::string& why,
                  bool json) {
  if (json) {
    print({{"ok", exit == CommandExit::done}, {"node", node}, {"state", state}, {"error", why}});
  } else if (exit == CommandExit::done) {
    fmt::print("/{} is {}\n", node, state);
  } else {
    fmt::print(stderr, "srfs lifecycle: {}\n", why);
  }
  return code(exit);
}

Json to_json(const srfs_msgs::msg::CallbackStatistics& s) {
  return {{"kind", ros::to_text(static_cast<ros::CallbackKind>(s.kind))},
          {"name", s.name},
          {"count", s.count},
          {"p50_us", s.p50_us},
          {"p99_us", s.p99_us},
          {"max_us", s.max_us},
          {"total_us", s.total_us},
          {"budget_us", s.budget_us},
          {"over_budget", s.over_budget},
          {"failed", s.failed},
          {"missed_periods", s.missed_periods}};
}

void print_statistics(const std::string& node, const GetExecutorStatistics::Response& all) {
  const double share = all.counted_for_ns == 0 ? 0.0
                                               : 100.0 * static_cast<double>(all.busy_ns) /
                                                     static_cast<double>(all.counted_for_ns);
  fmt::print("/{}: {:.1f} s counted, {:.2f} % in callbacks, {} timer periods missed, {} posts refused\n",
             node, static_cast<double>(all.counted_for_ns) * 1e-9, share, all.missed_timer_periods,
             all.refused_posts);
  fmt::print("{:<13}{:<34}{:>10}{:>9}{:>9}{:>9}{:>10}{:>6}{:>7}\n", "KIND", "CALLBACK", "COUNT", "P50 us",
             "P99 us", "MAX us", "BUDGET us", "OVER", "FAILED");
  for (const auto& s : all.callbacks) {
    if (s.count == 0) continue;
    fmt::print("{:<13}{:<34}{:>10}{:>9}{:>9}{:>9}{:>10}{:>6}{:>7}\n",
               ros::to_text(static_cast<ros::CallbackKind>(s.kind)), s.name, s.count, s.p50_us, s.p99_us,
               s.max_us, s.budget_us, s.over_budget, s.failed);
  }
  fmt::print("{:<47}{:>10}{:>9}{:>9}{:>9}{:>9}{:>9}{:>11}{:>9}\n", "INPUT", "RECEIVED", "LOST", "BAD",
             "FOREIGN", "REPEATS", "REFUSED", "UNANSWERED", "WRITERS");
  for (const auto& i : all.inputs) {
    if (i.received + i.lost + i.malformed + i.foreign + i.refused == 0) continue;
    fmt::print("{:<47}{:>10}{:>9}{:>9}{:>9}{:>9}{:>9}{:>11}{:>9}\n", i.name, i.received, i.lost, i.malformed,
               i.foreign, i.repeats, i.refused, i.unanswered, i.matched);
  }
}

Json history_of(const SaveParameters::Response& said) {
  Json history = Json::array();
  for (const auto& g : said.history) {
    history.push_back({{"generation", g.number},
                       {"saved", g.saved},
                       {"origin", g.origin},
                       {"values", g.count},
                       {"content", g.values}});
  }
  return history;
}

void print_trial(const SaveParameters::Response& said) {
  if (said.on_trial.empty()) return;
  fmt::print("on trial for {:.1f} s: {} (srfs param confirm)\n",
             static_cast<double>(said.trial_left_ms) * 1e-3, fmt::join(said.on_trial, ", "));
}

int save(const Target& target, const std::string& node, SaveParameters::Request request, bool json) {
  const Reach r = reach(target, node);
  if (!r.bus) return fail(r.exit, r.problem, json);
  request.origin = "srfs param";
  const auto answer = r.bus->ask<SaveParameters>("/" + node + "/save_parameters", request, answer_deadline);
  if (!answer) return fail(CommandExit::no_answer, no_answer(node, answer.error()), json);
  if (!answer->success) {
    const std::string foreign = why_foreign(target);
    return fail(CommandExit::refused,
                fmt::format("/{}: {}", node, foreign.empty() ? answer->reason : foreign), json);
  }
  if (json) {
    print({{"ok", true},
           {"stored", answer->stored},
           {"on_trial", answer->on_trial},
           {"trial_left_ms", answer->trial_left_ms},
           {"history", history_of(*answer)}});
    return code(CommandExit::done);
  }
  if (request.operation == SaveParameters::Request::REPORT) {
    fmt::print("{:<11}{:<22}{:>7}  {:<32}{}\n", "GENERATION", "SAVED", "VALUES", "ORIGIN", "CONTENT");
    for (const auto& g : answer->history)
      fmt::print("{:<11}{:<22}{:>7}  {:<32}{}\n", g.number, g.saved, g.count, g.origin, g.values);
  } else {
    fmt::print("stored for the next start of /{}: {}\n", node,
               answer->stored.empty() ? "nothing" : fmt::format("{}", fmt::join(answer->stored, ", ")));
  }
  print_trial(*answer);
  return code(CommandExit::done);
}

SaveParameters::Request request_of(std::uint8_t operation, const std::vector<std::string>& names = {}) {
  SaveParameters::Request request;
  request.operation = operation;
  request.names = names;
  return request;
}

}  // namespace

int change_state(const Target& target, const std::string& node, const std::string& label,
                 milliseconds deadline, bool json) {
  const Reach r = reach(target, node);
  if (!r.bus) return fail(r.exit, r.problem, json);
  const auto answer = request_transition(*r.bus, node, label, deadline);
  if (!answer) {
    const ros::State state = state_in_memory(target, node);
    const std::string name(ros::label(state));
    if (state == ros::State::unknown || ros::is_primary(state))
      return print_outcome(node, name, CommandExit::no_answer, no_answer(node, answer.error()), json);
    return print_outcome(node, name, CommandExit::still_running,
                         fmt::format("/{} is still {} after {:.1f} s", node, name,
                                     static_cast<double>(deadline.count()) * 1e-3),
                         json);
  }
  const auto status = r.bus->ask<GetNodeStatus>("/" + node + "/get_status", {}, answer_deadline);
  const std::string state = status ? status->state_label : "not answering";
  if (answer->success) {
    const bool rests =
        state == ros::label(ros::State::inactive) || state == ros::label(ros::State::unconfigured);
    if (const std::string hint = end_of_order_text(target.deployment, node);
        !json && rests && !hint.empty()) {
      fmt::print("/{} is {}{}\n", node, state, hint);
      return code(CommandExit::done);
    }
    return print_outcome(node, state, CommandExit::done, "", json);
  }
  if (const std::string foreign = why_foreign(target); !foreign.empty())
    return print_outcome(node, state, CommandExit::refused,
                         fmt::format("/{} refused '{}' and is {}: {}", node, label, state, foreign), json);
  const bool refused = status && status->last_outcome == GetNodeStatus::Response::REFUSED;
  return print_outcome(node, state, CommandExit::refused,
                       fmt::format("/{} {} '{}' and is {}: {}", node, refused ? "refused" : "failed to",
                                   label, state, status ? status->last_reason : "no reason given"),
                       json);
}

int show_statistics(const Target& target, const std::string& node, bool reset, bool json) {
  const Reach r = reach(target, node);
  if (!r.bus) return fail(r.exit, r.problem, json);
  GetExecutorStatistics::Request request;
  request.reset = reset;
  auto answer =
      r.bus->ask<GetExecutorStatistics>("/" + node + "/get_executor_statistics", request, answer_deadline);
  if (!answer) return fail(CommandExit::no_answer, no_answer(node, answer.error()), json);
  std::sort(answer->callbacks.begin(), answer->callbacks.end(),
            [](const auto& a, const auto& b) { return a.total_us > b.total_us; });
  if (!json) {
    print_statistics(node, *answer);
    return code(CommandExit::done);
  }
  Json callbacks = Json::array();
  for (const auto& s : answer->callbacks) callbacks.push_back(to_json(s));
  Json inputs = Json::array();
  for (const auto& i : answer->inputs) {
    inputs.push_back({{"name", i.name},
                      {"received", i.received},
                      {"lost", i.lost},
                      {"malformed", i.malformed},
                      {"foreign", i.foreign},
                      {"repeats", i.repeats},
                      {"refused", i.refused},
                      {"unanswered", i.unanswered},
                      {"matched", i.matched}});
  }
  print({{"ok", true},
         {"node", node},
         {"counted_for_ns", answer->counted_for_ns},
         {"busy_ns", answer->busy_ns},
         {"missed_timer_periods", answer->missed_timer_periods},
         {"refused_posts", answer->refused_posts},
         {"callbacks", callbacks},
         {"inputs", inputs}});
  return code(CommandExit::done);
}

int list_parameters(const Target& target, const std::string& node, bool json) {
  const Reach r = reach(target, node);
  if (!r.bus) return fail(r.exit, r.problem, json);
  const auto list =
      r.bus->ask<rcl_interfaces::srv::ListParameters>("/" + node + "/list_parameters", {}, answer_deadline);
  if (!list) return fail(CommandExit::no_answer, no_answer(node, list.error()), json);
  const auto values = values_of(*r.bus, node, list->result.names);
  if (!values) return fail(CommandExit::no_answer, no_answer(node, values.error()), json);
  Json all = Json::object();
  for (std::size_t i = 0; i < values->size(); ++i) {
    const auto& value = (*values)[i];
    all[list->result.names[i]] = value ? to_json(*value) : Json(nullptr);
  }
  if (json) {
    print({{"ok", true}, {"parameters", all}});
  } else {
    for (const auto& [name, value] : all.items()) fmt::print("{:<32} {}\n", name, value.dump());
  }
  return code(CommandExit::done);
}

int get_parameter(const Target& target, const std::string& node, const std::string& name, bool json) {
  const Reach r = reach(target, node);
  if (!r.bus) return fail(r.exit, r.problem, json);
  const auto values = values_of(*r.bus, node, {name});
  if (!values) return fail(CommandExit::no_answer, no_answer(node, values.error()), json);
  const auto& value = values->front();
  if (!value) return fail(CommandExit::usage, fmt::format("/{} has no parameter '{}'", node, name), json);
  if (json) {
    print({{"ok", true}, {"name", name}, {"type", ros::type_text(*value)}, {"value", to_json(*value)}});
  } else {
    fmt::print("{}\n", to_text(*value));
  }
  return code(CommandExit::done);
}

namespace {

Json description_of(const rcl_interfaces::msg::ParameterDescriptor& d, const ParameterValue& value) {
  Json j{{"name", d.name},           {"type", ros::type_text(value)},
         {"value", to_json(value)},  {"description", d.description},
         {"read_only", d.read_only}, {"constraints", d.additional_constraints}};
  for (const auto& range : d.integer_range)
    j["range"] = {{"from", range.from_value}, {"to", range.to_value}, {"step", range.step}};
  for (const auto& range : d.floating_point_range)
    j["range"] = {{"from", range.from_value}, {"to", range.to_value}, {"step", range.step}};
  return j;
}

/// @param name  empty: the names of all parameters of the node
Result<std::vector<std::string>, ros::CallError> names_or_all(Bus& bus, const std::string& node,
                                                              const std::string& name) {
  if (!name.empty()) return std::vector{name};
  auto list =
      bus.ask<rcl_interfaces::srv::ListParameters>("/" + node + "/list_parameters", {}, answer_deadline);
  if (!list) return Err(list.error());
  return std::move(list->result.names);
}

void print_description(const Json& description) {
  for (const auto& [key, value] : description.items())
    fmt::print("{:<12} {}\n", key, value.dump(-1, ' ', false, Json::error_handler_t::replace));
}

}  // namespace

int describe_parameter(const Target& target, const std::string& node, const std::string& name, bool json) {
  const Reach r = reach(target, node);
  if (!r.bus) return fail(r.exit, r.problem, json);
  const auto names = names_or_all(*r.bus, node, name);
  if (!names) return fail(CommandExit::no_answer, no_answer(node, names.error()), json);
  rcl_interfaces::srv::DescribeParameters_Request request;
  request.names = *names;
  const auto answer = r.bus->ask<rcl_interfaces::srv::DescribeParameters>("/" + node + "/describe_parameters",
                                                                          request, answer_deadline);
  if (!answer) return fail(CommandExit::no_answer, no_answer(node, answer.error()), json);
  const auto values = values_of(*r.bus, node, *names);
  if (!values) return fail(CommandExit::no_answer, no_answer(node, values.error()), json);
  Json list = Json::array();
  for (std::size_t i = 0; i < std::min(answer->descriptors.size(), values->size()); ++i)
    if (const auto& value = (*values)[i]) list.push_back(description_of(answer->descriptors[i], *value));
  if (!name.empty() && list.empty())
    return fail(CommandExit::usage, fmt::format("/{} has no parameter '{}'", node, name), json);
  if (!json) {
    for (std::size_t i = 0; i < list.size(); ++i) {
      if (i > 0) fmt::print("\n");
      print_description(list[i]);
    }
  } else if (name.empty()) {
    print({{"ok", true}, {"parameters", list}});
  } else {
    list.front()["ok"] = true;
    print(list.front());
  }
  return code(CommandExit::done);
}

int set_parameter(const Target& target, const std::string& node, const std::string& name,
                  const std::string& text, bool next_start, bool json) {
  const Reach r = reach(target, node);
  if (!r.bus) return fail(r.exit, r.problem, json);
  const auto values = values_of(*r.bus, node, {name});
  if (!values) return fail(CommandExit::no_answer, no_answer(node, values.error()), json);
  const auto& present = values->front();
  if (!present) return fail(CommandExit::usage, fmt::format("/{} has no parameter '{}'", node, name), json);
  rcl_interfaces::msg::Parameter parameter;
  parameter.name = name;
  try {
    parameter.value = ros::to_message(parse_value(text, *present));
  } catch (const YAML::Exception&) {
    return fail(
        CommandExit::usage,
        fmt::format("'{}' is not {}, the type of parameter '{}'", text, ros::type_text(*present), name),
        json);
  }
  if (next_start) {
    SaveParameters::Request request;
    request.values = {parameter};
    return save(target, node, request, json);
  }
  rcl_interfaces::srv::SetParameters_Request request;
  request.parameters = {parameter};
  const auto answer = r.bus->ask<rcl_interfaces::srv::SetParameters>("/" + node + "/set_parameters", request,
                                                                     answer_deadline);
  if (!answer) return fail(CommandExit::no_answer, no_answer(node, answer.error()), json);
  if (answer->results.empty() || !answer->results.front().successful) {
    const std::string foreign = why_foreign(target);
    const std::string reason =
        answer->results.empty() ? "the node returned no result" : answer->results.front().reason;
    return fail(CommandExit::refused, foreign.empty() ? reason : fmt::format("{}: {}", reason, foreign),
                json);
  }
  if (json) print({{"ok", true}});
  return code(CommandExit::done);
}

int keep_parameters(const Target& target, const std::string& node, const std::vector<std::string>& names,
                    bool json) {
  return save(target, node, request_of(SaveParameters::Request::KEEP, names), json);
}

int forget_parameters(const Target& target, const std::string& node, const std::vector<std::string>& names,
                      bool json) {
  return save(target, node, request_of(SaveParameters::Request::FORGET, names), json);
}

int confirm_parameters(const Target& target, const std::string& node, bool json) {
  return save(target, node, request_of(SaveParameters::Request::CONFIRM), json);
}

int restore_parameters(const Target& target, const std::string& node, std::uint32_t generation, bool json) {
  SaveParameters::Request request = request_of(SaveParameters::Request::RESTORE);
  request.generation = generation;
  return save(target, node, request, json);
}

int reset_parameters(const Target& target, const std::string& node, bool json) {
  return save(target, node, request_of(SaveParameters::Request::RESET), json);
}

int show_parameter_history(const Target& target, const std::string& node, bool json) {
  return save(target, node, request_of(SaveParameters::Request::REPORT), json);
}

}  // namespace srfs::tool
