// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "nodes/timing/critical_watch.hpp"

#include <utility>

#include "suite/ring/check_alive.hpp"

namespace srfs {

CriticalWatch::CriticalWatch(CriticalAnswers answers, std::string observer)
    : answers_(std::move(answers)), observer_(std::move(observer)) {}

void CriticalWatch::open(const std::function<std::shared_ptr<Client>(const std::string& service)>& make) {
  clients_.clear();
  for (const std::string& node : answers_.nodes()) clients_.push_back(make(suite::check_alive_name(node)));
}

void CriticalWatch::ask(MonotonicTime now,
                        const std::function<std::optional<pid_t>(const std::string& node)>& find) {
  processes_.resize(clients_.size());
  for (std::size_t i = 0; i < clients_.size(); ++i) {
    Process& process = processes_[i];
    const pid_t pid = find(answers_.nodes()[i]).value_or(0);
    if (std::exchange(process.pid, pid) != pid)
      process.cpu = pid != 0 ? suite::ProcessCpu::open(pid) : std::nullopt;
    if (const auto totals = process.cpu ? process.cpu->read(false, now) : std::nullopt)
      answers_.on_cpu(i, pid, *totals, now);
    srfs_msgs::srv::CheckAlive::Request question;
    question.nonce = answers_.ask(i, now);
    question.observer = observer_;
    clients_[i]->call(question, critical_check_period, 1, [this, i](const Client::Outcome& answer) {
      if (answer) answers_.on_answer(i, answer->nonce, answer->lifecycle_state);
    });
  }
}

std::vector<WatchdogEvidence> CriticalWatch::evidence() const {
  std::vector<WatchdogEvidence> all;
  for (std::size_t i = 0; i < answers_.nodes().size(); ++i) {
    all.push_back({answers_.nodes()[i] + " is not Active",
                   [this, i](MonotonicTime now) { return answers_.holds(i, now); }});
  }
  return all;
}

}  // namespace srfs
