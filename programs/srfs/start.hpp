// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "programs/srfs/process_cpu.hpp"
#include "programs/srfs/start_patience.hpp"
#include "programs/srfs/state_questions.hpp"
#include "programs/srfs/suite.hpp"
#include "suite/launcher.hpp"

namespace srfs::tool {

/// One `srfs up` from the first launch on: launches nodes, then checks them until the awaited ones are up, or
/// will not come up. Shows on stderr what it waits for.
class Start {
 public:
  Start(const Target& target, const UpOptions& options, Bus& bus);

  /// Those that flight needs first, then the others; held ones are left alone. Blocks up to some seconds a
  /// node.
  void launch(const suite::LaunchRequest& request);
  void wait();
  void tell(UpReport& report);
  /// As `srfs status` shows it.
  [[nodiscard]] std::string state(const NodeStatus& node) const;

 private:
  struct Node {
    const suite::NodeEntry* entry;
    bool awaited;
    std::optional<std::string> held = {};  ///< and why
    std::string wanted = {};               ///< the state it starts for
    std::optional<Process> launched = {};  ///< one without instance lock may still be loading
    std::string launch_problem = {};
    std::optional<ProcessCpu> cpu = {};
    std::optional<MonotonicTime> gone_since = {};
    StartReading reading = {};
  };
  [[nodiscard]] bool is_there(const Node& node) const;
  [[nodiscard]] std::string state_of(const Node& node) const;
  [[nodiscard]] static std::string cpu_of(const Node& node);
  bool all_there();
  /// Reads files of each node that is not there.
  void look(MonotonicTime now);
  void read(Node& node, MonotonicTime now);
  void show(MonotonicTime now);
  void wipe();

  const Target& target_;
  Bus& bus_;
  StateQuestions questions_;
  std::vector<Node> nodes_;
  MonotonicTime begin_;
  nanoseconds deadline_;
  StartPatience patience_;
  bool ended_ = false;  ///< an awaited node is gone and is not restarted
  bool reached_ = false;
  bool terminal_;
  MonotonicTime next_show_;
  std::size_t shown_ = 0;  ///< lines on the terminal
};

}  // namespace srfs::tool
