// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "programs/srfs/diagnostics.hpp"

#include <algorithm>

#include <fmt/format.h>
#include <lifecycle_msgs/msg/state.hpp>

namespace srfs::tool {
namespace {

using diagnostic_msgs::msg::DiagnosticStatus;
using Answer = srfs_msgs::srv::GetNodeStatus_Response;

bool answers(const NodeHealth& health, MonotonicTime now) {
  return health.answer && health.answered && now - *health.answered <= longest_silence;
}

/// Why a node that answers is not well; empty: it is.
std::string complaint(const Answer& answer) {
  if (answer.state != lifecycle_msgs::msg::State::PRIMARY_STATE_ACTIVE)
    return answer.last_reason.empty() ? answer.state_label
                                      : fmt::format("{}: {}", answer.state_label, answer.last_reason);
  if (answer.last_outcome == Answer::FAILED || answer.last_outcome == Answer::ERROR)
    return fmt::format("{} failed: {}", answer.last_transition, answer.last_reason);
  if (answer.failed_callbacks > 0)
    return fmt::format("{} callbacks ended with an exception", answer.failed_callbacks);
  return {};
}

void judge(const NodeHealth& health, MonotonicTime now, DiagnosticStatus& status) {
  if (!health.instance) {
    status.level = DiagnosticStatus::ERROR;
    status.message = "not running";
  } else if (!answers(health, now)) {
    status.level = DiagnosticStatus::STALE;
    status.message = "not answering";
  } else {
    status.message = complaint(*health.answer);
    status.level = status.message.empty() ? DiagnosticStatus::OK : DiagnosticStatus::WARN;
    if (status.message.empty()) status.message = health.answer->state_label;
  }
}

}  // namespace

DiagnosticStatus diagnose(const NodeHealth& health, const std::string& suite, MonotonicTime now) {
  DiagnosticStatus status;
  status.name = fmt::format("{}: {}", suite, health.node);
  status.hardware_id = suite;
  judge(health, now, status);
  const auto say = [&](const char* key, std::string value) {
    status.values.push_back({key, std::move(value)});
  };
  say("restarts", std::to_string(health.starts.restarts));
  say("last restart", health.starts.last_cause);
  if (!health.instance) return status;
  say("pid", std::to_string(health.instance->pid));
  say("incarnation", std::to_string(health.instance->incarnation));
  say("version", health.instance->version);
  if (!answers(health, now)) return status;
  say("state", health.answer->state_label);
  say("up for s", std::to_string(health.answer->uptime_ns / 1'000'000'000));
  say("failed transitions", std::to_string(health.answer->failed_transitions));
  say("failed callbacks", std::to_string(health.answer->failed_callbacks));
  return status;
}

std::vector<DiagnosticStatus> aggregate(const std::vector<DiagnosticStatus>& statuses,
                                        const std::string& suite) {
  DiagnosticStatus all;
  all.name = "/" + suite;
  all.hardware_id = suite;
  std::size_t well = 0;
  std::vector<DiagnosticStatus> tree{all};
  for (const DiagnosticStatus& status : statuses) {
    tree.front().level = std::max(tree.front().level, status.level);
    if (status.level == DiagnosticStatus::OK) ++well;
    DiagnosticStatus& one = tree.emplace_back(status);
    one.name =
        fmt::format("/{}/{}", suite, status.name.substr(std::min(suite.size() + 2, status.name.size())));
  }
  tree.front().message = fmt::format("{} of {} nodes are well", well, statuses.size());
  return tree;
}

}  // namespace srfs::tool
