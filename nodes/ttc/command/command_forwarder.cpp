// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "nodes/ttc/command/command_forwarder.hpp"

#include <algorithm>
#include <utility>

#include <mission/structures.hpp>

namespace srfs {

std::uint64_t first_telecommand_id(std::uint64_t stored, std::uint64_t known, UtcTime utc) {
  constexpr std::int64_t start_of_2020_s = 1'577'836'800;
  constexpr unsigned ids_a_second_log2 = 4;
  const std::int64_t since_2020_s = utc.ns() / 1'000'000'000 - start_of_2020_s;
  const std::uint64_t by_clock =
      since_2020_s > 0 ? static_cast<std::uint64_t>(since_2020_s) << ids_a_second_log2 : 0;
  return std::max({stored, known, by_clock, std::uint64_t{1}});
}

bool CommandForwarder::has_room(const std::string& target, std::size_t reserved) const {
  const auto found = nodes_.find(target);
  if (found == nodes_.end()) return reserved < max_unacknowledged + max_queued;
  const Node& node = found->second;
  const std::size_t waiting = node.unacknowledged.size() + node.queued.size() + reserved;
  return waiting < max_unacknowledged + max_queued && node.executing.size() < max_executing;
}

Result<void, ForwardError> CommandForwarder::submit(Telecommand telecommand, MonotonicTime now) {
  const std::string& target = telecommand.command->node;
  if (!has_room(target)) {
    ++counters_.refused;
    return Err(ForwardError::queue_full);
  }
  ++counters_.submitted;
  Node& node = nodes_[target];
  const MonotonicTime expiry = telecommand.expiry;
  node.queued.push_back({.telecommand = std::move(telecommand), .publish_next = now, .give_up = expiry});
  fill(node, now);
  return {};
}

void CommandForwarder::restore(Telecommand telecommand, const TelecommandProgress& progress,
                               MonotonicTime now) {
  ++counters_.submitted;
  Node& node = nodes_[telecommand.command->node];
  Entry entry{
      .telecommand = std::move(telecommand), .progress = progress, .publish_next = now, .give_up = {}};
  if (progress.other_boot) entry.telecommand.expiry = now;
  // Its node may have it, or even have done it: only the node knows.
  entry.give_up = std::max(entry.telecommand.expiry, now) + completion_grace;
  if (progress.taken) {
    // Not all at once: as many as may be unacknowledged in each period.
    const auto turn = static_cast<int>(node.executing.size() / max_unacknowledged);
    entry.publish_next = now + republish_period * turn / 2;
    node.executing.push_back(std::move(entry));
  } else {
    node.queued.push_back(std::move(entry));
  }
}

void CommandForwarder::fill(Node& node, MonotonicTime now) {
  while (!node.queued.empty() && node.unacknowledged.size() < max_unacknowledged) {
    node.unacknowledged.push_back(std::move(node.queued.front()));
    node.queued.pop_front();
    publish(node.unacknowledged.back(), now);
  }
}

void CommandForwarder::publish(Entry& entry, MonotonicTime now) {
  entry.publish_next = now + (entry.progress.taken ? ask_period : republish_period);
  ++counters_.published;
  publications_.push_back(entry.telecommand);
  // A node that knows the id says how far it got, whatever the expiry. One that does not know it must not
  // begin what it, or the boot before, may have done already.
  const bool may_not_begin =
      entry.progress.other_boot ||
      (entry.progress.taken && entry.telecommand.command->repeat_class == mission::RepeatClass::at_most_once);
  if (may_not_begin) publications_.back().expiry = MonotonicTime(nanoseconds(1));
}

void CommandForwarder::take(Node& node, Entry entry, MonotonicTime now) {
  entry.progress.taken = true;
  entry.give_up = entry.latest_end();
  entry.publish_next = now + ask_period;
  taken_.push_back(entry.id());
  node.executing.push_back(std::move(entry));
}

void CommandForwarder::on_report(const std::string& from, const StageReached& report, MonotonicTime now) {
  const auto has_id = [&](const Entry& entry) { return entry.id() == report.id && entry.target() == from; };
  for (auto& [name, node] : nodes_) {
    const auto waiting = std::find_if(node.unacknowledged.begin(), node.unacknowledged.end(), has_id);
    if (waiting != node.unacknowledged.end()) {
      // Any report proves that the node has the command.
      Entry entry = std::move(*waiting);
      node.unacknowledged.erase(waiting);
      if (!apply(entry, report)) take(node, std::move(entry), now);
      fill(node, now);
      return;
    }
    const auto executing = std::find_if(node.executing.begin(), node.executing.end(), has_id);
    if (executing != node.executing.end()) {
      if (report.stage == Stage::acceptance && report.success) {
        ++counters_.duplicate_reports;
      } else if (report.stage == Stage::acceptance) {
        // It had it, and refuses it as a new one: what it knew is lost, and with it what it did.
        fail(*executing, Stage::completion, mission::failure::interrupted, {});
        node.executing.erase(executing);
      } else if (apply(*executing, report)) {
        node.executing.erase(executing);
      }
      return;
    }
  }
  ++counters_.stray_reports;
}

bool CommandForwarder::apply(Entry& entry, const StageReached& report) {
  if (!report.success) {
    // ttc has reported the acceptance already, so a node that refuses the command fails its start.
    const Stage stage = report.stage == Stage::acceptance ? Stage::start : report.stage;
    fail(entry, stage, report.failure_code, report.data);
    return true;
  }
  switch (report.stage) {
    case Stage::acceptance:
    case Stage::routing:
      return false;
    case Stage::start:
      if (entry.progress.started) ++counters_.duplicate_reports;
      report_start(entry);
      return false;
    case Stage::progress:
      if (report.step <= entry.progress.last_step) {
        ++counters_.duplicate_reports;
        return false;
      }
      report_start(entry);
      entry.progress.last_step = report.step;
      report_queue_.success(entry.telecommand.origin, Stage::progress, report.step);
      return false;
    case Stage::completion:
      report_start(entry);
      ++counters_.completed;
      report_queue_.success(entry.telecommand.origin, Stage::completion);
      return true;
  }
  return false;
}

void CommandForwarder::report_start(Entry& entry) {
  if (entry.progress.started) return;
  entry.progress.started = true;
  report_queue_.success(entry.telecommand.origin, Stage::start);
}

void CommandForwarder::fail(const Entry& entry, Stage stage, std::uint16_t code, OctetView data) {
  ++counters_.failed;
  const TelecommandOrigin& origin = entry.telecommand.origin;
  report_queue_.failure(origin, stage, code, data, static_cast<std::uint8_t>(entry.progress.last_step + 1));
  // A failed step ends the command, and every started command gets its completion report.
  if (stage == Stage::progress) report_queue_.failure(origin, Stage::completion, code, data);
}

void CommandForwarder::expire(const Entry& entry, Stage stage, std::uint16_t code) {
  ++counters_.expired;
  mission::TtcTelecommandExpiredEvent event;
  event.telecommand = entry.id();
  event.node = entry.target();
  expired_.push_back(std::move(event));
  fail(entry, stage, code, {});
}

void CommandForwarder::on_time(MonotonicTime now) {
  for (auto& [name, node] : nodes_) {
    end_expired(node, now);
    for (std::deque<Entry>* entries : {&node.unacknowledged, &node.executing}) {
      for (Entry& entry : *entries) {
        if (now >= entry.publish_next) publish(entry, now);
      }
    }
    fill(node, now);
  }
}

void CommandForwarder::end_expired(Node& node, MonotonicTime now) {
  const auto not_taken = [&](const Entry& entry) {
    if (now < entry.give_up) return false;
    expire(entry, Stage::start, mission::failure::node_unavailable);
    return true;
  };
  const auto not_completed = [&](const Entry& entry) {
    if (now < entry.give_up) return false;
    expire(entry, entry.progress.started ? Stage::completion : Stage::start,
           mission::failure::completion_unknown);
    return true;
  };
  std::erase_if(node.unacknowledged, not_taken);
  std::erase_if(node.queued, not_taken);
  std::erase_if(node.executing, not_completed);
}

std::optional<MonotonicTime> CommandForwarder::next_due() const {
  std::optional<MonotonicTime> next;
  const auto sooner = [&](MonotonicTime t) { next = next ? std::min(*next, t) : t; };
  for (const auto& [name, node] : nodes_) {
    for (const Entry& entry : node.unacknowledged) sooner(std::min(entry.publish_next, entry.give_up));
    for (const Entry& entry : node.queued) sooner(entry.give_up);
    for (const Entry& entry : node.executing) sooner(std::min(entry.publish_next, entry.give_up));
  }
  return next;
}

std::optional<MonotonicTime> CommandForwarder::latest_end() const {
  std::optional<MonotonicTime> latest;
  for (const auto& [name, node] : nodes_) {
    for (const auto* waiting : {&node.queued, &node.unacknowledged, &node.executing}) {
      for (const Entry& entry : *waiting) latest = std::max(latest, std::optional(entry.latest_end()));
    }
  }
  return latest;
}

std::size_t CommandForwarder::under_way() const {
  std::size_t sum = 0;
  for (const auto& [name, node] : nodes_)
    sum += node.queued.size() + node.unacknowledged.size() + node.executing.size();
  return sum;
}

}  // namespace srfs
