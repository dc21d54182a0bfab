// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "base/log.hpp"
#include "base/octets.hpp"
#include "base/result.hpp"
#include "ros/action_client.hpp"
#include "ros/action_server.hpp"
#include "ros/client.hpp"
#include "ros/departures.hpp"
#include "ros/deployment.hpp"
#include "ros/executor.hpp"
#include "ros/graph_publisher.hpp"
#include "ros/instance.hpp"
#include "ros/lifecycle.hpp"
#include "ros/parameters.hpp"
#include "ros/publisher.hpp"
#include "ros/service.hpp"
#include "ros/topics.hpp"
#include "ros/worker.hpp"

namespace srfs::ros {

class LiveDeployment;

/// What run_node hands to a node. Outlives it.
struct NodeContext {
  std::string name;
  const Deployment& deployment;
  VarPaths var;
  std::uint32_t incarnation = 1;
  Executor& executor;
  Participant& participant;
  HeartbeatPage* heartbeat = nullptr;  ///< this process' page in the liveness ring
  /// The deployment as it is now: nodes are added and removed while the process runs. nullptr: it stays.
  const LiveDeployment* live = nullptr;
};

/// Name of the timer with which run_node brings a node up again.
inline constexpr std::string_view bring_up_timer = "bring up";

/// How a requested transition ended.
struct TransitionResult {
  State reached;
  bool succeeded;  ///< its callback succeeded; else `reached` is where failure or error processing led
};

/// The last transition that was requested or that an error caused.
struct LastTransition {
  enum class Outcome : std::uint8_t { none, succeeded, failed, error, refused };
  std::string label;  ///< "configure"...; "raise_error"
  Outcome outcome = Outcome::none;
  std::string reason;  ///< why it was refused or failed
  nanoseconds took{0};
  bool late = false;  ///< longer than the parameter transition_deadline_ms
};

/// Work of a node that is due by time or by what it knows, beside the input that waits for its work thread.
struct WorkStatus {
  std::uint32_t due = 0;   ///< undone now
  std::uint32_t done = 0;  ///< since the start
  std::optional<MonotonicTime> oldest_due;
};

/// A lifecycle node: rclcpp's words, one work thread. Everything here is called on the work thread, in the
/// constructor or in callbacks. The standard services (~/change_state, ~/get_state, ..., the parameter
/// services) are there from the start.
///
/// A callback that throws, or calls raise_error(), takes the node through ErrorProcessing: on_error() decides
/// whether it becomes Unconfigured (run_node brings it up again) or Finalized. The process goes on.
///
/// Every node has the parameters log_level, callback_budget_ms, service_budget_ms,
/// transition_deadline_ms and parameter_trial_s.
///
/// What a state means for the hardware: Unconfigured has nothing open; Inactive has its devices open but
/// drives nothing and holds no bus, and still answers; Active works.
class LifecycleNode {
 public:
  explicit LifecycleNode(NodeContext& context);
  virtual ~LifecycleNode();
  LifecycleNode(const LifecycleNode&) = delete;
  LifecycleNode& operator=(const LifecycleNode&) = delete;

  [[nodiscard]] const std::string& name() const { return context_.name; }
  [[nodiscard]] std::uint32_t incarnation() const { return context_.incarnation; }
  /// As it is now. Any thread; what it returns is whole and does not change, and stays until the list of
  /// added nodes has changed LiveDeployment::kept more times.
  [[nodiscard]] const Deployment& deployment() const;
  [[nodiscard]] const VarPaths& var() const { return context_.var; }
  [[nodiscard]] std::filesystem::path state_dir() const { return context_.var.state(name()); }
  /// URI of a device of the deployment; throws ConfigError naming the key when it is missing.
  [[nodiscard]] std::string device(const std::string& key) const;
  [[nodiscard]] State state() const { return state_; }
  /// Where run_node, or the operator, wants it to be.
  [[nodiscard]] State desired_state() const { return desired_; }
  [[nodiscard]] bool is_active() const { return state_ == State::active; }
  /// Nothing that deactivation began is still under way (a bus to release, an answer to wait for).
  [[nodiscard]] virtual bool is_at_rest() const { return true; }
  /// For the ring: a node whose due work grows old while nothing more gets done is restarted. What waits as
  /// input is counted anyway.
  [[nodiscard]] virtual WorkStatus work_status() const { return {}; }
  /// Nodes were added or removed: deployment() is another one. On the work thread, in any state.
  virtual void on_deployment_changed() {}
  /// What a new version checks of itself before it may replace the one that runs (`--self-test`): it is
  /// Active, has turned for a second, and every device is absent. @return what is wrong
  [[nodiscard]] virtual Result<void, std::string> self_test() { return {}; }
  /// Time of this wake-up, read once before each callback.
  [[nodiscard]] MonotonicTime now() const { return context_.executor.now(); }

