// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "base/log.hpp"
#include "base/result.hpp"
#include "ros/action_client.hpp"
#include "ros/action_server.hpp"
#include "ros/client.hpp"
#include "ros/executor.hpp"
#include "ros/graph_publisher.hpp"
#include "ros/lifecycle.hpp"
#include "ros/node_names.hpp"
#include "ros/parameters.hpp"
#include "ros/publisher.hpp"
#include "ros/service.hpp"
#include "ros/topics.hpp"
#include "ros/worker.hpp"

namespace srfs::ros {

/// What a node is made with.
struct NodeOptions {
  NodeNames names;
  Executor& executor;        ///< outlives the node, as does the participant
  Participant& participant;  ///< one node each
  GraphDialect graph = GraphDialect::humble;
  ParameterSet parameters = {};               ///< with the values that go over the node's defaults
  milliseconds worker_deadline = seconds(3);  ///< of a job of create_worker() that says nothing else
  /// Whether participants outside the suite may order: transitions, parameters, create_order_service().
  bool obeys_foreign = true;
};

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

/// A lifecycle node: rclcpp's words, one work thread. Everything here is called on the work thread, in the
/// constructor or in callbacks. The standard services (~/change_state, ~/get_state, ..., the parameter
/// services) are there from the start.
///
/// A callback that throws, or calls raise_error(), takes the node through ErrorProcessing: on_error() decides
/// whether it becomes Unconfigured or Finalized. The process goes on.
///
/// Every node has the parameters log_level, callback_budget_ms, service_budget_ms and transition_deadline_ms.
/// What a node reports beyond the log, and to whom, a class between this and the node's own adds by the
/// functions under "What happened".
class LifecycleNode {
 public:
  explicit LifecycleNode(NodeOptions options);
  virtual ~LifecycleNode();
  LifecycleNode(const LifecycleNode&) = delete;
  LifecycleNode& operator=(const LifecycleNode&) = delete;

  [[nodiscard]] const std::string& name() const { return names_.name(); }
  [[nodiscard]] const NodeNames& names() const { return names_; }
  [[nodiscard]] Executor& executor() const { return executor_; }
  [[nodiscard]] Participant& participant() const { return participant_; }
  [[nodiscard]] State state() const { return state_; }
  [[nodiscard]] bool is_active() const { return state_ == State::active; }
  /// Time of this wake-up, read once before each callback.
  [[nodiscard]] MonotonicTime now() const { return executor_.now(); }

  /// Runs one transition now: the callback, then error processing if need be.
  /// @return how it ended, or why the request is refused in this state
  Result<TransitionResult, std::string> request_transition(std::uint8_t id, std::string_view label = {});
  /// Goes step by step towards @p target through the table. @return true when it was reached
  bool go_to(State target);
  [[nodiscard]] ParameterSet& parameters() { return parameters_; }
  [[nodiscard]] const ParameterSet& parameters() const { return parameters_; }
  template <class T>
  [[nodiscard]] T get_parameter(const std::string& parameter) const {
    return std::get<T>(*parameters_.find(parameter));
  }

