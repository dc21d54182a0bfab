// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <functional>
#include <memory>
#include <vector>

#include <srfs_msgs/srv/check_alive.hpp>

#include "nodes/timing/critical_answers.hpp"
#include "nodes/timing/watchdog_feeding.hpp"
#include "ros/client.hpp"
#include "suite/ring/process_cpu.hpp"

namespace srfs {

/// Asks every critical node of the ring other than timing itself whether it is alive, each second, and turns
/// the answers into evidence for the watchdog. Adapter of CriticalAnswers.
class CriticalWatch {
 public:
  using Client = ros::Client<srfs_msgs::srv::CheckAlive>;

  /// @param observer  timing's own name
  CriticalWatch(CriticalAnswers answers, std::string observer);

  /// @param make  a client of the service of this name
  void open(const std::function<std::shared_ptr<Client>(const std::string& service)>& make);
  /// Sends the questions, and reads what each node had of the CPU.
  /// @param find  the process that is the node now; nullopt: none
  void ask(MonotonicTime now, const std::function<std::optional<pid_t>(const std::string& node)>& find);
  /// One per node. They refer to this object.
  [[nodiscard]] std::vector<WatchdogEvidence> evidence() const;
  [[nodiscard]] const CriticalAnswers& answers() const { return answers_; }

 private:
  CriticalAnswers answers_;
  std::string observer_;
  std::vector<std::shared_ptr<Client>> clients_;
  struct Process {
    pid_t pid = 0;
    std::optional<suite::ProcessCpu> cpu;
  };
  std::vector<Process> processes_;  ///< by node
};

}  // namespace srfs
