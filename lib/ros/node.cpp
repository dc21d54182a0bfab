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

#include "base/file.hpp"
#include "ros/mission_time.hpp"

namespace srfs::ros {
namespace {

namespace lc = lifecycle_msgs;
namespace rcl = rcl_interfaces;

constexpr Qos parameter_qos{.depth = 1000};
constexpr std::uint32_t most_events_per_s = 20;
constexpr seconds input_check_period{10};
constexpr seconds start_report_delay{
    2};  // discovery needs a moment: an event raised at once would reach nobody

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

std::uint8_t log_level(log::Severity severity) {
  return static_cast<std::uint8_t>(severity);
}

}  // namespace

/// The endpoints every node has.
struct LifecycleNode::Interfaces {
  std::shared_ptr<Publisher<lc::msg::TransitionEvent>> transition_event;
  std::shared_ptr<Publisher<rcl::msg::ParameterEvent>> parameter_events;
  std::shared_ptr<Publisher<rcl::msg::Log>> rosout;
  std::shared_ptr<Publisher<srfs_msgs::msg::Event>> event;
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
    make_lifecycle_services(node);
    make_parameter_services(node);
    log::set_sink([out = rosout, name = node.name()](log::Severity severity, std::string_view text) {
      rcl::msg::Log m;
      m.stamp = to_message(system_utc_now());
      m.level = log_level(severity);
      m.name = name;
      m.msg = std::string(text);
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
          if (!result) {
            log::warn("lifecycle transition {} '{}' refused: {}", request.transition.id,
                      request.transition.label, result.error());
            return;
          }
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
        return fmt::format("parameter '{}': values of type {} are not supported", parameter.name,
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
            const ParameterDeclaration* declaration = node.parameters().declaration(name);
            rcl::msg::ParameterDescriptor unknown;
            unknown.name = name;
            response.descriptors.push_back(declaration != nullptr ? descriptor(name, *declaration) : unknown);
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

LifecycleNode::LifecycleNode(NodeContext& context)
    : context_(context),
      graph_(context.executor, context.participant, context.deployment.ros_graph, context.name) {
  const NodeEntry* entry = context.deployment.find(context.name);
  if (entry != nullptr) parameters_ = ParameterSet(entry->parameters);
  parameters_.set_changed([this](const std::string& parameter) {
    if (parameter_changed_) parameter_changed_(parameter);
    rcl::msg::ParameterEvent m;
    m.stamp = to_message(system_utc_now());
    m.node = "/" + name();
    m.changed_parameters.push_back({parameter, to_message(*parameters_.find(parameter))});
    if (interfaces_) interfaces_->parameter_events->publish(m);
  });
  interfaces_ = std::make_unique<Interfaces>(*this);
  input_check_ = create_timer(input_check_period, [this] { report_bad_input(); });
}

LifecycleNode::~LifecycleNode() = default;

std::string LifecycleNode::device(const std::string& key) const {
  const auto found = deployment().devices.find(key);
  if (found != deployment().devices.end()) return found->second;
  throw ConfigError(fmt::format("{}: 'devices.{}': expected the URI of this device, found nothing",
                                deployment().file.string(), key));
}

std::string LifecycleNode::resolve(const std::string& service) const {
  return service.starts_with("~/") ? "/" + name() + service.substr(1) : service;
}

Timer LifecycleNode::create_timer(nanoseconds period, std::function<void()> callback) {
  return context_.executor.add_timer(monotonic_now() + period, period, std::move(callback));
}

Timer LifecycleNode::create_one_shot(MonotonicTime at, std::function<void()> callback) {
  return context_.executor.add_timer(at, nanoseconds(0), std::move(callback));
}

Executor::Handle LifecycleNode::watch_fd(int fd, std::uint32_t events, Executor::FdCallback callback) {
  return context_.executor.add_fd(fd, events, std::move(callback));
}

std::shared_ptr<Worker> LifecycleNode::create_worker(const std::string& worker_name, std::size_t capacity) {
  return std::make_shared<Worker>(context_.executor, worker_name, capacity);
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
    return transition_state == State::configuring ? CallbackReturn::failure : CallbackReturn::error;
  }
}

void LifecycleNode::enter(const LifecycleRow& row) {
  state_ = row.to;
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
  const LifecycleRow* row = find_request(state_, id, requested_label);
  if (row == nullptr) return Err(fmt::format("not possible in state {}", label(state_)));
  failure_reason_.clear();
  enter(*row);
  bool succeeded = true;
  while (!is_primary(state_)) {
    const State transition_state = state_;
    const CallbackReturn outcome = run_callback(transition_state);
    if (outcome != CallbackReturn::success) {
      succeeded = false;
      if (outcome == CallbackReturn::error) {
        const mission::NodeErrorEvent event{
            .what = fmt::format("{}: {}", label(transition_state), failure_reason_)};
        raise(event);
      }
      log::error("{} failed: {}", label(transition_state),
                 failure_reason_.empty() ? "no reason given" : failure_reason_);
    }
    enter(*find_row(transition_state, to_trigger(outcome)));
  }
  log::info("lifecycle: {}", label(state_));
  report_first_activation();
  return TransitionResult{state_, succeeded};
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
    const State before = state_;
    if (!request_transition(0, request) || state_ == before) return false;
  }
  return state_ == target;
}

void LifecycleNode::persist_desired(State primary) {
  // A few octets, on an operator's command only: worth waiting for, so that the answer is true after a power
  // loss too.
  if (const auto written =
          write_file_atomically(state_dir() / "desired_state", std::string(label(primary)) + "\n");
      !written) {
    log::error("the desired state '{}' will not survive a restart: {}", label(primary),
               written.error().message);
  }
}

void LifecycleNode::report_first_activation() {
  if (state_ != State::active || start_report_) return;
  start_report_ = create_one_shot(monotonic_now() + start_report_delay, [this] {
    const mission::NodeStartedEvent event{.incarnation = incarnation()};
    raise(event);
  });
}

void LifecycleNode::report_bad_input(Input& input, const ReaderEndpoint& reader) {
  const InputStats stats = reader.stats();
  if (stats.malformed > input.reported) {
    input.reported = stats.malformed;
    log::warn("{} malformed samples on {} so far: who publishes there?", stats.malformed, input.topic);
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
