// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "ros/node.hpp"

#include <fmt/format.h>
#include <lifecycle_msgs/msg/transition_event.hpp>
#include <lifecycle_msgs/srv/change_state.hpp>
#include <lifecycle_msgs/srv/get_available_states.hpp>
#include <lifecycle_msgs/srv/get_available_transitions.hpp>
#include <lifecycle_msgs/srv/get_state.hpp>
#include <rcl_interfaces/srv/describe_parameters.hpp>
#include <rcl_interfaces/srv/get_parameter_types.hpp>
#include <rcl_interfaces/srv/get_parameters.hpp>
#include <rcl_interfaces/srv/list_parameters.hpp>
#include <rcl_interfaces/srv/set_parameters.hpp>
#include <rcl_interfaces/srv/set_parameters_atomically.hpp>

#include <mission/structures.hpp>

#include "base/excerpt.hpp"
#include "base/file.hpp"
#include "ros/added_nodes.hpp"
#include "ros/mission_time.hpp"
#include "ros/node_introspection.hpp"
#include "ros/real_time.hpp"
#include "ros/ring/check_alive.hpp"
#include "ros/ring/heartbeat_page.hpp"
#include "ros/ring/node_record.hpp"

namespace srfs::ros {
namespace {

namespace lc = lifecycle_msgs;
namespace rcl = rcl_interfaces;

constexpr Qos parameter_qos{.depth = 1000};
constexpr std::uint32_t most_events_per_s = 20;
constexpr std::size_t longest_function = 100;
constexpr seconds input_check_period{10};
constexpr seconds start_report_delay{
    2};  // discovery needs a moment: an event raised at once would reach no reader

lc::msg::State state_message(State state) {
  lc::msg::State m;
  m.id = static_cast<std::uint8_t>(state);
  m.label = std::string(label(state));
  return m;
}

lc::msg::TransitionDescription describe(const LifecycleRow& row) {
  lc::msg::TransitionDescription d;
  d.transition.id = row.transition_id;
  d.transition.label = std::string(row.label);
  d.start_state = state_message(row.from);
  d.goal_state = state_message(row.to);
  return d;
}

}  // namespace

/// The endpoints every node has.
struct LifecycleNode::Interfaces {
  std::shared_ptr<Publisher<lc::msg::TransitionEvent>> transition_event;
  std::shared_ptr<Publisher<rcl::msg::ParameterEvent>> parameter_events;
  std::shared_ptr<Publisher<rcl::msg::Log>> rosout;
  std::shared_ptr<Publisher<srfs_msgs::msg::Event>> event;
  std::shared_ptr<Publisher<srfs_msgs::msg::PayloadTelemetry>> telemetry;
  std::shared_ptr<Service<lc::srv::ChangeState>> change_state;
  std::shared_ptr<Service<lc::srv::GetState>> get_state;
  std::shared_ptr<Service<lc::srv::GetAvailableStates>> available_states;
  std::shared_ptr<Service<lc::srv::GetAvailableTransitions>> available_transitions;
  std::shared_ptr<Service<lc::srv::GetAvailableTransitions>> transition_graph;
  std::shared_ptr<Service<rcl::srv::GetParameters>> get_parameters;
  std::shared_ptr<Service<rcl::srv::SetParameters>> set_parameters;
  std::shared_ptr<Service<rcl::srv::SetParametersAtomically>> set_atomically;
  std::shared_ptr<Service<rcl::srv::ListParameters>> list_parameters;
  std::shared_ptr<Service<rcl::srv::DescribeParameters>> describe_parameters;
  std::shared_ptr<Service<rcl::srv::GetParameterTypes>> parameter_types;

