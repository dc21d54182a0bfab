// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "nodes/ttc/report/beacon_builder.hpp"

#include <algorithm>
#include <charconv>
#include <limits>

#include <mission/structures.hpp>

namespace srfs {
namespace {

mission::LifecycleState beacon_state(std::optional<std::uint8_t> state, bool running) {
  if (!running) return mission::LifecycleState::absent;
  if (!state) return mission::LifecycleState::transition;  // a process runs, its state is unknown
  const auto value = static_cast<mission::LifecycleState>(*state);
  return mission::is_valid(value) ? value : mission::LifecycleState::transition;
}

mission::TelecommandOutcome outcome_of(const StageReached& last) {
  using mission::TelecommandOutcome;
  switch (last.stage) {
    case Stage::acceptance:
    case Stage::routing:
      return last.success ? TelecommandOutcome::accepted : TelecommandOutcome::rejected;
    case Stage::start:
      return last.success ? TelecommandOutcome::started : TelecommandOutcome::start_failed;
    case Stage::progress:
      return last.success ? TelecommandOutcome::started : TelecommandOutcome::failed;
    case Stage::completion:
      return last.success ? TelecommandOutcome::completed : TelecommandOutcome::failed;
  }
  return TelecommandOutcome::none;
}

}  // namespace

std::uint16_t packed_version(std::string_view version) {
  constexpr std::array<unsigned, 3> limits = {15, 63, 63};
  std::array<unsigned, 3> parts{};
  const char* at = version.data();
  const char* const end = version.data() + version.size();
  for (std::size_t i = 0; i < parts.size(); ++i) {
    const auto [next, error] = std::from_chars(at, end, parts[i]);
    if (error != std::errc{} || parts[i] > limits[i]) return 0;
    if (i < 2 && (next == end || *next != '.')) return 0;
    at = i < 2 ? next + 1 : next;
  }
  return static_cast<std::uint16_t>(parts[0] << 12 | parts[1] << 6 | parts[2]);
}

BeaconBuilder::BeaconBuilder(const mission::Dictionary& dictionary) : names_(dictionary.nodes()) {
  if (names_.size() > mission::most_nodes) names_.resize(mission::most_nodes);
  nodes_.resize(names_.size());
  for (const mission::BeaconSource& source : dictionary.beacon_sources()) measured_.push_back({source, {}});
  if (const auto* bus = dictionary.structure(mission::structure::can_switcher)) {
    const auto overruns = mission::Dictionary::offset_of(*bus, "overruns");
    const auto failures = mission::Dictionary::offset_of(*bus, "failures");
    if (overruns && failures) can_ = {bus->id, *overruns, *failures, dictionary.payloads().size()};
  }
}

BeaconBuilder::Node* BeaconBuilder::find(std::string_view node) {
  const auto found = std::find(names_.begin(), names_.end(), node);
  return found == names_.end() ? nullptr : &nodes_[static_cast<std::size_t>(found - names_.begin())];
}

void BeaconBuilder::on_telemetry(std::string_view node, std::uint16_t structure_id, OctetView data,
                                 MonotonicTime now) {
  if (find(node) == nullptr) return;
  for (Measured& measured : measured_) {
    if (measured.source.from.structure_id != structure_id) continue;
    OctetReader reader(data);
    (void)reader.bytes(measured.source.from.offset);
    const float value = reader.f32();
    if (reader.ok()) measured.last = Reading{value * measured.source.scale, now};
  }
  if (structure_id == mission::TimingHousekeeping::structure_id) {
    OctetReader reader(data);
    const auto timing = mission::TimingHousekeeping::decode(reader);
    if (timing && timing->boot_count > 0) boot_ = BootTold{timing->boot_count, timing->reset_cause};
  } else if (structure_id == can_.structure_id) {
    on_can_switcher(data);
  }
}

void BeaconBuilder::on_can_switcher(OctetView data) {
  OctetReader overruns(data);
  (void)overruns.bytes(can_.overruns);
  std::uint32_t errors = overruns.u32();
  OctetReader failures(data);
  (void)failures.bytes(can_.failures);
  for (std::size_t i = 0; i < can_.payloads; ++i) errors += failures.u32();
  if (overruns.ok() && failures.ok()) can_errors_ = errors;
}

void BeaconBuilder::on_lifecycle(std::string_view node, std::uint8_t state) {
  if (Node* found = find(node)) found->state = state;
}

void BeaconBuilder::on_facts(std::string_view node, const NodeFacts& facts) {
  Node* found = find(node);
  if (found == nullptr) return;
  found->facts = facts;
  if (!facts.running) found->state.reset();  // the next process starts anew
}

std::vector<std::string> BeaconBuilder::nodes_to_ask() const {
  std::vector<std::string> asked;
  for (std::size_t i = 0; i < names_.size(); ++i) {
    if (nodes_[i].facts.running && !nodes_[i].state) asked.push_back(names_[i]);
  }
  return asked;
}

float BeaconBuilder::fresh(std::string_view value, MonotonicTime now) const {
  const auto found = std::find_if(measured_.begin(), measured_.end(),
                                  [&](const Measured& measured) { return measured.source.value == value; });
  const bool known = found != measured_.end() && found->last && now - found->last->heard <= value_lifetime;
  return known ? found->last->value : std::numeric_limits<float>::quiet_NaN();
}

Octets BeaconBuilder::build(const BeaconInputs& inputs, MonotonicTime now) const {
  mission::Beacon beacon;
  beacon.cycle = inputs.cycle;
  const BootTold boot = boot_.value_or(inputs.boot);
  beacon.boot_count = boot.count;
  beacon.reset_cause = boot.cause;
  beacon.mode = inputs.mode;
  beacon.mode_reason = inputs.mode_reason;
  beacon.mode_since_s = inputs.mode_since_s.value_or(UINT32_MAX);
  beacon.mode_pending = inputs.mode_pending;
  beacon.mode_causes = inputs.mode_causes;
  beacon.time_valid = inputs.time_valid;
  beacon.node_state.resize(nodes_.size());
  beacon.node_restarts.resize(nodes_.size());
  beacon.node_version.resize(nodes_.size());
  for (std::size_t i = 0; i < nodes_.size(); ++i) {
    const Node& node = nodes_[i];
    beacon.node_state[i] = beacon_state(node.state, node.facts.running);
    beacon.node_restarts[i] = static_cast<std::uint8_t>(std::min<std::uint32_t>(node.facts.restarts, 255));
    beacon.node_version[i] = packed_version(node.facts.version);
  }
  beacon.battery_voltage_v = fresh("battery_voltage_v", now);
  beacon.battery_charge = fresh("battery_charge", now);
  beacon.battery_temperature_k = fresh("battery_temperature_k", now);
  beacon.temperature_min_k = fresh("temperature_min_k", now);
  beacon.temperature_max_k = fresh("temperature_max_k", now);
  beacon.storage_free_mib = inputs.storage_free_mib;
  beacon.storage_state = inputs.storage_state;
  beacon.store_records = inputs.store_records;
  if (const auto& last = inputs.last_telecommand) {
    beacon.last_telecommand_apid = last->origin.request.packet_identification & 0x7FF;
    beacon.last_telecommand_sequence = last->origin.request.packet_sequence_control & 0x3FFF;
    beacon.last_telecommand_outcome = outcome_of(last->reached);
    beacon.last_failure_code = last->reached.failure_code;
  }
  beacon.sdls_spi = inputs.sdls_spi;
  beacon.sdls_counter = inputs.sdls_counter;
  beacon.farm_vr = inputs.farm_vr;
  beacon.farm_lockout = inputs.farm_lockout;
  beacon.command_loss_s = inputs.command_loss_s;
  beacon.can_errors = can_errors_;
  beacon.next_scheduled_function = inputs.next_scheduled_function;
  beacon.next_scheduled_in_s = inputs.next_scheduled_in_s.value_or(UINT32_MAX);
  return beacon.encoded();
}

}  // namespace srfs
