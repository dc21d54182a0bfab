// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
// Limit violations of versions on probation: seen here, judged and carried out by the ring.
#include <malloc.h>

#include "msgs/mission/dictionary.hpp"
#include "nodes/maintenance/limit_watch.hpp"
#include "nodes/maintenance/maintenance_node.hpp"
#include "nodes/maintenance/version_rules.hpp"
#include "suite/node_versions.hpp"

namespace srfs {

struct MaintenanceNode::Limits {
  explicit Limits(mission::Dictionary loaded) : dictionary(std::move(loaded)) {}

  mission::Dictionary dictionary;
  LimitWatch watch;
  std::vector<std::shared_ptr<void>> subscriptions;
};

/// The dictionary is read aside: it takes its time, and without it the node does the rest of its work.
void MaintenanceNode::open_limits() {
  (void)worker_->ask(
      []() -> std::optional<mission::Dictionary> {
        try {
          return mission::Dictionary::load(mission::Dictionary::default_folder());
        } catch (const ConfigError& e) {
          log::error("cannot monitor the limits of versions on probation: {}", e.what());
          return std::nullopt;
        }
      },
      [this](std::optional<mission::Dictionary> dictionary) {
        if (dictionary) watch_limits(std::make_shared<Limits>(std::move(*dictionary)));
        malloc_trim(0);  // what reading YAML took
      });
}

void MaintenanceNode::watch_limits(std::shared_ptr<Limits> limits) {
  limits_ = std::move(limits);
  const auto keep = [this](auto subscription) { limits_->subscriptions.push_back(std::move(subscription)); };
  keep(create_subscription(suite::topics::event, [this](const srfs_msgs::msg::Event& m) {
    if (deployment().find(m.source) == nullptr) return;
    const mission::Event* event = limits_->dictionary.event(m.event_id);
    const auto started = suite::last_started(var(), m.source);
    if (event == nullptr || !started) return;
    if (const auto blame = limits_->watch.on_event(m.source, *event, started->since, now()))
      blame_version(m.source, *blame);
  }));
  for (const suite::NodeEntry& node : deployment().nodes) {
    if (node.name == name()) continue;
    keep(create_subscription(suite::topics::telemetry(node.name),
                             [this, node = node.name](const srfs_msgs::msg::PayloadTelemetry& m) {
                               if (m.source == node) on_sample(m);
                             }));
  }
  log::info("monitoring the limits of versions on probation");
}

void MaintenanceNode::on_sample(const srfs_msgs::msg::PayloadTelemetry& message) {
  const mission::Structure* structure = limits_->dictionary.structure(message.structure_id);
  if (structure == nullptr || !has_hard_limits(*structure)) return;
  const auto fields = limits_->dictionary.decode(*structure, message.data);
  const auto started = suite::last_started(var(), message.source);
  if (!fields || !started) return;
  if (const auto blame = limits_->watch.on_sample(message.source, *structure, *fields, started->since, now()))
    blame_version(message.source, *blame);
}

/// Leaves word for the observers of the node; whether its version is on probation they look for themselves.
void MaintenanceNode::blame_version(const std::string& node, const std::string& violation) {
  const auto table = suite::read_versions(var(), node).table;
  const auto trial = suite::trial_of(var(), deployment().ring, node, table, true, now());
  if (!is_on_probation(trial)) return;
  const auto started = suite::last_started(var(), node);
  if (!started || suite::violation_of(var(), node, started->pid)) return;
  log::warn("{}: blaming version {} for {}", node, trial->version, violation);
  suite::report_violation(var(), node, started->pid, violation);
}

void MaintenanceNode::close_limits() {
  limits_.reset();
}

}  // namespace srfs
