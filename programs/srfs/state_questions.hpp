// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <map>
#include <memory>
#include <string>
#include <vector>

#include <lifecycle_msgs/srv/get_state.hpp>

#include "programs/srfs/bus.hpp"

namespace srfs::tool {

/// Asks nodes for their lifecycle state until it is stopped.
class StateQuestions {
 public:
  StateQuestions(Bus& bus, const std::vector<std::string>& nodes) {
    for (const std::string& node : nodes) clients_[node] = bus.client<GetState>("/" + node + "/get_state");
  }
  void ask(const std::string& node) {
    if (asking_[node]) return;
    asking_[node] = true;
    clients_.at(node)->call({}, ask_deadline, 1,
                            [this, node](const Result<GetState::Response, ros::CallError>& answer) {
                              asking_[node] = false;
                              if (answer) states_[node] = answer->current_state.label;
                            });
  }
  /// The last answer; empty: none.
  [[nodiscard]] std::string state(const std::string& node) const {
    const auto found = states_.find(node);
    return found == states_.end() ? "" : found->second;
  }

 private:
  using GetState = lifecycle_msgs::srv::GetState;
  static constexpr milliseconds ask_deadline{1000};  // an answer may take 200 ms on an emulated processor

  std::map<std::string, std::unique_ptr<ros::Client<GetState>>> clients_;
  std::map<std::string, bool> asking_;
  std::map<std::string, std::string> states_;
};

}  // namespace srfs::tool
