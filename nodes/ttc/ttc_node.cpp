// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "nodes/ttc/ttc_node.hpp"

#include <array>

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

void TtcNode::pump_downlink() {
  bool again = false;
  do {
    core_->fill_downlink(monotonic_now());
    run(core_->take_actions());
    while (write_outgoing()) {
      auto cadu = core_->next_cadu(monotonic_now());
      if (!cadu) break;
      outgoing_ = std::move(*cadu);
      if (frame_counts_) frame_counts_->write(core_->frame_counts());
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
      std::visit([this](const auto& a) { carry_out(a); }, action);
    } catch (...) {
      if (!failed) failed = std::current_exception();
    }
  });
  if (failed) std::rethrow_exception(failed);
  return outermost;
}

void TtcNode::carry_out(const WriteJournal& action) {
  struct Outcome {
    Result<void, FileError> written;
    std::size_t used_octets = 0;
  };
  const auto batch = std::make_shared<const JournalBatch>(action.batch);
  const auto done = [this, batch](const Outcome& outcome) {
    core_->on_journal_written(*batch, outcome.written, outcome.used_octets, monotonic_now());
    advance();
  };
  const bool taken = journal_worker_->ask(
      [disk = journal_file_, batch] {
        Outcome outcome;
        outcome.written = batch->snapshot ? disk->log.snapshot(*batch->snapshot)
                                          : disk->log.append(batch->records, batch->sync);
        outcome.used_octets = disk->log.used_octets();
        return outcome;
      },
      done);
  if (!taken) done({Err(FileError{"the journal's worker is busy"}), 0});
}

void TtcNode::carry_out(const WriteState& action) {
  const auto done = [this, change = action.change](bool stored) {
    core_->on_state_written(change, stored);
    advance();
  };
  const bool taken = state_worker_->ask(
      [path = state_dir() / action.name, text = action.text] {
        const auto written = write_file_atomically(path, text);
        if (!written) log::warn("{}", written.error().message);
        return written.has_value();
      },
      done);
  if (taken) return;
  log::warn("{}: not written, its worker is busy", (state_dir() / action.name).string());
  done(false);
}

void TtcNode::carry_out(const WriteKeys& action) {
  const auto done = [this, change = action.change](bool stored) {
    core_->on_keys_written(change, stored, monotonic_now());
    advance();
  };
  const bool taken = state_worker_->ask(
      [path = state_dir() / "key_selection", selection = action.selection] {
        return store_key_selection(path, selection).has_value();
      },
      done);
  if (!taken) done(false);
}

void TtcNode::carry_out(const CopyLinkState& action) {
  state_worker_->post([file = link_file_, state = action.state] {
    if (const auto written = file->store(state); !written) log::warn("{}", written.error().message);
  });
}

void TtcNode::carry_out(const CommitStores& action) {
  struct Committed {
    PacketStoresStatus status;
    Result<void, FileError> counts;
  };
  const auto commit = std::make_shared<const CommitStores>(action);
  const bool taken = store_worker_->ask(
      [stores = stores_, file = frame_count_file_, commit] {
        stores->set_bounded(commit->bounded);
        for (const StoreItem& item : commit->items) stores->append(item);
        stores->commit();
        Committed committed{stores->status(), {}};
        if (commit->counts) committed.counts = file->store(*commit->counts);
        return committed;
      },
      [this, commit](const Committed& committed) {
        core_->on_committed(*commit, committed.status, committed.counts);
        advance();  // open retrieval may have something to send
      });
  if (!taken) core_->on_commit_refused(action);
}

void TtcNode::carry_out(const ReadStore& action) {
  const auto read = std::make_shared<const ReadStore>(action);
  const bool taken = store_worker_->ask(
      [stores = stores_, read] {
        for (const StoreItem& item : read->items) stores->append(item);
        return stores->read(read->batch.period.store, read->batch.period.range, read->batch.cursor,
                            PacketRetrieval::batch_octets);
      },
      [this, read](std::optional<RetrievedPackets> packets) {
        core_->on_store_read(*read, std::move(packets), monotonic_now());
        advance();
      });
  if (!taken) core_->on_read_refused(action);
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
  telecommands_->publish(message);
}

void TtcNode::carry_out(const PublishMode& action) {
  srfs_msgs::msg::SystemMode message;
  message.mode = static_cast<std::uint8_t>(action.mode);
  message.reason = action.reason;
  message.monotonic_ns = static_cast<std::uint64_t>(now().ns());
  mode_publisher_->publish(message);
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

void TtcNode::carry_out(const ServeFile& action) {
  const bool taken =
      files_worker_->ask([files = files_, order = action.order] { return files->serve(order); },
                         [this](const FileOutcome& outcome) {
                           core_->on_file_outcome(outcome, monotonic_now());
                           advance();
                         });
  if (!taken) core_->on_file_refused(monotonic_now());
}

void TtcNode::carry_out(const TakeFilesTurn& action) {
  const bool taken = files_worker_->ask(
      [files = files_, turn = std::make_shared<const cfdp::TransferTurn>(action.turn)] {
        return files->take_turn(*turn);
      },
      [this](Result<cfdp::TransferTurnResult, std::string> result) {
        core_->on_files_turn(result, monotonic_now());
        advance();
      });
  if (!taken) core_->on_files_turn_refused(monotonic_now());
}

void TtcNode::carry_out(const ServeImages& action) {
  const auto order = std::make_shared<const ImagingOrder>(action.order);
  const auto done = [this, order](const ImagingOutcome& outcome) {
    core_->on_imaging_job(*order, outcome);
    advance();
  };
  if (!files_worker_->ask([files = files_, order] { return files->serve(*order); }, done)) done({});
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
  if (core_->on_telemetry(message.source, message.apid, message.structure_id, message.data, now()))
    pump_downlink();
}

void TtcNode::on_telecommand_report(const srfs_msgs::msg::TelecommandReport& message) {
  const auto stage = to_stage(message.stage);
  if (!is_active() || !stage) return;
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
  send_added_nodes();
  advance();
}

void TtcNode::look_at_nodes() {
  for (const std::string& node : std::exchange(answered_, {})) state_clients_.erase(node);
  using Facts = std::vector<std::pair<std::string, NodeFacts>>;
  std::vector<std::string> names = core_->beacon().nodes();
  for (const JoinedNode& joined : joined_nodes_) names.push_back(joined.name);
  state_worker_->ask(
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
          for (JoinedNode& joined : joined_nodes_) {
            if (joined.name != node) continue;
            joined.facts = known;
            if (!known.running) joined.state.reset();  // the next process starts anew
          }
        }
        beacon.on_lifecycle(name(), static_cast<std::uint8_t>(state()));
        for (const std::string& node : beacon.nodes_to_ask()) ask_for_state(node);
        for (const JoinedNode& joined : joined_nodes_) {
          if (joined.facts.running && !joined.state) ask_for_state(joined.name);
        }
      });
}

/// A node that came up before ttc has published its transitions already.
void TtcNode::ask_for_state(const std::string& node) {
  if (!is_active() || state_clients_.contains(node)) return;
  auto client = create_client<lifecycle_msgs::srv::GetState>("/" + node + "/get_state");
  state_clients_[node] = client;
  client->call({}, seconds(2), 1, [this, node](const auto& response) {
    if (response) core_->beacon().on_lifecycle(node, response->current_state.id);
    for (JoinedNode& joined : joined_nodes_) {
      if (response && joined.name == node) joined.state = response->current_state.id;
    }
    answered_.push_back(node);  // a client cannot be dropped within its own callback
  });
}

}  // namespace srfs
