// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <atomic>
#include <deque>
#include <memory>
#include <mutex>

#include <action_msgs/msg/goal_status_array.hpp>
#include <action_msgs/srv/cancel_goal.hpp>

#include "base/log.hpp"
#include "ros/action_goals.hpp"
#include "ros/publisher.hpp"
#include "ros/service.hpp"
#include "ros/time_message.hpp"
#include "ros/worker.hpp"

namespace srfs::ros {

/// A server's answer to a goal.
enum class GoalResponse : std::uint8_t {
  reject,
  accept_and_execute,  ///< the goal is executing from now on
  accept_and_defer,    ///< it waits (state accepted) until execute(), its first feedback or its end
};
/// A server's answer to a request to cancel.
enum class CancelResponse : std::uint8_t { reject, accept };
/// What happens to a goal whose client vanished.
enum class OrphanPolicy : std::uint8_t {
  run_on,  ///< its result is kept for later requests
  cancel,  ///< as if a request to cancel had come
};

struct ActionServerOptions {
  GoalLimits limits = {};
  OrphanPolicy orphans = OrphanPolicy::run_on;
  Priority priority = Priority::normal;
};

/// Reports by the owners of goals, from any thread, on their way to the work thread, in order.
/// Bounded: 16 feedbacks a goal (the goal's oldest makes room, counted), one end a goal.
class GoalMailbox final : public Source, public std::enable_shared_from_this<GoalMailbox> {
 public:
  enum class Kind : std::uint8_t { execute, feedback, end, abandoned };
  struct Item {
    GoalId goal;
    Kind kind;
    GoalEvent how = GoalEvent::abort;               ///< with end
    std::shared_ptr<const void> payload = nullptr;  ///< feedback or result
  };
  static constexpr std::size_t most_feedback = 16;

  GoalMailbox(Executor& executor, Priority priority, std::function<void(const Item&)> handle)
      : executor_(executor), priority_(priority), handle_(std::move(handle)) {}

  /// Any thread; never waits for the work thread. Ignored after close().
  void post(Item item);
  /// On the work thread: what is posted from now on, or waits, is dropped.
  void close();
  bool dispatch_one(MonotonicTime now) override;
  [[nodiscard]] std::uint64_t dropped_feedback() const { return dropped_feedback_; }

 private:
  Executor& executor_;
  Priority priority_;
  std::function<void(const Item&)> handle_;
  std::mutex mutex_;  // guards the two below
  std::deque<Item> items_;
  bool closed_ = false;
  std::atomic<std::uint64_t> dropped_feedback_{0};
};

/// How the work of a goal ended.
template <class A>
struct GoalEnd {
  GoalEvent how;
  typename A::Result result;

  static GoalEnd succeeded(typename A::Result result = {}) { return {GoalEvent::succeed, std::move(result)}; }
  static GoalEnd aborted(typename A::Result result = {}) { return {GoalEvent::abort, std::move(result)}; }
  static GoalEnd canceled(typename A::Result result = {}) { return {GoalEvent::canceled, std::move(result)}; }
};

template <class A>
class ActionServer;

/// A goal at its server: what it asks for, and the way to report on it. Every member may be called from any
/// thread; what is reported takes effect on the work thread, in order. When the last reference goes before
/// the goal was ended, the goal is aborted: its clients never wait in vain.
template <class A>
class ServerGoal : public std::enable_shared_from_this<ServerGoal<A>> {
 public:
  using Job = std::function<GoalEnd<A>(ServerGoal&)>;

  ~ServerGoal() {
    if (!ended_) mailbox_->post({id_, GoalMailbox::Kind::abandoned});
  }
  ServerGoal(const ServerGoal&) = delete;
  ServerGoal& operator=(const ServerGoal&) = delete;

  [[nodiscard]] const GoalId& id() const { return id_; }
  [[nodiscard]] const typename A::Goal& goal() const { return goal_; }
  /// When it was accepted.
  [[nodiscard]] UtcTime stamp() const { return stamp_; }
  /// A request to cancel was granted: the work should stop soon and end as canceled.
  [[nodiscard]] bool is_cancel_requested() const { return cancel_requested_; }

  /// The work begins; for goals accepted with accept_and_defer.
  void execute() { mailbox_->post({id_, GoalMailbox::Kind::execute}); }
  void publish_feedback(typename A::Feedback feedback) {
    auto message = std::make_shared<typename A::FeedbackMessage>();
    message->goal_id.uuid = id_;
    message->feedback = std::move(feedback);
    mailbox_->post({id_, GoalMailbox::Kind::feedback, GoalEvent::execute, std::move(message)});
  }
  void succeed(typename A::Result result = {}) { end(GoalEnd<A>::succeeded(std::move(result))); }
  void abort(typename A::Result result = {}) { end(GoalEnd<A>::aborted(std::move(result))); }
  /// Without a granted request to cancel, the goal is aborted instead: only such a request may cancel it.
  void canceled(typename A::Result result = {}) { end(GoalEnd<A>::canceled(std::move(result))); }
  /// The first end counts, further ones are ignored.
  void end(GoalEnd<A> how) {
    if (ended_.exchange(true)) return;
    mailbox_->post(
        {id_, GoalMailbox::Kind::end, how.how, std::make_shared<typename A::Result>(std::move(how.result))});
  }

