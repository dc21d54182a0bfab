// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <deque>
#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <string>

#include <srfs_msgs/msg/liveness_report.hpp>
#include <srfs_msgs/srv/check_alive.hpp>

#include "base/background.hpp"
#include "base/cpu_users.hpp"
#include "base/fd.hpp"
#include "suite/node.hpp"
#include "suite/ring/check_alive.hpp"
#include "suite/ring/process_cpu.hpp"
#include "suite/ring/ring_monitor.hpp"
#include "update/version_table.hpp"

namespace srfs::suite {

/// A node's half of the liveness ring: carries out what its RingMonitor decides. Asks over DDS, waits for
/// exits on pidfds, reads locks, pages and /proc, publishes /liveness, raises the ring's events. The restarts
/// run on the worker "ring". On the work thread.
class LivenessRing : private CheckAliveService::RingMember {
 public:
  struct Hooks {
    /// Restarts the accused node or reports why not. On the worker "ring"; may block for 2.5 s.
    std::function<RestartOutcome(const Accusation&)> restart;
    /// A node that was restarted so is in its desired state. On the work thread; may be empty.
    std::function<void(const std::string& subject, std::uint32_t incarnation, MonotonicTime at)> recovered;
    /// The version on probation that a node runs has proven itself. On the work thread; may be empty.
    std::function<void(const std::string& subject, std::uint32_t version)> commit;
    /// This node cannot hear itself: the process is to end. On the work thread.
    std::function<void()> exit;
  };

  LivenessRing(Node& node, Hooks hooks);
  ~LivenessRing() override;  ///< waits for the restart that runs
  LivenessRing(const LivenessRing&) = delete;
  LivenessRing& operator=(const LivenessRing&) = delete;

  /// Nodes were added to the deployment, or removed: the membership is another one.
  void on_deployment_changed();
  [[nodiscard]] const RingMonitor& monitor() const { return *monitor_; }
  /// Answers dropped because they came from outside the suite.
  [[nodiscard]] std::uint64_t foreign_answers() const { return foreign_answers_; }

 private:
  using CheckAlive = srfs_msgs::srv::CheckAlive;
  class CheckClient;
  struct Peer {
    std::unique_ptr<CheckClient> client;  ///< made with the first check
    MonotonicTime client_used;
    Fd pidfd;
    ros::Executor::Handle exit_watch;  ///< goes before its descriptor
    pid_t pid = 0;
    std::optional<ProcessCpu> cpu;
    pid_t cpu_pid = 0;                          ///< whose it is
    std::optional<CpuLoan> loan;                ///< while it is in doubt; the same process'
    std::string versions_stamp;                 ///< of the node's folder of versions, when it was read
    std::optional<update::VersionTable> table;  ///< what it said; nullopt: there is none
    MonotonicTime next_commit;                  ///< it may take the disk some seconds
  };

  // Of the node's answers.
  void on_asked(const std::string& observer, std::uint32_t generation) override;
  [[nodiscard]] std::uint32_t generation() const override;
  [[nodiscard]] nanoseconds last_check_age() const override;
  [[nodiscard]] nanoseconds held_up_since(MonotonicTime since) const override;
  [[nodiscard]] nanoseconds stopped_since(MonotonicTime since) const override;

  void on_period();
  void each_second();
  void try_worker();
  void on_answer(const std::string& subject, const CheckAlive::Response& response);
  void on_self_answer(const CheckAlive::Response& response);
  [[nodiscard]] NodeReading look(std::string_view subject) const;
  [[nodiscard]] std::optional<CpuTotals> look_at_cpu(std::string_view subject, pid_t pid, bool doubt);
  [[nodiscard]] nanoseconds waited_since_last_period(MonotonicTime now);
  void read_stolen_time();
  [[nodiscard]] CheckClient& client_of(const std::string& subject);

  void act();
  void carry_out(const RingMonitor::Ask& action);
  void carry_out(const RingMonitor::AskSelf& action);
  void carry_out(const RingMonitor::Follow& action);
  void carry_out(const RingMonitor::Unwatch& action);
  void carry_out(RingMonitor::Accuse& action);
  void carry_out(const RingMonitor::Report& action);
  void carry_out(const RingMonitor::Recovered& action);
  void carry_out(const RingMonitor::Starved& action);
  void carry_out(const RingMonitor::ReadMembership& action);
  void carry_out(const RingMonitor::ExitSelf& action);

  void accuse_culprit(const std::vector<CpuUser>& users);
  void restart_next();
  void conclude(const std::string& subject, const RestartOutcome& outcome);
  void review_membership();
  void review_footprints();
  void review_versions();
  void review_version(const std::string& subject);
  void drop_unused_clients();
  [[nodiscard]] CheckAlive::Request request(std::uint64_t nonce) const;

  Node& node_;
  ros::Executor& executor_;
  const RingSettings settings_;
  Hooks hooks_;
  std::unique_ptr<RingMonitor> monitor_;
  std::map<std::string, Peer, std::less<>> peers_;
  std::unique_ptr<CheckClient> self_;
  std::shared_ptr<ros::Publisher<srfs_msgs::msg::LivenessReport>> reports_;
  srfs_msgs::msg::LivenessReport report_;  // reused: no allocation a round
  std::deque<Accusation> waiting_;         // exits first; at most one a member
  bool restarting_ = false;
  bool worker_tried_ = false;  ///< an empty job is on its way through it
  MonotonicTime due_;
  MonotonicTime next_second_;
  MonotonicTime next_worker_trial_;
  std::string membership_stamp_;
  std::vector<std::string> membership_problems_;
  std::uint64_t foreign_answers_ = 0;
  bool acting_ = false;
  std::optional<ProcessCpu> own_cpu_;  ///< nullopt: the kernel does not tell
  CpuHistory own_history_;
  CpuHistory stolen_history_;  ///< of the host of a virtual machine, as waits
  nanoseconds own_waited_{0};  ///< at the last period
  nanoseconds own_middleware_waited_{0};
  StolenTime stolen_;
  struct CpuSurvey {
    MonotonicTime at;
    ProcessTable processes;
    std::vector<CpuUser> users;  ///< since the survey before
  };
  std::optional<CpuSurvey> survey_;  ///< the worker's; the last one
  std::unique_ptr<ros::Worker> worker_;
  ros::Timer timer_;
};

}  // namespace srfs::suite
