// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "base/octets.hpp"
#include "base/rejection_log.hpp"
#include "msgs/mission/node_tables.hpp"
#include "ros/lifecycle_node.hpp"
#include "suite/departures.hpp"
#include "suite/deployment.hpp"
#include "suite/instance.hpp"
#include "suite/mode_follower.hpp"
#include "suite/ring/check_alive.hpp"
#include "suite/topics.hpp"

namespace srfs::suite {

class HeartbeatPage;
class LiveDeployment;
class NodeIntrospection;
struct KeptParameters;

/// What run_node hands to a node. Outlives it.
struct NodeContext {
  std::string name;
  const Deployment& deployment;
  VarPaths var;
  std::uint32_t incarnation = 1;
  ros::Executor& executor;
  ros::Participant& participant;
  HeartbeatPage* heartbeat = nullptr;  ///< this process' page in the liveness ring
  /// The deployment as it is now: nodes are added and removed while the process runs. nullptr: it stays.
  const LiveDeployment* live = nullptr;
  std::vector<ros::RemapRule> remap = {};  ///< of the command line; before those of the deployment
  mission::NodeTables tables = {};         ///< of the program's mission
};

/// Name of the timer with which run_node brings a node up again.
inline constexpr std::string_view bring_up_timer = "bring up";

/// Work of a node that is due by time or by what it knows, beside the input that waits for its work thread.
struct WorkStatus {
  std::uint32_t due = 0;   ///< undone now
  std::uint32_t done = 0;  ///< since the start
  std::optional<MonotonicTime> oldest_due;
};

/// A node of the suite: a lifecycle node (ros/lifecycle_node.hpp) that has a place in a deployment, answers
/// the ring, raises events and keeps its parameters. Everything here is called on the work thread, in the
/// constructor or in callbacks.
///
/// After an error run_node brings it up again. Beside the parameters of each lifecycle node it has
/// parameter_trial_s, and the services ~/check_alive, ~/get_status, ~/get_executor_statistics and
/// ~/save_parameters.
///
/// What a state means for the hardware: Unconfigured has nothing open; Inactive has its devices open but
/// drives nothing and holds no bus, and still answers; Active works.
class Node : public ros::LifecycleNode {
 public:
  /// Blocks on the disk: reads the parameters that were kept.
  explicit Node(NodeContext& context);
  ~Node() override;

  [[nodiscard]] std::uint32_t incarnation() const { return context_.incarnation; }
  /// As it is now. Any thread; what it returns is whole and does not change, and stays until the list of
  /// added nodes has changed LiveDeployment::kept more times.
  [[nodiscard]] const Deployment& deployment() const;
  [[nodiscard]] const VarPaths& var() const { return context_.var; }
  [[nodiscard]] std::filesystem::path state_dir() const { return context_.var.state(name()); }
  /// URI of a device of the deployment; throws ConfigError naming the key when it is missing.
  [[nodiscard]] std::string device(const std::string& key) const;
  /// Where run_node, or the operator, wants it to be.
  [[nodiscard]] ros::State desired_state() const { return desired_; }
  void set_desired(ros::State desired);
  /// Nothing that deactivation began is still under way (a bus to release, an answer to wait for).
  [[nodiscard]] virtual bool is_at_rest() const { return true; }
  /// For the ring: a node whose due work grows old while nothing more gets done is restarted. What waits as
  /// input is counted anyway.
  [[nodiscard]] virtual WorkStatus work_status() const { return {}; }
  /// The housekeeping structure of its work thread. By default that of the dictionary for a node of its name.
  [[nodiscard]] virtual std::optional<mission::WorkThreadStructure> work_structure() const;
  /// Nodes were added or removed: deployment() is another one. On the work thread, in any state.
  virtual void on_deployment_changed() {}
  /// What a new version checks of itself before it may replace the one that runs (`--self-test`): it is
  /// Active, has turned for a second, and every device is absent. @return what is wrong
  [[nodiscard]] virtual Result<void, std::string> self_test() { return {}; }
  /// After the constructor: throws ConfigError for undeclared parameters of the deployment, and moves stored
  /// ones that cannot be used out of the way. Blocks on the disk for the latter.
  void finish_declarations();

