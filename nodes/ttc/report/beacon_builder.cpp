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

BeaconBuilder::BeaconBuilder(const mission::Dictionary& dictionary) {
  std::vector<const mission::ApplicationProcess*> processes;
  for (const mission::ApplicationProcess& process : dictionary.apids()) {
    if (!process.added) processes.push_back(&process);  // those have a structure of their own
  }
  std::sort(processes.begin(), processes.end(),
            [](const auto* a, const auto* b) { return a->apid < b->apid; });
  for (const auto* process : processes) {
    if (names_.size() < node_count) names_.push_back(process->node);
  }
}

BeaconBuilder::Node* BeaconBuilder::find(std::string_view node) {
  const auto found = std::find(names_.begin(), names_.end(), node);
  return found == names_.end() ? nullptr : &nodes_[static_cast<std::size_t>(found - names_.begin())];
}

void BeaconBuilder::on_telemetry(std::string_view node, std::uint16_t structure_id, OctetView data,
                                 MonotonicTime now) {
  if (find(node) == nullptr) return;
  OctetReader reader(data);
  if (structure_id == mission::PayloadEpsHousekeeping::structure_id) {
    if (const auto eps = mission::PayloadEpsHousekeeping::decode(reader)) {
      battery_voltage_v_ = Reading{eps->measurement.battery_voltage_v, now};
      battery_charge_percent_ = Reading{eps->measurement.state_of_charge * 100, now};
      battery_temperature_k_ = Reading{eps->measurement.battery_temperature_k, now};
    }
  } else if (structure_id == mission::PayloadThermalHousekeeping::structure_id) {
    if (const auto thermal = mission::PayloadThermalHousekeeping::decode(reader)) {
      temperature_min_k_ = Reading{thermal->temperature_min_k, now};
      temperature_max_k_ = Reading{thermal->temperature_max_k, now};
    }
  } else if (structure_id == mission::TimingHousekeeping::structure_id) {
    const auto timing = mission::TimingHousekeeping::decode(reader);
    if (timing && timing->boot_count > 0) boot_ = BootTold{timing->boot_count, timing->reset_cause};
  } else if (structure_id == mission::CanSwitcherHousekeeping::structure_id) {
    if (const auto bus = mission::CanSwitcherHousekeeping::decode(reader)) {
      can_errors_ = bus->overruns;
      for (const std::uint32_t failures : bus->failures) can_errors_ += failures;
    }
  }
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

float BeaconBuilder::fresh(const MaybeReading& reading, MonotonicTime now) {
  if (!reading || now - reading->heard > value_lifetime) return std::numeric_limits<float>::quiet_NaN();
  return reading->value;
}

Octets BeaconBuilder::build(const BeaconInputs& inputs, MonotonicTime now) const {
  mission::Beacon beacon;
  beacon.cycle = inputs.cycle;
  const BootTold boot = boot_.value_or(inputs.boot);
  beacon.boot_count = boot.count;
  beacon.reset_cause = boot.cause;
  beacon.mode = inputs.mode;
  beacon.mode_reason = inputs.mode_reason;
  beacon.time_valid = inputs.time_valid;
  for (std::size_t i = 0; i < node_count; ++i) {
    const Node& node = nodes_[i];
    beacon.node_state[i] = beacon_state(node.state, node.facts.running);
    beacon.node_restarts[i] = static_cast<std::uint8_t>(std::min<std::uint32_t>(node.facts.restarts, 255));
    beacon.node_version[i] = packed_version(node.facts.version);
  }
  beacon.battery_voltage_v = fresh(battery_voltage_v_, now);
  beacon.battery_charge = fresh(battery_charge_percent_, now);
  beacon.battery_temperature_k = fresh(battery_temperature_k_, now);
  beacon.temperature_min_k = fresh(temperature_min_k_, now);
  beacon.temperature_max_k = fresh(temperature_max_k_, now);
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
  beacon.command_loss_s = UINT32_MAX;  // no such timer runs
  beacon.can_errors = can_errors_;
  beacon.next_scheduled_function = inputs.next_scheduled_function;
  beacon.next_scheduled_in_s = inputs.next_scheduled_in_s.value_or(UINT32_MAX);
  return beacon.encoded();
}

}  // namespace srfs