  explicit Interfaces(LifecycleNode& node) {
    transition_event =
        node.create_publisher(Topic<lc::msg::TransitionEvent>{"/" + node.name() + "/transition_event", {}});
    parameter_events = node.create_publisher(topics::parameter_events);
    rosout = node.create_publisher(topics::rosout);
    event = node.create_publisher(topics::event);
    telemetry = node.create_publisher(topics::telemetry(node.name()));
    make_lifecycle_services(node);
    make_parameter_services(node);
    log::set_sink([out = rosout, name = node.name()](const log::Record& record) {
      rcl::msg::Log m;
      m.stamp = to_message(system_utc_now());
      m.level = static_cast<std::uint8_t>(record.severity);
      m.name = name;
      m.msg = std::string(record.text);
      m.file = std::string(log::base_name(record.where.file_name()));
      m.function = std::string(std::string_view(record.where.function_name()).substr(0, longest_function));
      m.line = record.where.line();
      out->publish(m);
    });
  }
  ~Interfaces() { log::set_sink({}); }
  Interfaces(const Interfaces&) = delete;
  Interfaces& operator=(const Interfaces&) = delete;

  void make_lifecycle_services(LifecycleNode& node) {
    change_state = node.create_service<lc::srv::ChangeState>(
        "~/change_state", [&node](const auto& request, auto& response) {
          const auto result = node.request_transition(request.transition.id, request.transition.label);
          if (!result) return;
          response.success = result->succeeded;
          if (!response.success) return;
          node.persist_desired(result->reached);
          if (node.on_commanded_) node.on_commanded_(result->reached);
        });
    get_state = node.create_service<lc::srv::GetState>("~/get_state", [&node](const auto&, auto& response) {
      response.current_state = state_message(node.state());
    });
    available_states = node.create_service<lc::srv::GetAvailableStates>(
        "~/get_available_states", [](const auto&, auto& response) {
          for (const int id : {0, 1, 2, 3, 4, 10, 11, 12, 13, 14, 15}) {
            response.available_states.push_back(state_message(static_cast<State>(id)));
          }
        });
    available_transitions = node.create_service<lc::srv::GetAvailableTransitions>(
        "~/get_available_transitions", [&node](const auto&, auto& response) {
          for (const LifecycleRow& row : lifecycle_table()) {
            if (row.from == node.state()) response.available_transitions.push_back(describe(row));
          }
        });
    transition_graph = node.create_service<lc::srv::GetAvailableTransitions>(
        "~/get_transition_graph", [](const auto&, auto& response) {
          for (const LifecycleRow& row : lifecycle_table())
            response.available_transitions.push_back(describe(row));
        });
  }

  static std::string change(LifecycleNode& node, const std::vector<rcl::msg::Parameter>& wanted,
                            std::vector<std::string>& refusals) {
    std::vector<std::pair<std::string, ParameterValue>> changes;
    for (const auto& parameter : wanted) {
      const auto value = from_message(parameter.value);
      if (!value)
        return fmt::format("parameter '{}': values of type {} are not supported", excerpt(parameter.name),
                           parameter.value.type);
      changes.emplace_back(parameter.name, *value);
    }
    refusals = node.parameters().set_atomically(changes);
    for (const std::string& why : refusals) {
      if (!why.empty()) return why;
    }
    return {};
  }