  /// The mode that this node obeys; nullopt: none was heard yet, or it follows none.
  [[nodiscard]] const std::optional<ModeInForce>& mode_in_force() const { return mode_.in_force(); }
  /// What the deployment asks of this node in it. Any state; where nothing was heard: nothing special.
  [[nodiscard]] ModeReaction mode_reaction() const;
  /// Whether it listens to /mode: by default, whether the deployment asks something of it in any mode.
  [[nodiscard]] virtual bool follows_mode() const;
  /// mode_in_force() is another one. In any state; what it does is a level, to be kept up by the node. By
  /// default the node obeys by that alone.
  virtual void on_mode_changed() { report_mode_obeyed(0); }
  /// It does now what the mode asks. @param orders  that its peripheral carried out
  void report_mode_obeyed(std::uint8_t orders);
  /// Number of the change of mode that it obeys; nullopt: none, or it is safe by itself.
  [[nodiscard]] std::optional<std::uint32_t> obeyed_change() const { return obeyed_change_; }

  /// Brings the node where it is wanted; hears what happens on the way.
  struct Supervisor {
    std::function<void(ros::State)> commanded;  ///< an operator's transition ended there
    std::function<void()> error_processed;
  };
  void set_supervisor(Supervisor supervisor) { supervisor_ = std::move(supervisor); }
  /// Its answers to the ring.
  [[nodiscard]] CheckAliveService& check_alive() { return *check_alive_; }

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
  /// Publishes one of this node's own housekeeping structures on /<node>/telemetry.
  virtual void publish_telemetry(const srfs_msgs::msg::PayloadTelemetry& sample);

  NodeContext& context() { return context_; }

 protected:
  void on_entered() override;
  void on_transition_begun() override;
  void on_transition_ended() override;
  void on_transition_refused(const std::string& wanted) override;
  void on_transition_late(ros::State transition_state, nanoseconds took, nanoseconds deadline) override;
  void on_commanded(ros::State reached) override;
  void on_error_raised(const std::string& what) override;
  void on_error_processed() override;
  void on_callback_over_budget(const ros::CallbackRecord& record, nanoseconds took,
                               nanoseconds budget) override;
  void on_callback_failed(const ros::CallbackRecord& record, const std::string& what) override;
  void on_parameters_changed(const std::vector<std::string>& names) override;
  void on_malformed_samples(const std::string& topic, std::uint64_t count) override;
  void on_foreign_samples(const std::string& topic, std::uint64_t count, const std::string& source) override;
  void on_order_refused(const std::string& service, std::uint64_t count, const std::string& source) override;
  void on_self_check() override;

 private:
  Node(NodeContext& context, KeptParameters kept);
  void follow_mode();
  void take_mode(bool changed);
  void show_lifecycle();
  void allow_bring_up_time();
  void report_first_activation();
  void report_suppressed_events();

  NodeContext& context_;
  Departures departures_;
  ros::State desired_ = ros::State::active;
  Supervisor supervisor_;
  MonotonicTime event_window_;
  std::uint32_t events_in_window_ = 0;
  std::uint64_t suppressed_events_ = 0;
  std::uint64_t suppressed_reported_ = 0;
  std::uint16_t last_suppressed_event_ = 0;
  ros::Timer start_report_;
  std::shared_ptr<ros::Publisher<srfs_msgs::msg::Event>> event_;
  std::shared_ptr<ros::Publisher<srfs_msgs::msg::PayloadTelemetry>> telemetry_;
  std::unique_ptr<NodeIntrospection> introspection_;
  std::unique_ptr<CheckAliveService> check_alive_;
  ModeFollower mode_;
  std::optional<std::uint32_t> obeyed_change_;
  RejectionLog refused_orders_;
  bool mode_reported_ = false;
  std::shared_ptr<ros::Subscription<srfs_msgs::msg::SystemMode>> mode_subscription_;
  ros::Timer mode_timer_;
};

}  // namespace srfs::suite

#include "suite/run_node.hpp"