  /// Reason of the last failing transition, for people; set by the callbacks.
  void set_failure_reason(std::string reason) { failure_reason_ = std::move(reason); }
  [[nodiscard]] const std::string& failure_reason() const { return failure_reason_; }
  [[nodiscard]] const LastTransition& last_transition() const { return last_transition_; }
  /// Since the start.
  [[nodiscard]] std::uint32_t failed_transitions() const { return failed_transitions_; }
  [[nodiscard]] std::uint32_t failed_callbacks() const { return failed_callbacks_; }
  /// Goes to ErrorProcessing as soon as the running callback has returned. No effect in Finalized.
  void raise_error(std::string reason);
  // What the node has on the wire. Names are remapped: "/x" is absolute, "~/x" below the node's name, "x" in
  // its namespace.
  template <class M>
  [[nodiscard]] std::shared_ptr<Publisher<M>> create_publisher(const Topic<M>& topic) {
    return std::make_shared<Publisher<M>>(participant_, resolved(topic));
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
    const Topic<M> named = resolved(topic);
    auto made = std::make_shared<Subscription<M>>(executor_, participant_, named, std::move(handler));
    inputs_.push_back({named.name, made->reader()});
    return made;
  }
  template <class S>
  [[nodiscard]] std::shared_ptr<Service<S>> create_service(const std::string& service,
                                                           typename Service<S>::Handler handler, Qos qos = {},
                                                           Priority priority = Priority::normal) {
    return std::make_shared<Service<S>>(executor_, participant_, resolve(service), qos, priority,
                                        std::move(handler));
  }
  /// A service that changes what the node does. A request from outside the suite is refused unless the node
  /// obeys those (NodeOptions): @p refusal fills its response, none: the empty one.
  template <class S>
  [[nodiscard]] std::shared_ptr<Service<S>> create_order_service(const std::string& service,
                                                                 typename Service<S>::Handler handler,
                                                                 typename Service<S>::Handler refusal = {},
                                                                 Qos qos = {},
                                                                 Priority priority = Priority::normal) {
    const auto self = std::make_shared<std::weak_ptr<Service<S>>>();
    auto made = create_deferred_service<S>(
        service,
        [this, self, service, obey = std::move(handler), refuse = std::move(refusal)](
            const typename S::Request& request, Ticket ticket) {
          const auto server = self->lock();
          typename S::Response response;
          if (!refuses_order(server->client(ticket), service)) {
            obey(request, response);
          } else if (refuse) {
            refuse(request, response);
          }
          server->reply(ticket, std::move(response));
        },
        qos, priority);
    *self = made;
    return made;
  }
  /// Whether an order of this client is to be refused; then it is counted.
  [[nodiscard]] bool refuses_order(const GUID_t& client, const std::string& service);
  /// A service whose replies come later, by Service::reply with the ticket the handler was given.
  template <class S, class F>
  [[nodiscard]] std::shared_ptr<Service<S>> create_deferred_service(const std::string& service, F handler,
                                                                    Qos qos = {},
                                                                    Priority priority = Priority::normal) {
    return std::make_shared<Service<S>>(executor_, participant_, resolve(service), qos, priority,
                                        defer_replies, std::move(handler));
  }
  template <class S>
  [[nodiscard]] std::shared_ptr<Client<S>> create_client(const std::string& service, Qos qos = {},
                                                         Priority priority = Priority::normal) {
    return std::make_shared<Client<S>>(executor_, participant_, resolve(service), qos, priority);
  }
  template <class A>
  [[nodiscard]] std::shared_ptr<ActionServer<A>> create_action_server(
      const std::string& action, ActionHandlers<A> handlers, const ActionServerOptions& options = {}) {
    return std::make_shared<ActionServer<A>>(executor_, participant_, resolve(action), std::move(handlers),
                                             options);
  }
  template <class A>
  [[nodiscard]] std::shared_ptr<ActionClient<A>> create_action_client(const std::string& action,
                                                                      Priority priority = Priority::normal) {
    return std::make_shared<ActionClient<A>>(executor_, participant_, resolve(action), priority);
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
  [[nodiscard]] milliseconds worker_deadline() const { return worker_deadline_; }
  /// Malformed samples at all readers that exist now: topics, services, clients.
  [[nodiscard]] std::uint64_t malformed_samples() const;

 protected:
  // Transition callbacks. failure: back to where it came from; error: on_error decides (success:
  // Unconfigured).
  virtual CallbackReturn on_configure() { return CallbackReturn::success; }
  virtual CallbackReturn on_activate() { return CallbackReturn::success; }
  virtual CallbackReturn on_deactivate() { return CallbackReturn::success; }
  virtual CallbackReturn on_cleanup() { return CallbackReturn::success; }
  virtual CallbackReturn on_shutdown() { return CallbackReturn::success; }
  virtual CallbackReturn on_error() { return CallbackReturn::success; }

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
  /// May refuse a run-time change with a reason.
  void on_parameter_check(ParameterSet::Check check) { parameters_.set_check(std::move(check)); }
  /// May refuse a set of run-time changes that do not go together.
  void on_parameter_set_check(ParameterSet::SetCheck check) { parameters_.set_set_check(std::move(check)); }
  /// Called after a change.
  void on_parameter_change(ParameterSet::Changed changed) { parameter_changed_ = std::move(changed); }

  // What happened: called on the work thread, after the line of the log. Nothing here does anything. A
  // function that overrides one calls the one it overrides.
  /// The state is another one: of a transition too.
  virtual void on_entered() {}
  virtual void on_transition_begun() {}
  /// last_transition() tells how; a primary state is reached.
  virtual void on_transition_ended() {}
  virtual void on_transition_refused(const std::string& /*wanted*/) {}
  virtual void on_transition_late(State /*transition_state*/, nanoseconds /*took*/,
                                  nanoseconds /*deadline*/) {}
  /// ~/change_state led there.
  virtual void on_commanded(State /*reached*/) {}
  /// A callback or raise_error() leads to error processing, or a transition callback failed with an error.
  virtual void on_error_raised(const std::string& /*what*/) {}
  virtual void on_error_processed() {}
  virtual void on_callback_over_budget(const CallbackRecord& /*record*/, nanoseconds /*took*/,
                                       nanoseconds /*budget*/) {}
  virtual void on_callback_failed(const CallbackRecord& /*record*/, const std::string& /*what*/) {}
  virtual void on_parameters_changed(const std::vector<std::string>& /*names*/) {}
  /// More samples of a subscription than before could not be decoded. @param count  of all
  virtual void on_malformed_samples(const std::string& /*topic*/, std::uint64_t /*count*/) {}
  /// More samples than before came from outside the suite. @param topic  "*": they were dropped unread
  /// @param source  the last one's participant, for people
  virtual void on_foreign_samples(const std::string& /*topic*/, std::uint64_t /*count*/,
                                  const std::string& /*source*/) {}
  /// An order from outside the suite was refused. @param count  of all @param service  as it was declared
  virtual void on_order_refused(const std::string& /*service*/, std::uint64_t /*count*/,
                                const std::string& /*source*/) {}
  /// Each 10 s, after the samples were looked at.
  virtual void on_self_check() {}

 private:
  struct Interfaces;
  /// A subscription, to report what should not have come in.
  struct Input {
    std::string topic;
    std::weak_ptr<const ReaderEndpoint> reader;
    std::uint64_t reported = 0;
    std::uint64_t foreign_reported = 0;
    std::uint64_t incompatible_reported = 0;
  };
  template <class M>
  [[nodiscard]] Topic<M> resolved(Topic<M> topic) const {
    topic.name = names_.resolve(topic.name, NameKind::topic);
    return topic;
  }
  [[nodiscard]] std::string resolve(const std::string& service) const {
    return names_.resolve(service, NameKind::service);
  }
  CallbackReturn run_callback(State transition_state);
  CallbackReturn run_timed(State transition_state);
  TransitionResult pass_through(const LifecycleRow& row, const std::string& cause);
  void process_error(const std::string& reason);
  void watch_executor();
  void declare_common_parameters();
  void apply_common_parameters();
  void publish_parameter_event(const std::vector<std::string>& changed);
  void enter(const LifecycleRow& row);
  void check_input();
  void check_input(Input& input, const ReaderEndpoint& reader);
  void check_dropped();
  void check_forged();

  const NodeNames names_;
  Executor& executor_;
  Participant& participant_;
  const milliseconds worker_deadline_;
  GraphPublisher graph_;  // first to come, last to go: it publishes all endpoints
  ParameterSet parameters_;
  ParameterSet::Changed parameter_changed_;
  State state_ = State::unconfigured;
  std::string failure_reason_;
  LastTransition last_transition_;
  std::uint32_t failed_transitions_ = 0;
  std::uint32_t failed_callbacks_ = 0;
  Timer raised_error_;
  std::uint64_t overflow_reported_ = 0;
  std::uint64_t foreign_dropped_reported_ = 0;
  std::uint64_t forged_reported_ = 0;
  std::uint64_t stale_reported_ = 0;
  const bool obeys_foreign_;
  std::uint64_t refused_orders_ = 0;
  std::vector<Input> inputs_;
  Timer input_check_;
  std::unique_ptr<Interfaces> interfaces_;
};

}  // namespace srfs::ros