  void make_parameter_services(LifecycleNode& node) {
    get_parameters = node.create_service<rcl::srv::GetParameters>(
        "~/get_parameters",
        [&node](const auto& request, auto& response) {
          for (const std::string& name : request.names) {
            const ParameterValue* value = node.parameters().find(name);
            response.values.push_back(value != nullptr ? to_message(*value) : rcl::msg::ParameterValue{});
          }
        },
        parameter_qos);
    set_parameters = node.create_service<rcl::srv::SetParameters>(
        "~/set_parameters",
        [&node](const auto& request, auto& response) {
          for (const auto& parameter : request.parameters) {
            std::vector<std::string> ignored;
            const std::string why = change(node, {parameter}, ignored);
            response.results.push_back({why.empty(), why});
          }
        },
        parameter_qos);
    set_atomically = node.create_service<rcl::srv::SetParametersAtomically>(
        "~/set_parameters_atomically",
        [&node](const auto& request, auto& response) {
          std::vector<std::string> ignored;
          response.result.reason = change(node, request.parameters, ignored);
          response.result.successful = response.result.reason.empty();
        },
        parameter_qos);
    list_parameters = node.create_service<rcl::srv::ListParameters>(
        "~/list_parameters",
        [&node](const auto& request, auto& response) {
          response.result = list_parameter_names(node.parameters().names(), request.prefixes, request.depth);
        },
        parameter_qos);
    describe_parameters = node.create_service<rcl::srv::DescribeParameters>(
        "~/describe_parameters",
        [&node](const auto& request, auto& response) {
          for (const std::string& name : request.names) {
            const auto declaration = node.parameters().declaration(name);
            rcl::msg::ParameterDescriptor unknown;
            unknown.name = excerpt(name, longest_refusal);
            response.descriptors.push_back(declaration ? descriptor(name, *declaration) : unknown);
          }
        },
        parameter_qos);
    parameter_types = node.create_service<rcl::srv::GetParameterTypes>(
        "~/get_parameter_types",
        [&node](const auto& request, auto& response) {
          for (const std::string& name : request.names) {
            const ParameterValue* value = node.parameters().find(name);
            response.types.push_back(value != nullptr ? to_message(*value).type : std::uint8_t{0});
          }
        },
        parameter_qos);
  }
};

const Deployment& LifecycleNode::deployment() const {
  return context_.live != nullptr ? context_.live->current() : context_.deployment;
}

LifecycleNode::LifecycleNode(NodeContext& context)
    : context_(context),
      graph_(context.executor, context.participant, context.deployment.ros_graph, context.name),
      departures_(context.executor, context.participant, context.var,
                  [this](const std::string& node) { return deployment().find(node) != nullptr; }) {
  const NodeEntry* entry = context.deployment.find(context.name);
  if (entry != nullptr) parameters_ = ParameterSet(entry->parameters);
  for (const auto& guarded : mission::guarded_parameters) {
    if (guarded.node == context.name) parameters_.guard(std::string(guarded.name));
  }
  introspection_ = std::make_unique<NodeIntrospection>(*this);
  declare_common_parameters();
  parameters_.set_changed([this](const std::string& parameter) {
    if (parameter_changed_) parameter_changed_(parameter);
  });
  parameters_.set_applied([this](const std::vector<std::string>& changed) {
    apply_common_parameters();
    publish_parameter_event(changed);
    introspection_->on_parameters_changed(changed);
  });
  interfaces_ = std::make_unique<Interfaces>(*this);
  introspection_->open();
  check_alive_ = std::make_unique<CheckAliveService>(*this);
  watch_executor();
  input_check_ = create_timer(
      input_check_period,
      [this] {
        report_bad_input();
        log::report_held_back();
        introspection_->publish_work();
      },
      "self check");
}

LifecycleNode::~LifecycleNode() {
  context_.executor.on_over_budget({});
  context_.executor.on_failure({});
}

void LifecycleNode::declare_common_parameters() {
  declare_parameter("log_level", std::string("info"),
                    std::vector<std::string>{"debug", "info", "warn", "error", "fatal"},
                    "Lowest severity of the lines that are logged");
  declare_parameter("callback_budget_ms", std::int64_t{20}, ParameterRange{1, 60000},
                    "Run time of a callback above which it is reported");
  declare_parameter("service_budget_ms", std::int64_t{100}, ParameterRange{1, 60000},
                    "Run time of a service request above which it is reported");
  declare_parameter("transition_deadline_ms", std::int64_t{2000}, ParameterRange{1, 600000},
                    "Run time of a lifecycle callback above which it is reported as late");
  declare_parameter("parameter_trial_s", std::int64_t{300}, ParameterRange{1, 86400},
                    "Time within which a guarded change must be confirmed; otherwise it reverts");
  apply_common_parameters();
}

void LifecycleNode::apply_common_parameters() {
  if (const auto lowest = log::severity_of(get_parameter<std::string>("log_level"))) log::set_level(*lowest);
  CallbackStatistics& statistics = context_.executor.statistics();
  const milliseconds callback(get_parameter<std::int64_t>("callback_budget_ms"));
  for (const auto kind : {CallbackKind::timer, CallbackKind::subscription, CallbackKind::client,
                          CallbackKind::descriptor, CallbackKind::posted, CallbackKind::other}) {
    statistics.set_budget(kind, callback);
  }
  statistics.set_budget(CallbackKind::service,
                        milliseconds(get_parameter<std::int64_t>("service_budget_ms")));
  const milliseconds transition(get_parameter<std::int64_t>("transition_deadline_ms"));
  statistics.set_budget(CallbackKind::transition, transition);
  // Callbacks whose work is a transition, or several.
  constexpr int most_transitions = 4;
  statistics.record(CallbackKind::service, resolve("~/change_state")).budget = transition;
  statistics.record(CallbackKind::timer, bring_up_timer).budget = transition * most_transitions;
}

void LifecycleNode::publish_parameter_event(const std::vector<std::string>& changed) {
  rcl::msg::ParameterEvent m;
  m.stamp = to_message(system_utc_now());
  m.node = "/" + name();
  for (const std::string& parameter : changed)
    m.changed_parameters.push_back({parameter, to_message(*parameters_.find(parameter))});
  interfaces_->parameter_events->publish(m);
}

void LifecycleNode::finish_declarations() {
  parameters_.finish();
  introspection_->begin_keeping();
}

void LifecycleNode::watch_executor() {
  Executor& executor = context_.executor;
  executor.on_over_budget([this](const CallbackRecord& record, nanoseconds took) {
    const auto us = [](nanoseconds d) { return static_cast<std::uint32_t>(d / microseconds(1)); };
    const nanoseconds budget = context_.executor.statistics().budget(record);
    log::warn("{} {} took {} us, its budget is {} us ({} times so far)", to_text(record.kind), record.name,
              us(took), us(budget), record.over_budget);
    const mission::NodeCallbackOverBudgetEvent event{.callback = record.name,
                                                     .took_us = us(took),
                                                     .budget_us = us(budget),
                                                     .count = static_cast<std::uint32_t>(record.over_budget)};
    raise(event);
  });
  executor.on_failure([this](const CallbackRecord& record, const std::string& what) {
    ++failed_callbacks_;
    log::error("{} {} ended with an exception: {}", to_text(record.kind), record.name, what);
    const mission::NodeCallbackFailedEvent event{.callback = record.name, .what = what};
    raise(event);
    process_error(fmt::format("{} {}: {}", to_text(record.kind), record.name, what));
  });
}

std::string LifecycleNode::device(const std::string& key) const {
  const auto found = deployment().devices.find(key);
  if (found != deployment().devices.end()) return found->second;
  throw ConfigError(fmt::format("{}: 'devices.{}': expected the URI of this device, found nothing",
                                deployment().file.string(), key));
}

std::string LifecycleNode::resolve(const std::string& service) const {
  return service.starts_with("~/") ? "/" + name() + service.substr(1) : service;
}

Timer LifecycleNode::create_timer(nanoseconds period, std::function<void()> callback,
                                  std::string_view timer_name) {
  return context_.executor.add_timer(monotonic_now() + period, period, std::move(callback), timer_name);
}

Timer LifecycleNode::create_one_shot(MonotonicTime at, std::function<void()> callback,
                                     std::string_view timer_name) {
  return context_.executor.add_timer(at, nanoseconds(0), std::move(callback), timer_name);
}

Executor::Handle LifecycleNode::watch_fd(int fd, std::uint32_t events, Executor::FdCallback callback,
                                         std::string_view fd_name) {
  return context_.executor.add_fd(fd, events, std::move(callback), fd_name);
}

void LifecycleNode::publish_telemetry(const srfs_msgs::msg::PayloadTelemetry& sample) {
  interfaces_->telemetry->publish(sample);
}

std::shared_ptr<Worker> LifecycleNode::create_worker(const std::string& worker_name, std::size_t capacity,
                                                     std::optional<milliseconds> deadline) {
  return std::make_shared<Worker>(context_.executor, worker_name, capacity,
                                  deadline.value_or(worker_deadline()));
}

std::shared_ptr<Worker> LifecycleNode::create_background_worker(const std::string& worker_name,
                                                                std::size_t capacity, milliseconds deadline) {
  return std::make_shared<Worker>(context_.executor, worker_name, capacity, deadline, WorkerKind::background);
}

milliseconds LifecycleNode::worker_deadline() const {
  const NodeEntry* entry = deployment().find(name());
  return entry != nullptr ? entry->worker_deadline : deployment().ring.worker_deadline;
}

CallbackReturn LifecycleNode::run_callback(State transition_state) {
  try {
    switch (transition_state) {
      case State::configuring:
        return on_configure();
      case State::activating:
        return on_activate();
      case State::deactivating:
        return on_deactivate();
      case State::cleaning_up:
        return on_cleanup();
      case State::shutting_down:
        return on_shutdown();
      case State::error_processing:
        return on_error();
      default:
        return CallbackReturn::error;
    }
  } catch (const std::exception& e) {
    set_failure_reason(e.what());
  } catch (...) {
    set_failure_reason("an exception that is not a std::exception");
  }
  // A device or key that is missing is no error: the next attempt may find it.
  return transition_state == State::configuring ? CallbackReturn::failure : CallbackReturn::error;
}

void LifecycleNode::set_desired(State desired) {
  desired_ = desired;
  show_lifecycle();
}

void LifecycleNode::show_lifecycle() {
  if (context_.heartbeat == nullptr) return;
  context_.heartbeat->lifecycle(static_cast<std::uint32_t>(state_), static_cast<std::uint32_t>(desired_),
                                monotonic_now());
}

void LifecycleNode::enter(const LifecycleRow& row) {
  state_ = row.to;
  show_lifecycle();
  lc::msg::TransitionEvent m;
  m.timestamp = static_cast<std::uint64_t>(system_utc_now().ns());  // ROS time, as the other stamps of ROS 2
  m.transition.id = row.transition_id;
  m.transition.label = std::string(row.label);
  m.start_state = state_message(row.from);
  m.goal_state = state_message(row.to);
  interfaces_->transition_event->publish(m);
}

Result<TransitionResult, std::string> LifecycleNode::request_transition(std::uint8_t id,
                                                                        std::string_view requested_label) {
  if (const LifecycleRow* row = find_request(state_, id, requested_label)) return pass_through(*row, {});
  const std::string wanted =
      requested_label.empty() ? fmt::format("transition {}", id) : excerpt(requested_label);
  const std::string why = fmt::format("not possible in state {}", label(state_));
  if (is_primary(state_)) {
    last_transition_ = {.label = wanted, .outcome = LastTransition::Outcome::refused, .reason = why};
  }
  log::warn("{} refused: {}", wanted, why);
  const mission::NodeTransitionRefusedEvent event{.transition = wanted, .state = std::string(label(state_))};
  raise(event);
  return Err(why);
}

CallbackReturn LifecycleNode::run_timed(State transition_state) {
  const MonotonicTime begun = monotonic_now();
  // What led to error processing stays the reason, whatever on_error adds.
  const std::string cause = std::exchange(failure_reason_, {});
  const CallbackReturn returned = run_callback(transition_state);
  if (failure_reason_.empty()) {
    failure_reason_ = cause;
  } else if (!cause.empty()) {
    failure_reason_ = cause + "; then " + failure_reason_;
  }
  const MonotonicTime ended = monotonic_now();
  CallbackStatistics& statistics = context_.executor.statistics();
  CallbackRecord& record = statistics.record(CallbackKind::transition, label(transition_state));
  statistics.add(record, ended - begun, ended);
  const nanoseconds deadline = statistics.budget(record);
  if (ended - begun <= deadline) return returned;
  last_transition_.late = true;
  const mission::NodeTransitionLateEvent event{
      .state = std::string(label(transition_state)),
      .took_ms = static_cast<std::uint32_t>((ended - begun) / milliseconds(1)),
      .deadline_ms = static_cast<std::uint32_t>(deadline / milliseconds(1))};
  log::warn("{} took {} ms, its deadline is {} ms", event.state, event.took_ms, event.deadline_ms);
  raise(event);
  return returned;
}

TransitionResult LifecycleNode::pass_through(const LifecycleRow& row, const std::string& cause) {
  using Outcome = LastTransition::Outcome;
  const MonotonicTime begun = monotonic_now();
  failure_reason_ = cause;
  last_transition_ = {.label = std::string(row.label), .reason = {}};
  Outcome outcome = cause.empty() ? Outcome::succeeded : Outcome::error;
  bound_real_time(real_time_in_transition);
  enter(row);
  while (!is_primary(state_)) {
    const State transition_state = state_;
    const CallbackReturn returned = run_timed(transition_state);
    if (returned != CallbackReturn::success) {
      if (failure_reason_.empty()) failure_reason_ = "no reason given";
      if (outcome != Outcome::error)
        outcome = returned == CallbackReturn::error ? Outcome::error : Outcome::failed;
      log::error("{} failed: {}", label(transition_state), failure_reason_);
      if (returned == CallbackReturn::error) {
        const mission::NodeErrorEvent event{
            .what = fmt::format("{}: {}", label(transition_state), failure_reason_)};
        raise(event);
      }
    }
    enter(*find_row(transition_state, to_trigger(returned)));
  }
  if (is_active()) bound_real_time(real_time_at_work);
  if (outcome != Outcome::succeeded) ++failed_transitions_;
  if (outcome == Outcome::failed) {
    const mission::NodeTransitionFailedEvent event{
        .transition = last_transition_.label, .state = std::string(label(state_)), .reason = failure_reason_};
    raise(event);
  }
  last_transition_.outcome = outcome;
  if (outcome != Outcome::succeeded) last_transition_.reason = failure_reason_;
  last_transition_.took = monotonic_now() - begun;
  log::info("lifecycle: {}", label(state_));
  report_first_activation();
  return {state_, outcome == Outcome::succeeded};
}

void LifecycleNode::raise_error(std::string reason) {
  if (raised_error_) return;  // the first reason is the cause
  raised_error_ = create_one_shot(
      monotonic_now(),
      [this, why = std::move(reason)] {
        raised_error_.reset();
        process_error(why);
      },
      "raise_error");
}

void LifecycleNode::process_error(const std::string& reason) {
  const LifecycleRow* row = find_error_row(state_);
  if (row == nullptr) return;  // finalized: nothing is left to take back
  const mission::NodeErrorEvent event{.what = reason};
  raise(event);
  pass_through(*row, reason.empty() ? "no reason given" : reason);
  if (on_error_processed_) on_error_processed_();
}

bool LifecycleNode::go_to(State target) {
  // At most: deactivate, cleanup, or configure, activate; shutdown is one step from anywhere.
  for (int steps = 0; steps < 4 && state_ != target; ++steps) {
    std::string_view request;
    if (target == State::finalized) {
      request = "shutdown";
    } else if (state_ == State::unconfigured) {
      request = "configure";
    } else if (state_ == State::inactive) {
      request = target == State::active ? "activate" : "cleanup";
    } else if (state_ == State::active) {
      request = "deactivate";
    } else {
      return false;
    }
    const auto result = request_transition(0, request);
    if (!result || !result->succeeded) break;  // not again at once: the caller decides when
  }
  return state_ == target;
}

void LifecycleNode::persist_desired(State primary) {
  // A few octets, on an operator's command only: worth waiting for, so that the answer is true after a power
  // loss too.
  if (const auto written = set_desired_state(var(), deployment(), name(), primary, monotonic_now());
      !written) {
    log::error("the desired state '{}' will not survive a restart: {}", label(primary), written.error());
  }
}

void LifecycleNode::report_first_activation() {
  if (state_ != State::active || start_report_) return;
  start_report_ = create_one_shot(
      monotonic_now() + start_report_delay,
      [this] {
        const mission::NodeStartedEvent event{.incarnation = incarnation()};
        raise(event);
        introspection_->raise_start_report();
      },
      "start report");
}

std::uint64_t LifecycleNode::malformed_samples() const {
  std::uint64_t count = 0;
  context_.executor.for_each_source([&](const CallbackRecord&, const Source& source) {
    if (const auto* reader = dynamic_cast<const ReaderEndpoint*>(&source)) count += reader->stats().malformed;
  });
  return count;
}

void LifecycleNode::report_bad_input(Input& input, const ReaderEndpoint& reader) {
  const InputStats stats = reader.stats();
  if (stats.malformed > input.reported) {
    input.reported = stats.malformed;
    log::warn("{} malformed samples on {} so far: check its publishers", stats.malformed, input.topic);
    const mission::NodeMalformedSamplesEvent event{.count = static_cast<std::uint32_t>(stats.malformed),
                                                   .topic = input.topic};
    raise(event);
  }
  if (stats.foreign > input.foreign_reported) {
    input.foreign_reported = stats.foreign;
    const std::string source = reader.last_foreign();
    log::warn("{} samples on {} so far from outside the suite, last by participant {}: {}", stats.foreign,
              input.topic, source, context_.participant.drops_foreign() ? "dropped" : "accepted");
    const mission::NodeForeignSamplesEvent event{
        .count = static_cast<std::uint32_t>(stats.foreign), .topic = input.topic, .participant = source};
    raise(event);
  }
}

void LifecycleNode::report_dropped_foreign() {
  const Participant& participant = context_.participant;
  const std::uint64_t dropped = participant.transport_stats().foreign;
  if (dropped <= foreign_dropped_reported_) return;
  foreign_dropped_reported_ = dropped;
  const std::string source = participant.last_dropped();
  log::warn("{} datagrams from outside the suite dropped unread so far, last by participant {}: {}", dropped,
            source,
            participant.drops_foreign() ? "dds.foreign is drop" : "they came faster than this node can read");
  const mission::NodeForeignSamplesEvent event{
      .count = static_cast<std::uint32_t>(dropped), .topic = "*", .participant = source};
  raise(event);
}

void LifecycleNode::report_bad_input() {
  for (auto input = inputs_.begin(); input != inputs_.end();) {
    const auto reader = input->reader.lock();
    if (!reader) {
      input = inputs_.erase(input);
      continue;
    }
    report_bad_input(*input, *reader);
    ++input;
  }
  if (const std::uint64_t dropped = context_.participant.transport_stats().overflowed;
      dropped > overflow_reported_) {
    overflow_reported_ = dropped;
    log::warn("{} datagrams dropped by the kernel so far: this node reads too slowly (srfs stats {})",
              dropped, name());
  }
  report_dropped_foreign();
  if (suppressed_events_ > suppressed_reported_) {
    const mission::NodeEventsSuppressedEvent event{
        .event = last_suppressed_event_,
        .count = static_cast<std::uint32_t>(suppressed_events_ - suppressed_reported_)};
    suppressed_reported_ = suppressed_events_;
    raise(event);
  }
}

void LifecycleNode::raise_event(std::uint16_t event_id, std::uint8_t severity, OctetView data) {
  const MonotonicTime t = monotonic_now();
  if (t - event_window_ >= seconds(1)) {
    event_window_ = t;
    events_in_window_ = 0;
  }
  if (++events_in_window_ > most_events_per_s) {
    ++suppressed_events_;
    last_suppressed_event_ = event_id;
    return;
  }
  srfs_msgs::msg::Event m;
  m.source = name();
  m.event_id = event_id;
  m.severity = severity;
  m.utc = to_message(system_utc_now());
  m.time_valid = false;  // the node's own clock; ttc stamps the report with mission time
  m.monotonic_ns = static_cast<std::uint64_t>(t.ns());
  m.data.assign(data.begin(), data.end());
  interfaces_->event->publish(m);
}

}  // namespace srfs::ros
