// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <memory>

#include <action_msgs/msg/goal_status_array.hpp>
#include <action_msgs/srv/cancel_goal.hpp>

#include "ros/client.hpp"
#include "ros/goal_tracker.hpp"
#include "ros/time_message.hpp"

namespace srfs::ros {

/// A random UUID, version 4 (RFC 9562, 5.4).
[[nodiscard]] GoalId make_goal_id();

/// The outcome of a request to cancel (action_msgs/srv/CancelGoal).
enum class CancelOutcome : std::uint8_t {
  canceling,     ///< granted; the goal ends soon, as its work decides
  rejected,      ///< the server goes on with it
  unknown_goal,  ///< the server does not know the goal
  terminated,    ///< it has ended, or is being canceled already
  unanswered,    ///< no answer in time, or the goal ended here before it could be asked
};
[[nodiscard]] CancelOutcome cancel_outcome(std::int8_t return_code);
[[nodiscard]] const char* to_text(CancelOutcome outcome);

/// The result of a goal and how it ended: succeeded, canceled or aborted.
template <class A>
struct GoalResult {
  GoalState state;
  typename A::Result result;
};
/// How a goal ended at its client: with a result, or why without.
template <class A>
using GoalOutcome = Result<GoalResult<A>, GoalError>;

/// A client's callbacks for one goal, called on the work thread. Any may be empty.
template <class A>
struct GoalCallbacks {
  std::function<void(UtcTime stamp)> accepted = {};
  std::function<void(const typename A::Feedback&)> feedback = {};  ///< may come just before `accepted`
  std::function<void(const GoalOutcome<A>&)> ended = {};           ///< exactly once, the last
};

template <class A>
class ActionClient;

/// One goal under way. Dropping it forgets the goal: no callback comes any more, the server's work goes on.
/// On the work thread.
template <class A>
class ClientGoal : public std::enable_shared_from_this<ClientGoal<A>> {
 public:
  using CancelCallback = std::function<void(CancelOutcome)>;

  ~ClientGoal();
  ClientGoal(const ClientGoal&) = delete;
  ClientGoal& operator=(const ClientGoal&) = delete;

  [[nodiscard]] const GoalId& id() const { return id_; }
  /// The last state reported; unknown until the server reports one.
  [[nodiscard]] GoalState state() const { return tracker_.state(); }
  [[nodiscard]] bool is_over() const { return tracker_.is_over(); }
  /// Asks the server to cancel the goal, as soon as the server has accepted it; a second call does nothing.
  /// The goal ends by its own `ended`.
  /// @param callback called once, unless the goal is dropped before
  void cancel(CancelCallback callback = {});

 private:
  friend class ActionClient<A>;
  using Links = typename ActionClient<A>::Links;

  ClientGoal(std::weak_ptr<Links> links, const GoalId& id, GoalCallbacks<A> callbacks,
             const GoalDeadlines& deadlines)
      : links_(std::move(links)),
        id_(id),
        callbacks_(std::move(callbacks)),
        deadlines_(deadlines),
        tracker_(deadlines) {}

  void send(const typename A::Goal& goal);
  void on_response(const Result<typename A::SendGoal::Response, CallError>& response, const GUID_t& server);
  void on_feedback(const typename A::Feedback& feedback);
  void on_server_change();
  void request_result();
  void take_waiting_feedback();
  void request_cancel();
  void perform(const GoalTracker::Step& step, const typename A::Result* result = nullptr);
  void end(const GoalOutcome<A>& outcome);
  void tell_canceler(CancelOutcome outcome);

  std::weak_ptr<Links> links_;
  GoalId id_;
  GoalCallbacks<A> callbacks_;
  CancelCallback canceler_;
  GoalDeadlines deadlines_;
  GoalTracker tracker_;
  GUID_t server_;
  CallId send_call_{};
  std::array<CallId, GoalTracker::most_result_requests> result_calls_{};
  std::size_t result_call_count_ = 0;
  CallId cancel_call_{};
  Timer timer_;
};

/// Sends goals of action A to one server, several at once (at most 16). Everything on the work thread;
/// nothing blocks. Every goal ends: by its result, or by a GoalError at its deadline or when its server is
/// gone. Goals of a client that was dropped call nothing more.
template <class A>
class ActionClient {
 public:
  static constexpr std::size_t most_goals = 16;

  ActionClient(Executor& executor, Participant& participant, const std::string& action,
               Priority priority = Priority::normal)
      : links_(std::make_shared<Links>(executor, participant, action, priority)) {
    links_->connect();
  }

  /// Sends a goal once the server is matched with all its topics and services.
  /// @return the goal; keep it. When 16 goals are under way it is over already: `ended` was called with
  /// GoalError::refused
  [[nodiscard]] std::shared_ptr<ClientGoal<A>> send_goal(const typename A::Goal& goal,
                                                         GoalCallbacks<A> callbacks,
                                                         const GoalDeadlines& deadlines = {}) {
    const GoalId id = make_goal_id();
    std::shared_ptr<ClientGoal<A>> made(new ClientGoal<A>(links_, id, std::move(callbacks), deadlines));
    if (links_->goals.size() >= most_goals) {
      made->perform(made->tracker_.on_send_failed(GoalError::refused));
      return made;
    }
    links_->goals.emplace(id, made);
    made->send(goal);
    return made;
  }
  /// Asks the server to cancel all goals, those of other clients too.
  void cancel_all_goals(nanoseconds deadline, std::function<void(CancelOutcome)> callback) {
    links_->cancel.call({}, deadline, 1, [f = std::move(callback)](const auto& response) {
      f(response ? cancel_outcome(response->return_code) : CancelOutcome::unanswered);
    });
  }

  /// The server's three services and two topics are matched. Matched is not alive.
  [[nodiscard]] bool is_ready() const { return links_->is_ready(); }
  /// Goals that are not over.
  [[nodiscard]] std::size_t goals_under_way() const { return links_->goals.size(); }
  /// Calls without an outcome yet.
  [[nodiscard]] std::size_t calls_waiting() const {
    return links_->send_goal.waiting() + links_->get_result.waiting() + links_->cancel.waiting();
  }

 private:
  friend class ClientGoal<A>;
  using FeedbackMessage = typename A::FeedbackMessage;
  using StatusArray = action_msgs::msg::GoalStatusArray;
  using CancelGoal = action_msgs::srv::CancelGoal;

  /// The endpoints, and the goals that receive their input. Goals may outlive them.
  struct Links : std::enable_shared_from_this<Links> {
    Links(Executor& executor_in, Participant& participant, const std::string& action, Priority priority);
    ~Links();
    Links(const Links&) = delete;
    Links& operator=(const Links&) = delete;
    void connect();
    [[nodiscard]] bool is_ready() const;
    void on_status(const StatusArray& message);
    [[nodiscard]] std::shared_ptr<ClientGoal<A>> find(const GoalId& id) const;

    Executor& executor;
    Client<typename A::SendGoal> send_goal;
    Client<typename A::GetResult> get_result;
    Client<CancelGoal> cancel;
    std::map<GoalId, std::weak_ptr<ClientGoal<A>>> goals;
    std::shared_ptr<TypedReader<FeedbackMessage>> feedback;
    std::shared_ptr<TypedReader<StatusArray>> status;
  };

  std::shared_ptr<Links> links_;
};

}  // namespace srfs::ros

#include "ros/action_client_impl.hpp"