  /// Runs one transition now: the callback, then error processing if need be.
  /// @return how it ended, or why the request is refused in this state
  Result<TransitionResult, std::string> request_transition(std::uint8_t id, std::string_view label = {});
  /// Goes step by step towards @p target through the table. @return true when it was reached
  bool go_to(State target);
  [[nodiscard]] ParameterSet& parameters() { return parameters_; }

  /// Reason of the last failing transition, for people; set by the callbacks.
  void set_failure_reason(std::string reason) { failure_reason_ = std::move(reason); }
  [[nodiscard]] const std::string& failure_reason() const { return failure_reason_; }
  [[nodiscard]] const LastTransition& last_transition() const { return last_transition_; }
  /// Since the start.
  [[nodiscard]] std::uint32_t failed_transitions() const { return failed_transitions_; }
  [[nodiscard]] std::uint32_t failed_callbacks() const { return failed_callbacks_; }
  /// Goes to ErrorProcessing as soon as the running callback has returned. No effect in Finalized.
  void raise_error(std::string reason);
  /// After the constructor: throws ConfigError for undeclared parameters of the deployment, and moves stored
  /// ones that cannot be used out of the way. Blocks on the disk for the latter.
  void finish_declarations();

 protected:
  // Transition callbacks. failure: back to where it came from; error: on_error decides (success:
  // Unconfigured).
  virtual CallbackReturn on_configure() { return CallbackReturn::success; }
  virtual CallbackReturn on_activate() { return CallbackReturn::success; }
  virtual CallbackReturn on_deactivate() { return CallbackReturn::success; }
  virtual CallbackReturn on_cleanup() { return CallbackReturn::success; }
  virtual CallbackReturn on_shutdown() { return CallbackReturn::success; }
  virtual CallbackReturn on_error() { return CallbackReturn::success; }