  /// Runs @p job on a worker's thread, where it may block; it should check is_cancel_requested() often. What
  /// it returns ends the goal. The goal executes from the job's begin; one canceled before is not begun. An
  /// exception of the job, and a worker that drops it, abort the goal.
  /// @return false when the worker's queue is full: the goal is aborted
  bool run_on(Worker& worker, Job job) {
    const bool taken = worker.post([self = this->shared_from_this(), f = std::move(job)] { self->run(f); });
    if (!taken) abort();
    return taken;
  }

 private:
  friend class ActionServer<A>;
  ServerGoal(std::shared_ptr<GoalMailbox> mailbox, const GoalId& id, typename A::Goal goal, UtcTime stamp)
      : mailbox_(std::move(mailbox)), id_(id), goal_(std::move(goal)), stamp_(stamp) {}

  void run(const Job& job) {
    if (is_cancel_requested()) {
      canceled();
      return;
    }
    execute();
    try {
      end(job(*this));
    } catch (const std::exception& e) {
      log::error("an action goal failed: {}", e.what());
      abort();
    }
  }

  std::shared_ptr<GoalMailbox> mailbox_;
  GoalId id_;
  typename A::Goal goal_;
  UtcTime stamp_;
  std::atomic<bool> cancel_requested_{false};
  std::atomic<bool> ended_{false};
};

/// How a node serves an action; all on the work thread, none may block.
template <class A>
struct ActionHandlers {
  /// Accepts or rejects. Empty: every goal is executed.
  std::function<GoalResponse(const GoalId&, const typename A::Goal&)> goal = {};
  /// Grants or refuses a request to cancel. Empty: every request is granted.
  std::function<CancelResponse(const std::shared_ptr<ServerGoal<A>>&)> cancel = {};
  /// Takes over an accepted goal and starts its work; the client has its answer already.
  std::function<void(std::shared_ptr<ServerGoal<A>>)> accepted;
};

/// The half of an action server that does not know its types.
class ActionServerCore {
 public:
  /// What the typed half does.
  class Typed {
   public:
    virtual void publish_feedback(const void* message) = 0;
    /// @param result of the action's Result type; null: an empty one
    virtual void reply_result(Ticket ticket, GoalState state, const void* result) = 0;
    /// May the goal be canceled? @return its answer; when granted, the goal has been notified
    virtual CancelResponse cancel_wanted(const GoalId& id) = 0;
    virtual void goal_ended(const GoalId& id) = 0;
    [[nodiscard]] virtual bool within_reach(const GoalClient& client) const = 0;

   protected:
    ~Typed() = default;
  };

  ActionServerCore(Typed& typed, Executor& executor, Participant& participant, const std::string& action,
                   const ActionServerOptions& options);
  ~ActionServerCore();
  ActionServerCore(const ActionServerCore&) = delete;
  ActionServerCore& operator=(const ActionServerCore&) = delete;

  [[nodiscard]] bool admit(const GoalId& id) { return goals_.admit(id) == ActionGoals::Admission::open; }
  void reject() { goals_.count_rejection(); }
  void accept(const GoalId& id, const GUID_t& client, UtcTime stamp, bool execute);
  /// A client wants the result: answers now, or when the goal ends.
  void result_wanted(const GoalId& id, Ticket ticket);
  /// Clients came or went; these requests for results were dropped with theirs.
  void clients_changed(std::span<const Ticket> dropped);
  /// Aborts the goals that run and notifies all clients; nothing is handled any more.
  void shut_down();

  [[nodiscard]] const std::shared_ptr<GoalMailbox>& mailbox() const { return mailbox_; }
  [[nodiscard]] const GoalCounters& counters() const { return goals_.counters(); }
  [[nodiscard]] std::vector<ActionGoals::Goal> goals() const { return goals_.goals(); }
  [[nodiscard]] std::uint64_t orphans() const { return orphans_; }

 private:
  using CancelGoal = action_msgs::srv::CancelGoal;
  void on_item(const GoalMailbox::Item& item);
  void on_cancel(const CancelGoal::Request& request, CancelGoal::Response& response);
  bool cancel(const GoalId& id);
  void begin(const GoalId& id);
  void finish(const GoalId& id, GoalEvent how, const std::shared_ptr<const void>& result);
  void publish_status();
  void expire();
  void arm_expiry();

