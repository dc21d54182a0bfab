// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "ros/lifecycle_node.hpp"

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

#include "base/excerpt.hpp"
#include "ros/datagram_seal.hpp"
#include "ros/time_message.hpp"

namespace srfs::ros {
namespace {

namespace lc = lifecycle_msgs;
namespace rcl = rcl_interfaces;

constexpr Qos parameter_qos{.depth = 1000};
constexpr std::size_t longest_function = 100;
constexpr seconds input_check_period{10};
constexpr const char* refused_foreign = "refused: not from the suite";

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
    transition_event = node.create_publisher(Topic<lc::msg::TransitionEvent>{"~/transition_event", {}});
    parameter_events = node.create_publisher(topics::parameter_events);
    rosout = node.create_publisher(topics::rosout);
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
    change_state = node.create_order_service<lc::srv::ChangeState>(
        "~/change_state", [&node](const auto& request, auto& response) {
          const auto result = node.request_transition(request.transition.id, request.transition.label);
          if (!result) return;
          response.success = result->succeeded;
          if (!response.success) return;
          node.on_commanded(result->reached);
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
    set_parameters = node.create_order_service<rcl::srv::SetParameters>(
        "~/set_parameters",
        [&node](const auto& request, auto& response) {
          for (const auto& parameter : request.parameters) {
            std::vector<std::string> ignored;
            const std::string why = change(node, {parameter}, ignored);
            response.results.push_back({why.empty(), why});
          }
        },
        [](const auto& request, auto& response) {
          response.results.assign(request.parameters.size(), {false, refused_foreign});
        },
        parameter_qos);
    set_atomically = node.create_order_service<rcl::srv::SetParametersAtomically>(
        "~/set_parameters_atomically",
        [&node](const auto& request, auto& response) {
          std::vector<std::string> ignored;
          response.result.reason = change(node, request.parameters, ignored);
          response.result.successful = response.result.reason.empty();
        },
        [](const auto&, auto& response) { response.result.reason = refused_foreign; }, parameter_qos);
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

LifecycleNode::LifecycleNode(NodeOptions options)
    : names_(std::move(options.names)),
      executor_(options.executor),
      participant_(options.participant),
      worker_deadline_(options.worker_deadline),
      graph_(executor_, participant_, options.graph, names_),
      parameters_(std::move(options.parameters)),
      obeys_foreign_(options.obeys_foreign) {
  declare_common_parameters();
  parameters_.set_changed([this](const std::string& parameter) {
    if (parameter_changed_) parameter_changed_(parameter);
  });
  parameters_.set_applied([this](const std::vector<std::string>& changed) {
    apply_common_parameters();
    publish_parameter_event(changed);
    on_parameters_changed(changed);
  });
  interfaces_ = std::make_unique<Interfaces>(*this);
  watch_executor();
  input_check_ = create_timer(
      input_check_period,
      [this] {
        check_input();
        on_self_check();
      },
      "self check");
}

LifecycleNode::~LifecycleNode() {
  executor_.on_over_budget({});
  executor_.on_failure({});
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
  apply_common_parameters();
}

void LifecycleNode::apply_common_parameters() {
  if (const auto lowest = log::severity_of(get_parameter<std::string>("log_level"))) log::set_level(*lowest);
  CallbackStatistics& statistics = executor_.statistics();
  const milliseconds callback(get_parameter<std::int64_t>("callback_budget_ms"));
  for (const auto kind : {CallbackKind::timer, CallbackKind::subscription, CallbackKind::client,
                          CallbackKind::descriptor, CallbackKind::posted, CallbackKind::other}) {
    statistics.set_budget(kind, callback);
  }
  statistics.set_budget(CallbackKind::service,
                        milliseconds(get_parameter<std::int64_t>("service_budget_ms")));
  const milliseconds transition(get_parameter<std::int64_t>("transition_deadline_ms"));
  statistics.set_budget(CallbackKind::transition, transition);
  statistics.record(CallbackKind::service, resolve("~/change_state")).budget = transition;  // its work is one
}

void LifecycleNode::publish_parameter_event(const std::vector<std::string>& changed) {
  rcl::msg::ParameterEvent m;
  m.stamp = to_message(system_utc_now());
  m.node = names_.full_name();
  for (const std::string& parameter : changed)
    m.changed_parameters.push_back({parameter, to_message(*parameters_.find(parameter))});
  interfaces_->parameter_events->publish(m);
}

void LifecycleNode::watch_executor() {
  executor_.on_over_budget([this](const CallbackRecord& record, nanoseconds took) {
    const nanoseconds budget = executor_.statistics().budget(record);
    log::warn("{} {} took {} us, its budget is {} us ({} times so far)", to_text(record.kind), record.name,
              took / microseconds(1), budget / microseconds(1), record.over_budget);
    on_callback_over_budget(record, took, budget);
  });
  executor_.on_failure([this](const CallbackRecord& record, const std::string& what) {
    ++failed_callbacks_;
    log::error("{} {} ended with an exception: {}", to_text(record.kind), record.name, what);
    on_callback_failed(record, what);
    process_error(fmt::format("{} {}: {}", to_text(record.kind), record.name, what));
  });
}

Timer LifecycleNode::create_timer(nanoseconds period, std::function<void()> callback,
                                  std::string_view timer_name) {
  return executor_.add_timer(monotonic_now() + period, period, std::move(callback), timer_name);
}

Timer LifecycleNode::create_one_shot(MonotonicTime at, std::function<void()> callback,
                                     std::string_view timer_name) {
  return executor_.add_timer(at, nanoseconds(0), std::move(callback), timer_name);
}

Executor::Handle LifecycleNode::watch_fd(int fd, std::uint32_t events, Executor::FdCallback callback,
                                         std::string_view fd_name) {
  return executor_.add_fd(fd, events, std::move(callback), fd_name);
}

std::shared_ptr<Worker> LifecycleNode::create_worker(const std::string& worker_name, std::size_t capacity,
                                                     std::optional<milliseconds> deadline) {
  return std::make_shared<Worker>(executor_, worker_name, capacity, deadline.value_or(worker_deadline()));
}

std::shared_ptr<Worker> LifecycleNode::create_background_worker(const std::string& worker_name,
                                                                std::size_t capacity, milliseconds deadline) {
  return std::make_shared<Worker>(executor_, worker_name, capacity, deadline, WorkerKind::background);
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

void LifecycleNode::enter(const LifecycleRow& row) {
  state_ = row.to;
  on_entered();
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
  on_transition_refused(wanted);
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
  CallbackStatistics& statistics = executor_.statistics();
  CallbackRecord& record = statistics.record(CallbackKind::transition, label(transition_state));
  statistics.add(record, ended - begun, ended);
  const nanoseconds deadline = statistics.budget(record);
  if (ended - begun <= deadline) return returned;
  last_transition_.late = true;
  log::warn("{} took {} ms, its deadline is {} ms", label(transition_state),
            (ended - begun) / milliseconds(1), deadline / milliseconds(1));
  on_transition_late(transition_state, ended - begun, deadline);
  return returned;
}

TransitionResult LifecycleNode::pass_through(const LifecycleRow& row, const std::string& cause) {
  using Outcome = LastTransition::Outcome;
  const MonotonicTime begun = monotonic_now();
  failure_reason_ = cause;
  last_transition_ = {.label = std::string(row.label), .reason = {}};
  Outcome outcome = cause.empty() ? Outcome::succeeded : Outcome::error;
  on_transition_begun();
  enter(row);
  while (!is_primary(state_)) {
    const State transition_state = state_;
    const CallbackReturn returned = run_timed(transition_state);
    if (returned != CallbackReturn::success) {
      if (failure_reason_.empty()) failure_reason_ = "no reason given";
      if (outcome != Outcome::error)
        outcome = returned == CallbackReturn::error ? Outcome::error : Outcome::failed;
      log::error("{} failed: {}", label(transition_state), failure_reason_);
      if (returned == CallbackReturn::error)
        on_error_raised(fmt::format("{}: {}", label(transition_state), failure_reason_));
    }
    enter(*find_row(transition_state, to_trigger(returned)));
  }
  if (outcome != Outcome::succeeded) ++failed_transitions_;
  last_transition_.outcome = outcome;
  if (outcome != Outcome::succeeded) last_transition_.reason = failure_reason_;
  last_transition_.took = monotonic_now() - begun;
  log::info("lifecycle: {}", label(state_));
  on_transition_ended();
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
  on_error_raised(reason);
  pass_through(*row, reason.empty() ? "no reason given" : reason);
  on_error_processed();
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

bool LifecycleNode::refuses_order(const GUID_t& client, const std::string& service) {
  if (obeys_foreign_ || participant_.may_order(client)) return false;
  GuidPrefix prefix{};
  std::copy_n(client.guidPrefix.value, prefix.size(), prefix.begin());
  const std::string limited = participant_.limited_name(client);
  on_order_refused(service, ++refused_orders_,
                   limited.empty() ? participant_.known_participants().describe(prefix)
                                   : limited + ", which speaks for itself alone");
  return true;
}

std::uint64_t LifecycleNode::malformed_samples() const {
  std::uint64_t count = 0;
  executor_.for_each_source([&](const CallbackRecord&, const Source& source) {
    if (const auto* reader = dynamic_cast<const ReaderEndpoint*>(&source)) count += reader->stats().malformed;
  });
  return count;
}

void LifecycleNode::check_input(Input& input, const ReaderEndpoint& reader) {
  const InputStats stats = reader.stats();
  if (stats.malformed > input.reported) {
    input.reported = stats.malformed;
    log::warn("{} malformed samples on {} so far: check its publishers", stats.malformed, input.topic);
    on_malformed_samples(input.topic, stats.malformed);
  }
  if (stats.foreign > input.foreign_reported) {
    input.foreign_reported = stats.foreign;
    const std::string source = reader.last_foreign();
    log::warn("{} samples on {} so far from those who may not publish there, last by participant {}: {}",
              stats.foreign, input.topic, source,
              participant_.drops_foreign() || datagram_seal() ? "dropped" : "accepted");
    on_foreign_samples(input.topic, stats.foreign, source);
  }
  const QosEvents qos = reader.qos_events().events();
  if (qos.incompatible > input.incompatible_reported) {
    input.incompatible_reported = qos.incompatible;
    log::warn("{} publishers on {} so far are not heard, because they offer less than is asked for, last: {}",
              qos.incompatible, input.topic, qos.incompatible_policy);
  }
}

void LifecycleNode::check_dropped() {
  const TransportStats stats = participant_.transport_stats();
  if (stats.overflowed > overflow_reported_) {
    overflow_reported_ = stats.overflowed;
    log::warn("{} datagrams dropped by the kernel so far: this node reads too slowly (srfs stats {})",
              stats.overflowed, name());
  }
  if (stats.foreign > foreign_dropped_reported_) {
    foreign_dropped_reported_ = stats.foreign;
    const std::string source = participant_.last_dropped();
    log::warn(
        "{} datagrams from outside the suite dropped unread so far, last by participant {}: {}",
        stats.foreign, source,
        participant_.drops_foreign() ? "dds.foreign is drop" : "they came faster than this node can read");
    on_foreign_samples("*", stats.foreign, source);
  }
  check_forged();
}

void LifecycleNode::check_forged() {
  if (!datagram_seal()) return;
  if (const std::uint64_t stale = datagram_seal()->stale(); stale > stale_reported_) {
    stale_reported_ = stale;
    log::warn(
        "{} datagrams of the suite dropped so far because they are from before: this process stood still, or "
        "somebody repeats what he recorded",
        stale);
  }
  const ForgedDatagrams forged = datagram_seal()->forged();
  if (forged.all() <= forged_reported_) return;
  forged_reported_ = forged.all();
  log::error(
      "{} forged datagrams dropped so far: {} in a member's name without a seal, {} with a wrong one, {} "
      "that "
      "came before, {} that told discovery about a member, {} of an uplinked node in another's name",
      forged.all(), forged.unsealed, forged.wrong_seal, forged.repeated, forged.about, forged.beyond);
  on_foreign_samples("*", forged.all(), "in a member's name");
}

void LifecycleNode::check_input() {
  for (auto input = inputs_.begin(); input != inputs_.end();) {
    const auto reader = input->reader.lock();
    if (!reader) {
      input = inputs_.erase(input);
      continue;
    }
    check_input(*input, *reader);
    ++input;
  }
  check_dropped();
}

}  // namespace srfs::ros
