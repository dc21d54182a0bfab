// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
// What ttc does about nodes that are added and removed while it runs: their fragments in the dictionary,
// their telemetry, their part of the beacon.
#include <algorithm>

#include <lifecycle_msgs/msg/transition_event.hpp>
#include <mission/structures.hpp>

#include "nodes/ttc/ttc_node.hpp"

namespace srfs {
namespace {

/// Longer than any telecommand waits between its judgement and its last look at the dictionary, but for the
/// timeout of a command that a node executes.
constexpr seconds retired_lifetime{600};
constexpr std::size_t longest_reason = 160;

std::uint8_t state_of(const NodeFacts& facts, const std::optional<std::uint8_t>& told) {
  using mission::LifecycleState;
  if (!facts.running) return static_cast<std::uint8_t>(LifecycleState::absent);
  return told.value_or(static_cast<std::uint8_t>(LifecycleState::transition));
}

}  // namespace

std::vector<mission::Fragment> TtcNode::fragments() const {
  std::vector<mission::Fragment> all;
  for (const suite::AddedNode& node : deployment().added) {
    if (!node.dictionary.empty()) all.push_back({node.name, node.dictionary});
  }
  return all;
}

/// Once a change of the list, and once a start.
void TtcNode::report_added_problems() {
  for (const std::string& problem : deployment().added_problems) {
    mission::SuiteAddedNodesDamagedEvent event;
    event.why = problem.substr(0, longest_reason);
    raise(event);
  }
}

void TtcNode::on_deployment_changed() {
  report_added_problems();
  if (state_worker_) load_dictionary();  // else on_configure() reads it
}

void TtcNode::load_dictionary() {
  if (dictionary_loads_ || dictionary_revision_ == deployment().added_revision) return;
  const std::uint32_t revision = deployment().added_revision;
  dictionary_loads_ = state_worker_->ask(
      [parts = fragments(), folder = mission::Dictionary::default_folder()] {
        LoadedDictionary loaded;
        try {
          loaded.dictionary = mission::Dictionary::load_fitting(folder, parts, loaded.refused);
        } catch (const ConfigError& e) {
          loaded.problem = e.what();
        }
        return loaded;
      },
      [this, revision](LoadedDictionary loaded) {
        dictionary_loads_ = false;
        dictionary_revision_ = revision;
        take_dictionary(std::move(loaded));
        load_dictionary();  // the list may have changed meanwhile
      });
}

void TtcNode::take_dictionary(LoadedDictionary loaded) {
  if (!loaded.dictionary) {
    log::error("cannot reload the mission dictionary, keeping the old one: {}", loaded.problem);
  } else {
    // Its elements stay where they are when it is moved, so pointers into it hold.
    auto old =
        std::make_unique<mission::Dictionary>(std::exchange(dictionary_, std::move(*loaded.dictionary)));
    fill_from_dictionary_again(*old);
    milliseconds longest{0};
    for (const mission::Command& command : old->commands()) {
      if (command.node != name()) longest = std::max(longest, command.timeout);
    }
    retired_dictionaries_.push_back({now() + retired_lifetime + longest, std::move(old)});
  }
  refused_fragments_ = std::move(loaded.refused);
  meet_added_nodes(true);
  report_refused_fragments();
}

void TtcNode::add_structure(const mission::Structure& structure) {
  // What ttc samples itself already comes at its period.
  const bool own = structure.node == name();
  std::size_t text_octets = 0;
  for (const mission::Field& field : structure.fields) {
    if (field.type == mission::FieldType::text) text_octets += field.max_text * field.count;
  }
  core_->housekeeping().add_structure(
      structure.id, structure.apid, structure.max_size() - text_octets, structure.max_size(),
      {.enabled = true, .interval = own ? milliseconds(0) : structure.interval});
}

void TtcNode::fill_from_dictionary_again(const mission::Dictionary& old) {
  const auto is_sampled = [](const mission::Structure& s) {
    return s.kind == mission::StructureKind::housekeeping && s.id != 0;
  };
  const auto same = [](const mission::Structure& a, const mission::Structure& b) {
    return a.name == b.name && a.apid == b.apid && a.max_size() == b.max_size() && a.interval == b.interval;
  };
  for (const mission::Structure& structure : old.structures()) {
    if (!is_sampled(structure)) continue;
    const mission::Structure* now_there = dictionary_.structure(structure.id);
    if (now_there == nullptr || !same(*now_there, structure))
      core_->housekeeping().remove_structure(structure.id);
  }
  for (const mission::Structure& structure : dictionary_.structures()) {
    if (is_sampled(structure) && !core_->housekeeping().plan(structure.id)) add_structure(structure);
  }
  for (const mission::Event& event : old.events()) {
    if (dictionary_.event(event.id) == nullptr) core_->events().remove_event(event.id);
  }
  for (const mission::Event& event : dictionary_.events()) {
    if (!core_->events().knows(event.id)) core_->events().add_event(event.id);
  }
}

void TtcNode::report_refused_fragments() {
  for (const mission::RefusedFragment& refused : std::exchange(refused_fragments_, {})) {
    log::error("the dictionary fragment of {} is rejected: {}", refused.name, refused.why);
    mission::SuiteFragmentRefusedEvent event;
    event.node = refused.name;
    event.why = refused.why.substr(0, longest_reason);
    raise(event);
  }
}

void TtcNode::meet_added_nodes(bool tell) {
  const auto& added = deployment().added;
  const auto apid_of = [this](const std::string& node) {
    const auto* process = dictionary_.apid_of_node(node);
    return process == nullptr ? std::uint16_t{0} : process->apid;
  };
  std::erase_if(joined_nodes_, [&](const JoinedNode& joined) {
    const bool stays = std::any_of(added.begin(), added.end(), [&](const suite::AddedNode& node) {
      return node.name == joined.name && apid_of(joined.name) == joined.apid;
    });
    if (stays) return false;
    log::info("{} was removed from the suite", joined.name);
    mission::SuiteNodeLeftEvent event;
    event.node = joined.name;
    raise(event);
    return true;
  });
  for (const suite::AddedNode& node : added) {
    const bool known = std::any_of(joined_nodes_.begin(), joined_nodes_.end(),
                                   [&](const JoinedNode& joined) { return joined.name == node.name; });
    if (known) continue;
    joined_nodes_.push_back({node.name, apid_of(node.name), {}, {}, {}});
    listen_to(node.name);
    log::info("{} belongs to the suite, APID {}", node.name, joined_nodes_.back().apid);
    if (!tell) continue;
    mission::SuiteNodeJoinedEvent event;
    event.node = node.name;
    event.apid = joined_nodes_.back().apid;
    raise(event);
  }
}

void TtcNode::listen_to(const std::string& node) {
  std::vector<std::shared_ptr<void>>& subscriptions = joined_nodes_.back().subscriptions;
  subscriptions.push_back(create_subscription(suite::topics::telemetry(node),
                                              [this, node](const srfs_msgs::msg::PayloadTelemetry& m) {
                                                if (m.source == node) on_telemetry(m);
                                              }));
  subscriptions.push_back(create_subscription(
      ros::Topic<lifecycle_msgs::msg::TransitionEvent>{"/" + node + "/transition_event", {}},
      [this, node](const lifecycle_msgs::msg::TransitionEvent& m) {
        for (JoinedNode& joined : joined_nodes_) {
          if (joined.name == node) joined.state = m.goal_state.id;
        }
      }));
}

void TtcNode::send_added_nodes() {
  std::erase_if(retired_dictionaries_,
                [this](const RetiredDictionary& retired) { return now() > retired.until; });
  if (joined_nodes_.empty()) return;
  mission::AddedNodesHousekeeping h;
  h.revision = deployment().added_revision;
  for (std::size_t i = 0; i < std::min(joined_nodes_.size(), h.node_apid.size()); ++i) {
    const JoinedNode& joined = joined_nodes_[i];
    h.names += (i == 0 ? "" : ",") + joined.name;
    h.node_apid[i] = joined.apid;
    h.node_state[i] = static_cast<mission::LifecycleState>(state_of(joined.facts, joined.state));
    h.node_restarts[i] = static_cast<std::uint8_t>(std::min<std::uint32_t>(joined.facts.restarts, UINT8_MAX));
  }
  core_->send_housekeeping(h, now());
}

}  // namespace srfs
