// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "nodes/ttc/ttc_node.hpp"

#include <array>

#include <fmt/format.h>

namespace srfs {
namespace {

using rcl_interfaces::srv::GetParameters;
using rcl_interfaces::srv::SetParameters;

constexpr int reads_per_wake = 8;          ///< so that a flood on the line cannot starve the tick
constexpr seconds connection_patience{2};  ///< of a test whether a node is there
/// Of one call for a parameter, the search for the node's service in it.
constexpr seconds answer_deadline{4};

/// A node's report has the numbers of PUS 1. Routing is no matter of nodes.
std::optional<Stage> to_stage(std::uint8_t number) {
  const auto stage = static_cast<Stage>(number);
  return is_valid(stage) && stage != Stage::routing ? std::optional(stage) : std::nullopt;
}

std::optional<NodeValue> to_node_value(const ros::ParameterValue& value) {
  return std::visit(
      [](const auto& v) -> std::optional<NodeValue> {
        using Type = std::decay_t<decltype(v)>;
        if constexpr (std::is_constructible_v<NodeValue, Type>) return NodeValue(v);
        return std::nullopt;
      },
      value);
}

ros::ParameterValue to_ros(const NodeValue& value) {
  return std::visit([](const auto& v) { return ros::ParameterValue(v); }, value);
}

void tell_value(ParameterService& parameters, std::uint64_t number,
                const ros::Client<GetParameters>::Outcome& outcome) {
  if (!outcome) return parameters.on_error(number, ParameterCallError::no_answer);
  const auto ros_value = outcome->values.empty() ? std::nullopt : ros::from_message(outcome->values.front());
  const auto value = ros_value ? to_node_value(*ros_value) : std::nullopt;
  value ? parameters.on_value(number, *value)
        : parameters.on_error(number, ParameterCallError::no_such_parameter);
}

void tell_set(ParameterService& parameters, std::uint64_t number,
              const ros::Client<SetParameters>::Outcome& outcome) {
  if (!outcome) return parameters.on_error(number, ParameterCallError::no_answer);
  if (outcome->results.empty()) return parameters.on_error(number, ParameterCallError::no_such_parameter);
  const auto& result = outcome->results.front();
  result.successful ? parameters.on_set(number, {}) : parameters.on_set(number, Err(result.reason));
}

}  // namespace

// ---- line

bool TtcNode::read_line() {
  std::array<std::uint8_t, TtcCore::read_octets> octets{};
  for (int i = 0; i < reads_per_wake; ++i) {
    const auto count = line_->read(octets);
    if (!count || *count == 0) return true;
    core_->on_octets(OctetView(octets.data(), *count), monotonic_now());
  }
  return false;
}

bool TtcNode::write_outgoing() {
  while (!outgoing_.empty()) {
    const auto written = line_->write(outgoing_);
    if (!written) {  // no line: what is sent now is lost, as on the air
      ++lost_frames_;
      outgoing_.clear();
      return true;
    }
    if (*written == 0) return false;
    outgoing_.erase(outgoing_.begin(), outgoing_.begin() + static_cast<std::ptrdiff_t>(*written));
  }
  return true;
}

/// Before the frame leaves: whatever ends this process, the next one uses no number again.
void TtcNode::note_frame() {
  if (!frame_counts_) return;
  frame_counts_->write(core_->frame_counts());
  if (const auto next = core_->next_frame_number()) frame_counts_->write_number(*next);
}

void TtcNode::pump_downlink() {
  bool again = false;
  do {
    core_->fill_downlink(monotonic_now());
    run(core_->take_actions());
    while (write_outgoing()) {
      auto cadu = core_->next_cadu(monotonic_now());
      if (!cadu) break;
      outgoing_ = std::move(*cadu);
      note_frame();
    }
    // The last playback frame may just have left.
    again = !again && core_->wants_playback();
  } while (again);
  arm_timer(monotonic_now());
}

/// One timer serves every deadline of the logic: the soonest.
void TtcNode::arm_timer(MonotonicTime at) {
  auto due = core_->next_due(at);
  if (!outgoing_.empty()) due = at + milliseconds(2);  // the driver is full: look again soon
  if (due == wake_up_at_) return;
  wake_up_at_ = due;
  wake_up_.reset();
  if (!due) return;
  wake_up_ = create_one_shot(
      *due,
      [this] {
        wake_up_at_.reset();
        // A silence of the line counts, not one of this thread: what waits in the driver is read first.
        const bool line_empty = read_line();
        core_->on_deadline(monotonic_now());
        if (line_empty) core_->on_line_idle(monotonic_now());
        advance();
      },
      "deadlines");
}

// ---- what the logic wants done

void TtcNode::advance() {
  if (!is_active() && state() != ros::State::activating) {
    run(core_->take_actions());
  } else if (run(core_->settle(monotonic_now()))) {
    pump_downlink();
  }
}

/// @return false: an outer call carries them out
bool TtcNode::run(TtcCore::Actions actions) {
  // What is decided counts as begun: an action behind one that failed is carried out all the same.
  std::exception_ptr failed;
  const bool outermost = actions_.run(std::move(actions), [&](const TtcAction& action) {
    try {
      std::visit(
          [this](const auto& a) {
            if constexpr (requires { disk_->carry_out(a); }) {
              disk_->carry_out(a);
            } else if constexpr (requires { imaging_goals_->carry_out(a); }) {
              imaging_goals_->carry_out(a);
            } else {
              carry_out(a);
            }
          },
          action);
    } catch (...) {
      if (!failed) failed = std::current_exception();
    }
  });
  if (failed) std::rethrow_exception(failed);
  return outermost;
}

void TtcNode::carry_out(const PublishTelecommand& action) {
  const mission::Command& command = *action.telecommand.command;
  srfs_msgs::msg::Telecommand message;
  message.id = action.telecommand.origin.id;
  message.target = command.node;
  message.apid = command.apid;
  message.function_id = command.function_id;
  message.repeat_class = static_cast<std::uint8_t>(command.repeat_class);
  message.expiry_ns = static_cast<std::uint64_t>(action.telecommand.expiry.ns());
  message.arguments = action.telecommand.arguments;
  signer_->prove(message);
  telecommands_->publish(message);
}

void TtcNode::carry_out(const PublishMode& action) {
  srfs_msgs::msg::SystemMode message;
  message.mode = static_cast<std::uint8_t>(action.mode);
  message.name = action.name;
  message.change = action.change;
  message.reason = action.reason;
  message.monotonic_ns = static_cast<std::uint64_t>(now().ns());
  mode_publisher_->publish(message);
}

void TtcNode::carry_out(const FollowMode& /*action*/) {
  if (is_active()) start_periods();
}

void TtcNode::carry_out(const RaiseEvent& action) {
  raise_event(action.event_id, static_cast<std::uint8_t>(action.severity), action.data);
}

void TtcNode::carry_out(const TestConnection& action) {
  // The answer comes from the node's work thread: a node that answers is alive.
  auto& client = connection_clients_[action.node];
  if (!client) client = create_client<lifecycle_msgs::srv::GetState>("/" + action.node + "/get_state");
  client->call({}, connection_patience, 1, [this](const auto& response) {
    core_->on_connection_answer(response.has_value());
    advance();
  });
}

void TtcNode::carry_out(const CallParameter& action) {
  const ParameterCall& call = action.call;
  if (call.value) {
    auto& client = set_clients_[call.node];
    if (!client) client = create_client<SetParameters>("/" + call.node + "/set_parameters");
    rcl_interfaces::msg::Parameter parameter;
    parameter.name = call.parameter;
    parameter.value = ros::to_message(to_ros(*call.value));
    SetParameters::Request request;
    request.parameters = {parameter};
    client->call(request, answer_deadline, 1, [this, number = call.number](const auto& outcome) {
      tell_set(core_->parameters(), number, outcome);
      advance();
    });
    return;
  }
  auto& client = get_clients_[call.node];
  if (!client) client = create_client<GetParameters>("/" + call.node + "/get_parameters");
  GetParameters::Request request;
  request.names = {call.parameter};
  client->call(request, answer_deadline, 1, [this, number = call.number](const auto& outcome) {
    tell_value(core_->parameters(), number, outcome);
    advance();
  });
}

void TtcNode::carry_out(const ReopenLine& /*action*/) {
  line_watch_.reset();
  if (line_) line_->discard_output();
  line_.reset();  // only one may have it open
  outgoing_.clear();
  auto line =
      hw::open_serial(device("rs422"), static_cast<std::uint32_t>(deployment().link.baud), var().root);
  if (!line) throw std::runtime_error(line.error().message);  // run_node brings the node up again
  line_ = std::move(*line);
  watch_line();
}

/// Without timing the watchdog is not fed, and no order outlives its reset.
void TtcNode::carry_out(const RestartComputer& /*action*/) {
  constexpr milliseconds patience{10'000};
  constexpr int attempts = 3;
  if (!restart_client_)
    restart_client_ = create_client<lifecycle_msgs::srv::ChangeState>("/timing/change_state");
  lifecycle_msgs::srv::ChangeState::Request request;
  request.transition.id = lifecycle_msgs::msg::Transition::TRANSITION_DEACTIVATE;
  restart_client_->call(request, patience, attempts, [](const auto& answer) {
    if (answer && answer->success) {
      log::warn("timing is inactive, so the watchdog restarts the computer");
    } else {
      log::error("timing does not deactivate: the computer is not restarted now");
    }
  });
}

void TtcNode::carry_out(const AcceptanceSent& action) {
  core_->on_acceptance_sent(monotonic_now() - action.received);
}

void TtcNode::carry_out(const LogLine& action) {
  switch (action.level) {
    case LogLine::Level::info:
      return log::info("{}", action.text);
    case LogLine::Level::warn:
      return log::warn("{}", action.text);
    case LogLine::Level::error:
      return log::error("{}", action.text);
  }
}

// ---- inputs from other nodes

void TtcNode::on_tick(const srfs_msgs::msg::TimeTick& tick) {
  const ReceivedTick received{.utc_s = static_cast<std::uint32_t>(tick.utc.sec),
                              .utc_ns = tick.utc.nanosec,
                              .monotonic_ns = tick.monotonic_ns,
                              .period_us = tick.period_us,
                              .time_valid = tick.time_valid,
                              .sync_state = tick.sync_state};
  const bool raised = core_->on_tick(received, tick.cycle, monotonic_now());
  if (raised && is_active()) return send_beacon();
  // The time may have become valid, or have made a step.
  if (raised || (is_active() && core_->waits_for_time())) advance();
}

void TtcNode::publish_telemetry(const srfs_msgs::msg::PayloadTelemetry& sample) {
  on_telemetry(sample);  // only ttc itself uses it
}

void TtcNode::on_telemetry(const srfs_msgs::msg::PayloadTelemetry& message) {
  if (!is_active()) return;
  const bool sends =
      core_->on_telemetry(message.source, message.apid, message.structure_id, message.data, now());
  if (core_->has_waiting_actions()) return advance();
  if (sends) pump_downlink();
}

void TtcNode::on_telecommand_report(const srfs_msgs::msg::TelecommandReport& message) {
  const auto stage = to_stage(message.stage);
  if (!is_active() || !stage) return;
  if (!signer_->believes(message)) return reject(message);
  core_->on_telecommand_report(message.node,
                               {.id = message.id,
                                .stage = *stage,
                                .success = message.success,
                                .failure_code = message.failure_code,
                                .step = message.progress_step,
                                .data = message.data},
                               now());
  advance();
}

void TtcNode::reject(const srfs_msgs::msg::TelecommandReport& message) {
  if (!rejected_reports_.add(now())) return;
  const std::string what = fmt::format("wrong proof: telecommand {} of {}", message.id, message.node);
  log::error("{} telecommand reports that are not their node's were rejected so far, last {}",
             rejected_reports_.count(), what);
  raise(mission::NodeForeignSamplesEvent{.count = rejected_reports_.count(),
                                         .topic = suite::topics::telecommand_report.name,
                                         .participant = what});
}

// ---- periodic work

void TtcNode::send_own_housekeeping() {
  core_->send_own_housekeeping({.suppressed_events = suppressed_events(),
                                .publish_drops = telecommands_->refused(),
                                .malformed_samples = malformed_samples(),
                                .lost_frames = lost_frames_},
                               now());
  advance();
}

void TtcNode::send_beacon() {
  const auto first_channel = static_cast<std::uint8_t>(deployment().link.channels.front().virtual_channel);
  core_->send_beacon(first_channel, now());
  if (const auto h = added_.housekeeping(deployment().added_revision, now()))
    core_->send_housekeeping(*h, now());
  if (disk_) load_dictionary();  // what waited for room
  advance();
}

void TtcNode::look_at_nodes() {
  for (const std::string& node : std::exchange(answered_, {})) state_clients_.erase(node);
  using Facts = std::vector<std::pair<std::string, NodeFacts>>;
  std::vector<std::string> names = core_->beacon().nodes();
  for (std::string& node : added_.names()) names.push_back(std::move(node));
  disk_->small_files().ask(
      [paths = var(), names = std::move(names)] {
        Facts facts;
        for (const std::string& node : names) {
          NodeFacts known;
          if (const auto instance = suite::find_instance(paths, node)) {
            known.running = true;
            known.version = instance->version;
          }
          known.restarts = suite::read_start_record(paths, node).restarts;
          facts.emplace_back(node, known);
        }
        return facts;
      },
      [this](const Facts& facts) {
        BeaconBuilder& beacon = core_->beacon();
        for (const auto& [node, known] : facts) {
          beacon.on_facts(node, node == name() ? NodeFacts{true, known.restarts, suite::version()} : known);
          added_.on_facts(node, known);
          if (!known.running && node != name()) core_->on_node_state(node, false, now());
        }
        beacon.on_lifecycle(name(), static_cast<std::uint8_t>(state()));
        for (const std::string& node : beacon.nodes_to_ask()) ask_for_state(node);
        for (const std::string& node : added_.nodes_to_ask()) ask_for_state(node);
      });
}

/// A node that came up before ttc has published its transitions already.
void TtcNode::ask_for_state(const std::string& node) {
  if (!is_active() || state_clients_.contains(node)) return;
  auto client = create_client<lifecycle_msgs::srv::GetState>("/" + node + "/get_state");
  state_clients_[node] = client;
  client->call({}, seconds(2), 1, [this, node](const auto& response) {
    if (response) {
      on_node_state(node, response->current_state.id);
      added_.on_lifecycle(node, response->current_state.id);
    }
    answered_.push_back(node);  // a client cannot be dropped within its own callback
  });
}

void TtcNode::on_node_state(const std::string& node, std::uint8_t state) {
  core_->beacon().on_lifecycle(node, state);
  core_->on_node_state(node, state == static_cast<std::uint8_t>(ros::State::active), now());
}

// ---- added nodes

AddedNodes::List list_of(const suite::Deployment& deployment) {
  AddedNodes::List list{.revision = deployment.added_revision, .names = {}, .fragments = {}};
  for (const suite::AddedNode& node : deployment.added) {
    list.names.push_back(node.name);
    if (!node.dictionary.empty()) list.fragments.push_back({node.name, node.dictionary});
  }
  return list;
}

void TtcNode::on_deployment_changed() {
  if (core_) core_->imaging().set_lane(image_lane());
  added_.report_problems(deployment().added_problems);
  raise_added_events();
  if (disk_) load_dictionary();  // else on_configure() reads it
}

void TtcNode::load_dictionary() {
  if (!added_.wants_load(deployment().added_revision)) return;
  AddedNodes::List list = list_of(deployment());
  const bool taken = disk_->small_files().ask(
      [fragments = std::move(list.fragments)] { return AddedNodes::load(fragments); },
      [this, revision = list.revision](AddedNodes::LoadedDictionary loaded) {
        added_.on_loaded(std::move(loaded), revision, *core_, now());
        follow_added_nodes(true);
        added_.report_refused();
        raise_added_events();
        load_dictionary();  // the list may have changed meanwhile
      });
  if (taken) added_.on_load_begun();
}

void TtcNode::follow_added_nodes(bool tell) {
  const AddedNodes::Changes changes = added_.follow(list_of(deployment()).names, tell);
  for (const std::string& node : changes.left) added_subscriptions_.erase(node);
  for (const std::string& node : changes.joined) added_subscriptions_[node] = listen_to(node);
}

void TtcNode::raise_added_events() {
  for (const RaiseEvent& event : added_.take_events()) carry_out(event);
}

}  // namespace srfs
