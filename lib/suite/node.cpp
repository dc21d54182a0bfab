// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "suite/node.hpp"

#include <algorithm>

#include <fmt/format.h>

#include <mission/structures.hpp>

#include "base/excerpt.hpp"
#include "base/saturate.hpp"
#include "ros/time_message.hpp"
#include "suite/added_nodes.hpp"
#include "suite/node_introspection.hpp"
#include "suite/real_time.hpp"
#include "suite/ring/heartbeat_page.hpp"
#include "suite/ring/node_record.hpp"

namespace srfs::suite {
namespace {

constexpr std::uint32_t most_events_per_s = 20;
constexpr milliseconds mode_check_period{500};
constexpr seconds start_report_delay{
    2};  // discovery needs a moment: an event raised at once would reach no reader

ros::NodeOptions options_of(const NodeContext& context, const KeptParameters& kept) {
  const NodeEntry* entry = context.deployment.find(context.name);
  ros::ParameterSet parameters;
  if (entry != nullptr) parameters = ros::ParameterSet(entry->parameters);
  parameters.set_stored(kept.history.values());
  for (const auto& guarded : context.tables.guarded_parameters) {
    if (guarded.node == context.name) parameters.guard(std::string(guarded.name));
  }
  std::vector<ros::RemapRule> remap = context.remap;
  if (entry != nullptr) remap.insert(remap.end(), entry->remap.begin(), entry->remap.end());
  return {
      .names = ros::NodeNames(context.name, "/", std::move(remap)),
      .executor = context.executor,
      .participant = context.participant,
      .graph = context.deployment.ros_graph,
      .parameters = std::move(parameters),
      .worker_deadline = entry != nullptr ? entry->worker_deadline : context.deployment.ring.worker_deadline,
      .obeys_foreign = context.deployment.open_orders};
}

}  // namespace

std::optional<mission::WorkThreadStructure> Node::work_structure() const {
  for (const auto& work : context_.tables.work_threads) {
    if (work.node == name()) return work;
  }
  return std::nullopt;
}

Node::Node(NodeContext& context) : Node(context, read_kept_parameters(context.var.state(context.name))) {}

Node::Node(NodeContext& context, KeptParameters kept)
    : LifecycleNode(options_of(context, kept)),
      context_(context),
      departures_(context.executor, context.participant, context.var,
                  [this](const std::string& node) { return deployment().find(node) != nullptr; }),
      event_(create_publisher(topics::event)),
      telemetry_(create_publisher(topics::telemetry(name()))),
      mode_(context.deployment.modes, monotonic_now()) {
  declare_parameter("parameter_trial_s", std::int64_t{300}, ros::ParameterRange{1, 86400},
                    "Time within which a guarded change must be confirmed; otherwise it reverts");
  introspection_ = std::make_unique<NodeIntrospection>(*this, std::move(kept));
  check_alive_ = std::make_unique<CheckAliveService>(*this);
  allow_bring_up_time();
}

Node::~Node() = default;

const Deployment& Node::deployment() const {
  return context_.live != nullptr ? context_.live->current() : context_.deployment;
}

std::string Node::device(const std::string& key) const {
  const auto found = deployment().devices.find(key);
  if (found != deployment().devices.end()) return found->second;
  throw ConfigError(fmt::format("{}: 'devices.{}': expected the URI of this device, found nothing",
                                deployment().file.string(), key));
}

void Node::finish_declarations() {
  parameters().finish();
  introspection_->begin_keeping();
  if (follows_mode()) follow_mode();
}

// ---------------------------------------------------------------- mode

bool Node::follows_mode() const {
  return context_.deployment.modes.concerns(name());
}

void Node::follow_mode() {
  mode_subscription_ = create_subscription(topics::mode, [this](const srfs_msgs::msg::SystemMode& m) {
    const MonotonicTime sent{
        nanoseconds(static_cast<std::int64_t>(std::min<std::uint64_t>(m.monotonic_ns, INT64_MAX)))};
    take_mode(mode_.on_mode({m.mode, m.name, m.change, m.reason, sent}, monotonic_now()));
  });
  mode_timer_ = create_timer(
      mode_check_period, [this] { take_mode(mode_.on_time(monotonic_now())); }, "mode");
}

void Node::take_mode(bool changed) {
  if (!changed) return;
  const ModeInForce& mode = *mode_.in_force();
  obeyed_change_.reset();
  if (mode.by_itself) {
    log::error("mode safe by itself until /mode is heard again: {}", mode.reason);
    raise(mission::NodeModeByItselfEvent{.reason = excerpt(mode.reason, 80)});
  } else {
    log::info("mode {}: {}", mode.name, mode.reason);
  }
  on_mode_changed();
}

ModeReaction Node::mode_reaction() const {
  const auto& mode = mode_.in_force();
  return mode ? context_.deployment.modes.reaction(mode->name, name()) : ModeReaction{};
}

void Node::report_mode_obeyed(std::uint8_t orders) {
  const auto& mode = mode_.in_force();
  if (!mode || mode->by_itself || obeyed_change_ == mode->change) return;
  obeyed_change_ = mode->change;
  // A start in a mode that asks nothing is no news.
  const ModeReaction reaction = mode_reaction();
  const bool asks = !reaction.hold.empty() || !reaction.work;
  if (!std::exchange(mode_reported_, true) && !asks) return;
  mission::NodeModeObeyedEvent event;
  event.mode = static_cast<mission::MissionMode>(mode->number);
  event.change = mode->change;
  event.orders = orders;
  event.reason = excerpt(mode->reason, 60);
  raise(event);
}

void Node::set_desired(ros::State desired) {
  desired_ = desired;
  show_lifecycle();
}

void Node::show_lifecycle() {
  if (context_.heartbeat == nullptr) return;
  context_.heartbeat->lifecycle(static_cast<std::uint32_t>(state()), static_cast<std::uint32_t>(desired_),
                                monotonic_now());
}

/// Its work is several transitions.
void Node::allow_bring_up_time() {
  constexpr int most_transitions = 4;
  const milliseconds transition(get_parameter<std::int64_t>("transition_deadline_ms"));
  context_.executor.statistics().record(ros::CallbackKind::timer, bring_up_timer).budget =
      transition * most_transitions;
}

// ---------------------------------------------------------------- what happened

void Node::on_entered() {
  show_lifecycle();
}

void Node::on_transition_begun() {
  bound_real_time(real_time_in_transition);
}

void Node::on_transition_ended() {
  if (is_active()) bound_real_time(real_time_at_work);
  const ros::LastTransition& last = last_transition();
  if (last.outcome == ros::LastTransition::Outcome::failed) {
    raise(mission::NodeTransitionFailedEvent{
        .transition = last.label, .state = std::string(label(state())), .reason = last.reason});
  }
  report_first_activation();
}

void Node::on_transition_refused(const std::string& wanted) {
  raise(mission::NodeTransitionRefusedEvent{.transition = wanted, .state = std::string(label(state()))});
}

void Node::on_transition_late(ros::State transition_state, nanoseconds took, nanoseconds deadline) {
  raise(mission::NodeTransitionLateEvent{
      .state = std::string(label(transition_state)),
      .took_ms = static_cast<std::uint32_t>(took / milliseconds(1)),
      .deadline_ms = static_cast<std::uint32_t>(deadline / milliseconds(1))});
}

void Node::on_commanded(ros::State reached) {
  // A few octets, on an operator's command only: worth waiting for, so that the answer is true after a power
  // loss too.
  if (const auto written = set_desired_state(var(), deployment(), name(), reached, monotonic_now());
      !written) {
    log::error("the desired state '{}' will not survive a restart: {}", label(reached), written.error());
  }
  if (supervisor_.commanded) supervisor_.commanded(reached);
}

void Node::on_error_raised(const std::string& what) {
  raise(mission::NodeErrorEvent{.what = what});
}

void Node::on_error_processed() {
  if (supervisor_.error_processed) supervisor_.error_processed();
}

void Node::on_callback_over_budget(const ros::CallbackRecord& record, nanoseconds took, nanoseconds budget) {
  raise(
      mission::NodeCallbackOverBudgetEvent{.callback = record.name,
                                           .took_us = static_cast<std::uint32_t>(took / microseconds(1)),
                                           .budget_us = static_cast<std::uint32_t>(budget / microseconds(1)),
                                           .count = static_cast<std::uint32_t>(record.over_budget)});
}

void Node::on_callback_failed(const ros::CallbackRecord& record, const std::string& what) {
  raise(mission::NodeCallbackFailedEvent{.callback = record.name, .what = what});
}

void Node::on_parameters_changed(const std::vector<std::string>& names) {
  allow_bring_up_time();
  introspection_->on_parameters_changed(names);
}

void Node::on_malformed_samples(const std::string& topic, std::uint64_t count) {
  raise(mission::NodeMalformedSamplesEvent{.count = static_cast<std::uint32_t>(count), .topic = topic});
}

void Node::on_foreign_samples(const std::string& topic, std::uint64_t count, const std::string& source) {
  raise(mission::NodeForeignSamplesEvent{
      .count = static_cast<std::uint32_t>(count), .topic = topic, .participant = source});
}

void Node::on_order_refused(const std::string& service, std::uint64_t count, const std::string& source) {
  if (!refused_orders_.add(monotonic_now())) return;
  log::warn(
      "{} orders from outside the suite refused so far, last on {} by participant {}: dds.orders is "
      "proven; use srfs",
      count, service, source);
  raise(mission::NodeForeignSamplesEvent{
      .count = static_cast<std::uint32_t>(count), .topic = service, .participant = source});
}

void Node::on_self_check() {
  report_suppressed_events();
  log::report_held_back();
  introspection_->publish_work();
}

void Node::report_first_activation() {
  if (!is_active() || start_report_) return;
  start_report_ = create_one_shot(
      monotonic_now() + start_report_delay,
      [this] {
        raise(mission::NodeStartedEvent{.incarnation = incarnation()});
        introspection_->raise_start_report();
      },
      "start report");
}

// ---------------------------------------------------------------- events and telemetry

void Node::report_suppressed_events() {
  if (suppressed_events_ <= suppressed_reported_) return;
  const mission::NodeEventsSuppressedEvent event{
      .event = last_suppressed_event_,
      .count = static_cast<std::uint32_t>(suppressed_events_ - suppressed_reported_)};
  suppressed_reported_ = suppressed_events_;
  raise(event);
}

void Node::raise_event(std::uint16_t event_id, std::uint8_t severity, OctetView data) {
  const MonotonicTime t = monotonic_now();
  if (t - event_window_ >= seconds(1)) {
    event_window_ = t;
    events_in_window_ = 0;
  }
  if (++events_in_window_ > most_events_per_s) {
    ++suppressed_events_;
    last_suppressed_event_ = event_id;
    return;
  }
  srfs_msgs::msg::Event m;
  m.source = name();
  m.event_id = event_id;
  m.severity = severity;
  m.utc = ros::to_message(system_utc_now());
  m.time_valid = false;  // the node's own clock; ttc stamps the report with mission time
  m.monotonic_ns = static_cast<std::uint64_t>(t.ns());
  m.data.assign(data.begin(), data.end());
  event_->publish(m);
}

void Node::publish_telemetry(const srfs_msgs::msg::PayloadTelemetry& sample) {
  telemetry_->publish(sample);
}

}  // namespace srfs::suite