  template <class M>
  [[nodiscard]] std::shared_ptr<Publisher<M>> create_publisher(const Topic<M>& topic) {
    return std::make_shared<Publisher<M>>(context_.participant, topic);
  }
  /// @param callback called with (const M&) or (const M&, const MessageInfo&)
  template <class M, class F>
  [[nodiscard]] std::shared_ptr<Subscription<M>> create_subscription(const Topic<M>& topic, F callback) {
    typename Subscription<M>::Callback handler;
    if constexpr (std::is_invocable_v<F, const M&, const MessageInfo&>) {
      handler = std::move(callback);
    } else {
      handler = [f = std::move(callback)](const M& m, const MessageInfo&) { f(m); };
    }
    auto made =
        std::make_shared<Subscription<M>>(context_.executor, context_.participant, topic, std::move(handler));
    inputs_.push_back({topic.name, made->reader()});
    return made;
  }
  /// @param name "~/x" is below the node's name, "/x" absolute
  template <class S>
  [[nodiscard]] std::shared_ptr<Service<S>> create_service(const std::string& service,
                                                           typename Service<S>::Handler handler, Qos qos = {},
                                                           Priority priority = Priority::normal) {
    return std::make_shared<Service<S>>(context_.executor, context_.participant, resolve(service), qos,
                                        priority, std::move(handler));
  }
  /// A service whose replies come later, by Service::reply with the ticket the handler was given.
  template <class S, class F>
  [[nodiscard]] std::shared_ptr<Service<S>> create_deferred_service(const std::string& service, F handler,
                                                                    Qos qos = {},
                                                                    Priority priority = Priority::normal) {
    return std::make_shared<Service<S>>(context_.executor, context_.participant, resolve(service), qos,
                                        priority, defer_replies, std::move(handler));
  }
  template <class S>
  [[nodiscard]] std::shared_ptr<Client<S>> create_client(const std::string& service, Qos qos = {},
                                                         Priority priority = Priority::normal) {
    return std::make_shared<Client<S>>(context_.executor, context_.participant, resolve(service), qos,
                                       priority);
  }
  /// @param action "~/x" is below the node's name, "/x" absolute
  template <class A>
  [[nodiscard]] std::shared_ptr<ActionServer<A>> create_action_server(
      const std::string& action, ActionHandlers<A> handlers, const ActionServerOptions& options = {}) {
    return std::make_shared<ActionServer<A>>(context_.executor, context_.participant, resolve(action),
                                             std::move(handlers), options);
  }
  template <class A>
  [[nodiscard]] std::shared_ptr<ActionClient<A>> create_action_client(const std::string& action,
                                                                      Priority priority = Priority::normal) {
    return std::make_shared<ActionClient<A>>(context_.executor, context_.participant, resolve(action),
                                             priority);
  }
  /// Periodic; the first call comes one period from now. Dropping the handle cancels.
  /// @param timer_name in the executor's statistics
  [[nodiscard]] Timer create_timer(nanoseconds period, std::function<void()> callback,
                                   std::string_view timer_name = "timer");
  /// Once, at @p at.
  [[nodiscard]] Timer create_one_shot(MonotonicTime at, std::function<void()> callback,
                                      std::string_view timer_name = "timer");
  /// Level-triggered epoll; dropping the handle unwatches. Drop it before closing the descriptor.
  [[nodiscard]] Executor::Handle watch_fd(int fd, std::uint32_t events, Executor::FdCallback callback,
                                          std::string_view fd_name = "descriptor");
  /// @param deadline of one job; one that runs for longer counts as frozen, and the ring restarts this node.
  ///                 nullopt: worker_deadline()
  [[nodiscard]] std::shared_ptr<Worker> create_worker(const std::string& worker_name, std::size_t capacity,
                                                      std::optional<milliseconds> deadline = std::nullopt);
  /// For computing or writing in bulk: behind all other threads (base/background.hpp).
  [[nodiscard]] std::shared_ptr<Worker> create_background_worker(const std::string& worker_name,
                                                                 std::size_t capacity, milliseconds deadline);
  /// The deployment's for a worker's job of this node.
  [[nodiscard]] milliseconds worker_deadline() const;

  /// Declares a parameter (constructor only) and returns its start value. The type of @p fallback is the
  /// parameter's.
  template <class T>
  T declare_parameter(const std::string& parameter, T fallback, const std::string& description,
                      bool read_only = false) {
    return std::get<T>(parameters_.declare(
        parameter, {ParameterValue(std::move(fallback)), std::nullopt, description, read_only, {}}));
  }
  template <class T>
  T declare_parameter(const std::string& parameter, T fallback, ParameterRange range,
                      const std::string& description, bool read_only = false) {
    return std::get<T>(parameters_.declare(
        parameter, {ParameterValue(std::move(fallback)), range, description, read_only, {}}));
  }
  /// A text (or texts) out of @p choices.
  template <class T>
  T declare_parameter(const std::string& parameter, T fallback, std::vector<std::string> choices,
                      const std::string& description, bool read_only = false) {
    return std::get<T>(parameters_.declare(parameter, {ParameterValue(std::move(fallback)), std::nullopt,
                                                       description, read_only, std::move(choices)}));
  }
  template <class T>
  [[nodiscard]] T get_parameter(const std::string& parameter) const {
    return std::get<T>(*parameters_.find(parameter));
  }
  /// May refuse a run-time change with a reason.
  void on_parameter_check(ParameterSet::Check check) { parameters_.set_check(std::move(check)); }
  /// May refuse a set of run-time changes that do not go together.
  void on_parameter_set_check(ParameterSet::SetCheck check) { parameters_.set_set_check(std::move(check)); }
  /// Called after a change.
  void on_parameter_change(ParameterSet::Changed changed) { parameter_changed_ = std::move(changed); }