  Typed& typed_;
  Executor& executor_;
  OrphanPolicy orphan_policy_;
  ActionGoals goals_;
  std::shared_ptr<GoalMailbox> mailbox_;
  Publisher<action_msgs::msg::GoalStatusArray> status_;
  Service<CancelGoal> cancel_goal_;
  Timer expiry_;
  std::uint64_t orphans_ = 0;
};

/// Serves an action of type A with goal states, feedback, status, cancel and kept results as rcl_action does
/// (Humble's names, types and QoS on the wire). On the work thread; dropping it aborts the goals that run.
///
/// Bounds: GoalLimits goals and results; 64 requests for results wait at a time; a request whose client
/// vanished is dropped. Clients outside the suite get a refusal where there is no room (Service).
template <class A>
class ActionServer final : private ActionServerCore::Typed {
 public:
  ActionServer(Executor& executor, Participant& participant, const std::string& action,
               ActionHandlers<A> handlers, const ActionServerOptions& options = {})
      : handlers_(std::move(handlers)),
        feedback_(participant, Topic<typename A::FeedbackMessage>{action + "/_action/feedback", {}}),
        core_(*this, executor, participant, action, options),
        get_result_(executor, participant, action + "/_action/get_result", Qos{}, options.priority,
                    defer_replies,
                    [this](const typename A::GetResult::Request& request, Ticket ticket) {
                      core_.result_wanted(request.goal_id.uuid, ticket);
                    }),
        send_goal_(executor, participant, action + "/_action/send_goal", Qos{}, options.priority,
                   defer_replies, [this](const typename A::SendGoal::Request& request, Ticket ticket) {
                     on_goal(request, ticket);
                   }) {
    get_result_.on_clients_changed(
        [this](std::span<const Ticket> dropped) { core_.clients_changed(dropped); });
    send_goal_.on_clients_changed([this](std::span<const Ticket>) { core_.clients_changed({}); });
  }
  ~ActionServer() { core_.shut_down(); }
  ActionServer(const ActionServer&) = delete;
  ActionServer& operator=(const ActionServer&) = delete;

  [[nodiscard]] const GoalCounters& counters() const { return core_.counters(); }
  /// Running goals and kept results, in order of acceptance.
  [[nodiscard]] std::vector<ActionGoals::Goal> goals() const { return core_.goals(); }
  /// Requests for results that wait for their goal's end.
  [[nodiscard]] std::size_t results_awaited() const { return get_result_.pending(); }
  /// Goals whose client vanished while they ran.
  [[nodiscard]] std::uint64_t orphans() const { return core_.orphans(); }
  /// Clients that hear feedback sent now. A client that finds the server ready may not be among them yet.
  [[nodiscard]] std::size_t feedback_readers() const { return feedback_.subscription_count(); }
  [[nodiscard]] std::uint64_t dropped_feedback() const { return core_.mailbox()->dropped_feedback(); }

 private:
  using Goal = ServerGoal<A>;

  void on_goal(const typename A::SendGoal::Request& request, Ticket ticket) {
    const GoalId& id = request.goal_id.uuid;
    const GUID_t client = send_goal_.client(ticket);
    auto decision = GoalResponse::reject;
    if (core_.admit(id)) {
      decision = handlers_.goal ? handlers_.goal(id, request.goal) : GoalResponse::accept_and_execute;
      if (decision == GoalResponse::reject) core_.reject();
    }
    const UtcTime stamp = system_utc_now();
    typename A::SendGoal::Response response;
    response.accepted = decision != GoalResponse::reject;
    response.stamp = to_message(stamp);
    send_goal_.reply(ticket, response);
    if (!response.accepted) return;
    std::shared_ptr<Goal> goal(new Goal(core_.mailbox(), id, request.goal, stamp));
    goals_[id] = goal;
    core_.accept(id, client, stamp, decision == GoalResponse::accept_and_execute);
    if (handlers_.accepted) handlers_.accepted(std::move(goal));
  }

  void publish_feedback(const void* message) override {
    feedback_.publish(*static_cast<const typename A::FeedbackMessage*>(message));
  }
  void reply_result(Ticket ticket, GoalState state, const void* result) override {
    typename A::GetResult::Response response;
    response.status = static_cast<std::int8_t>(state);
    if (result != nullptr) response.result = *static_cast<const typename A::Result*>(result);
    if (!get_result_.reply(ticket, std::move(response)))
      log::error("the result of a goal exceeds a bound of {}; not sent", A::ros_type_name);
  }
  CancelResponse cancel_wanted(const GoalId& id) override {
    const auto found = goals_.find(id);
    const auto goal = found != goals_.end() ? found->second.lock() : nullptr;
    if (!goal) return CancelResponse::reject;  // abandoned: its abort is on the way
    const auto answer = handlers_.cancel ? handlers_.cancel(goal) : CancelResponse::accept;
    if (answer == CancelResponse::accept) goal->cancel_requested_ = true;
    return answer;
  }
  void goal_ended(const GoalId& id) override { goals_.erase(id); }
  [[nodiscard]] bool within_reach(const GoalClient& client) const override {
    GUID_t guid;
    std::copy_n(client.begin(), 12, guid.guidPrefix.value);
    std::copy_n(client.begin() + 12, 4, guid.entityId.value);
    return send_goal_.within_reach(guid);
  }

  ActionHandlers<A> handlers_;
  std::map<GoalId, std::weak_ptr<Goal>> goals_;
  Publisher<typename A::FeedbackMessage> feedback_;
  ActionServerCore core_;
  Service<typename A::GetResult> get_result_;
  Service<typename A::SendGoal> send_goal_;
};

}  // namespace srfs::ros
