// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "ros/client.hpp"

#include <algorithm>

namespace srfs::ros {
namespace {

constexpr std::size_t most_calls = 64;

}  // namespace

const char* to_text(CallError error) {
  switch (error) {
    case CallError::no_server:
      return "no server";
    case CallError::timeout:
      return "no answer in time";
    case CallError::refused:
      return "request refused";
  }
  return "?";
}

CallTable::CallTable(Executor& executor, std::function<bool()> server_ready, Failed failed)
    : executor_(executor), server_ready_(std::move(server_ready)), failed_(std::move(failed)) {}

std::optional<std::uint64_t> CallTable::add(Attempt attempt, nanoseconds deadline, int attempts) {
  if (calls_.size() >= most_calls) return std::nullopt;
  const std::uint64_t id = next_id_++;
  calls_.emplace(id, Call{std::move(attempt), deadline, std::max(attempts, 1), {}, false, nullptr});
  return id;
}

void CallTable::begin(std::uint64_t call) {
  const auto found = calls_.find(call);
  if (found == calls_.end()) return;
  found->second.timer = executor_.add_timer(
      monotonic_now() + found->second.deadline, nanoseconds(0), [this, call] { on_deadline(call); },
      "call deadline");
  if (server_ready_()) send(call, found->second);
}

void CallTable::send(std::uint64_t id, Call& call) {
  const auto sequence =
      call.attempt(call.sequences.empty() ? std::nullopt : std::optional(call.sequences.front()));
  if (!sequence) {
    fail(id, CallError::refused);
    return;
  }
  call.sent = true;
  --call.attempts_left;
  call.sequences.push_back(*sequence);
  call.timer = executor_.add_timer(
      monotonic_now() + call.deadline, nanoseconds(0), [this, id] { on_deadline(id); }, "call deadline");
}

void CallTable::on_deadline(std::uint64_t id) {
  const auto found = calls_.find(id);
  if (found == calls_.end()) return;
  Call& call = found->second;
  if (!call.sent) {
    fail(id, CallError::no_server);
  } else if (call.attempts_left > 0) {
    send(id, call);
  } else {
    fail(id, CallError::timeout);
  }
}

void CallTable::fail(std::uint64_t id, CallError error) {
  calls_.erase(id);
  failed_(id, error);
}

std::optional<std::uint64_t> CallTable::finish(std::int64_t sequence) {
  const auto found = std::find_if(calls_.begin(), calls_.end(), [&](const auto& entry) {
    const auto& sent = entry.second.sequences;
    return std::find(sent.begin(), sent.end(), sequence) != sent.end();
  });
  if (found == calls_.end()) return std::nullopt;
  const std::uint64_t id = found->first;
  calls_.erase(found);
  return id;
}

void CallTable::server_changed() {
  if (!server_ready_()) return;
  std::vector<std::uint64_t> unsent;
  for (const auto& [id, call] : calls_) {
    if (!call.sent) unsent.push_back(id);
  }
  for (const std::uint64_t id : unsent) {
    if (const auto found = calls_.find(id); found != calls_.end()) send(id, found->second);
  }
}

}  // namespace srfs::ros