  /// Raises an event of the mission dictionary on /event. Bounded: at most 20 a second and node, the rest
  /// counted.
  /// @param severity srfs_msgs::msg::Event::INFO ... HIGH; @param data its parameters, encoded
  void raise_event(std::uint16_t event_id, std::uint8_t severity, OctetView data = {});
  /// The same for an event struct of <mission/structures.hpp>, which knows its id, severity and encoding.
  template <class Event>
  void raise(const Event& event) {
    raise_event(Event::event_id, static_cast<std::uint8_t>(Event::severity), event.encoded());
  }
  [[nodiscard]] std::uint64_t suppressed_events() const { return suppressed_events_; }
  /// Malformed samples at all readers that exist now: topics, services, clients.
  [[nodiscard]] std::uint64_t malformed_samples() const;

  /// Publishes one of this node's own housekeeping structures on /<node>/telemetry.
  virtual void publish_telemetry(const srfs_msgs::msg::PayloadTelemetry& sample);

  NodeContext& context() { return context_; }

 private:
  struct Interfaces;
  friend class NodeIntrospection;
  friend class CheckAliveService;
  friend class LivenessRing;
  /// A subscription, to report what should not have come in.
  struct Input {
    std::string topic;
    std::weak_ptr<const ReaderEndpoint> reader;
    std::uint64_t reported = 0;
    std::uint64_t foreign_reported = 0;
  };
  [[nodiscard]] std::string resolve(const std::string& service) const;
  CallbackReturn run_callback(State transition_state);
  CallbackReturn run_timed(State transition_state);
  TransitionResult pass_through(const LifecycleRow& row, const std::string& cause);
  void process_error(const std::string& reason);
  void watch_executor();
  void declare_common_parameters();
  void apply_common_parameters();
  void publish_parameter_event(const std::vector<std::string>& changed);
  void enter(const LifecycleRow& row);
  void set_desired(State desired);
  void show_lifecycle();
  void persist_desired(State primary);
  void report_first_activation();
  void report_bad_input();
  void report_bad_input(Input& input, const ReaderEndpoint& reader);
  void report_dropped_foreign();

  NodeContext& context_;
  GraphPublisher graph_;  // first to come, last to go: it publishes all endpoints
  Departures departures_;
  ParameterSet parameters_;
  ParameterSet::Changed parameter_changed_;
  State state_ = State::unconfigured;
  State desired_ = State::active;
  std::string failure_reason_;
  LastTransition last_transition_;
  std::uint32_t failed_transitions_ = 0;
  std::uint32_t failed_callbacks_ = 0;
  Timer raised_error_;
  std::function<void()> on_error_processed_;
  MonotonicTime event_window_;
  std::uint32_t events_in_window_ = 0;
  std::uint64_t suppressed_events_ = 0;
  std::uint64_t suppressed_reported_ = 0;
  std::uint64_t overflow_reported_ = 0;
  std::uint64_t foreign_dropped_reported_ = 0;
  std::uint16_t last_suppressed_event_ = 0;
  std::vector<Input> inputs_;
  Timer input_check_;
  Timer start_report_;
  std::function<void(State)> on_commanded_;
  std::unique_ptr<Interfaces> interfaces_;
  std::unique_ptr<class NodeIntrospection> introspection_;
  std::unique_ptr<class CheckAliveService> check_alive_;
  friend class NodeRunner;
};

}  // namespace srfs::ros

#include "ros/run_node.hpp"
