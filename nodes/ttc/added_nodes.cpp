// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "nodes/ttc/added_nodes.hpp"

#include <algorithm>

#include "base/config.hpp"
#include "base/log.hpp"

namespace srfs {
namespace {

/// Longer than any telecommand waits between its judgement and its last look at the dictionary, but for the
/// timeout of a command that a node executes.
constexpr seconds retired_lifetime{600};
constexpr std::size_t longest_reason = 160;

mission::Dictionary load_fitting(const AddedNodes::List& list,
                                 std::vector<mission::RefusedFragment>& refused) {
  return mission::Dictionary::load_fitting(mission::Dictionary::default_folder(), list.fragments, refused);
}

mission::LifecycleState state_of(const NodeFacts& facts, const std::optional<std::uint8_t>& told) {
  using mission::LifecycleState;
  if (!facts.running) return LifecycleState::absent;
  return static_cast<LifecycleState>(told.value_or(static_cast<std::uint8_t>(LifecycleState::transition)));
}

}  // namespace

// ---- the dictionary

AddedNodes::AddedNodes(const List& list)
    : dictionary_(load_fitting(list, refused_)), revision_(list.revision) {}

void AddedNodes::read_again(const List& list) {
  if (revision_ == list.revision) return;
  revision_ = list.revision;
  dictionary_ = load_fitting(list, refused_);
}

AddedNodes::LoadedDictionary AddedNodes::load(const std::vector<mission::Fragment>& fragments) {
  LoadedDictionary loaded;
  try {
    loaded.dictionary =
        mission::Dictionary::load_fitting(mission::Dictionary::default_folder(), fragments, loaded.refused);
  } catch (const ConfigError& e) {
    loaded.problem = e.what();
  }
  return loaded;
}

void AddedNodes::on_loaded(LoadedDictionary loaded, std::uint32_t revision, TtcCore& core,
                           MonotonicTime now) {
  loads_ = false;
  revision_ = revision;
  refused_ = std::move(loaded.refused);
  if (!loaded.dictionary) {
    log::error("cannot reload the mission dictionary, keeping the old one: {}", loaded.problem);
    return;
  }
  // Its elements stay where they are when it is moved, so pointers into it hold.
  auto old = std::make_unique<mission::Dictionary>(std::exchange(dictionary_, std::move(*loaded.dictionary)));
  fill_again(core, *old);
  milliseconds longest{0};
  for (const mission::Command& command : old->commands()) {
    if (command.node != core.node()) longest = std::max(longest, command.timeout);
  }
  // A telecommand of an earlier process has the timeout of the dictionary that it was accepted with.
  const MonotonicTime last_end = std::max(now + longest, core.latest_forwarded_end().value_or(now));
  retired_.push_back({last_end + retired_lifetime, std::move(old)});
}

/// In place of @p old's.
void AddedNodes::fill_again(TtcCore& core, const mission::Dictionary& old) const {
  const auto same = [](const mission::Structure& a, const mission::Structure& b) {
    return a.name == b.name && a.apid == b.apid && a.max_size() == b.max_size() && a.interval == b.interval;
  };
  for (const mission::Structure& structure : old.structures()) {
    if (!TtcCore::is_sampled(structure)) continue;
    const mission::Structure* now_there = dictionary_.structure(structure.id);
    if (now_there == nullptr || !same(*now_there, structure))
      core.housekeeping().remove_structure(structure.id);
  }
  for (const mission::Structure& structure : dictionary_.structures()) {
    if (TtcCore::is_sampled(structure) && !core.housekeeping().plan(structure.id))
      core.add_structure(structure);
  }
  for (const mission::Event& event : old.events()) {
    if (dictionary_.event(event.id) == nullptr) core.events().remove_event(event.id);
  }
  for (const mission::Event& event : dictionary_.events()) {
    if (!core.events().knows(event.id)) core.events().add_event(event.id);
  }
  core.on_dictionary_changed();
}

void AddedNodes::report_refused() {
  for (const mission::RefusedFragment& refused : std::exchange(refused_, {})) {
    log::error("the dictionary fragment of {} is rejected: {}", refused.name, refused.why);
    mission::SuiteFragmentRefusedEvent event;
    event.node = refused.name;
    event.why = refused.why.substr(0, longest_reason);
    raise(event);
  }
}

void AddedNodes::report_problems(const std::vector<std::string>& problems) {
  for (const std::string& problem : problems) {
    mission::SuiteAddedNodesDamagedEvent event;
    event.why = problem.substr(0, longest_reason);
    raise(event);
  }
}

// ---- the nodes

std::uint16_t AddedNodes::apid_of(const std::string& node) const {
  const mission::ApplicationProcess* process = dictionary_.apid_of_node(node);
  return process == nullptr ? std::uint16_t{0} : process->apid;
}

AddedNodes::Changes AddedNodes::follow(const std::vector<std::string>& names, bool tell) {
  Changes changes;
  std::erase_if(joined_, [&](const Joined& joined) {
    const bool listed = std::find(names.begin(), names.end(), joined.name) != names.end();
    if (listed && apid_of(joined.name) == joined.apid) return false;
    log::info("{} was removed from the suite", joined.name);
    mission::SuiteNodeLeftEvent event;
    event.node = joined.name;
    raise(event);
    changes.left.push_back(joined.name);
    return true;
  });
  for (const std::string& name : names) {
    const bool known = std::any_of(joined_.begin(), joined_.end(),
                                   [&](const Joined& joined) { return joined.name == name; });
    if (known) continue;
    joined_.push_back({.name = name, .apid = apid_of(name)});
    changes.joined.push_back(name);
    log::info("{} belongs to the suite, APID {}", name, joined_.back().apid);
    if (!tell) continue;
    mission::SuiteNodeJoinedEvent event;
    event.node = name;
    event.apid = joined_.back().apid;
    raise(event);
  }
  return changes;
}

void AddedNodes::on_lifecycle(const std::string& node, std::uint8_t state) {
  for (Joined& joined : joined_) {
    if (joined.name == node) joined.state = state;
  }
}

void AddedNodes::on_facts(const std::string& node, const NodeFacts& facts) {
  for (Joined& joined : joined_) {
    if (joined.name != node) continue;
    joined.facts = facts;
    if (!facts.running) joined.state.reset();  // the next process starts anew
  }
}

std::vector<std::string> AddedNodes::names() const {
  std::vector<std::string> names;
  names.reserve(joined_.size());
  for (const Joined& joined : joined_) names.push_back(joined.name);
  return names;
}

std::vector<std::string> AddedNodes::nodes_to_ask() const {
  std::vector<std::string> names;
  for (const Joined& joined : joined_) {
    if (joined.facts.running && !joined.state) names.push_back(joined.name);
  }
  return names;
}

std::optional<mission::AddedNodesHousekeeping> AddedNodes::housekeeping(std::uint32_t revision,
                                                                        MonotonicTime now) {
  std::erase_if(retired_, [now](const Retired& retired) { return now > retired.until; });
  if (joined_.empty()) return std::nullopt;
  mission::AddedNodesHousekeeping h;
  h.revision = revision;
  for (std::size_t i = 0; i < std::min(joined_.size(), h.node_apid.size()); ++i) {
    const Joined& joined = joined_[i];
    h.names += (i == 0 ? "" : ",") + joined.name;
    h.node_apid[i] = joined.apid;
    h.node_state[i] = state_of(joined.facts, joined.state);
    h.node_restarts[i] = static_cast<std::uint8_t>(std::min<std::uint32_t>(joined.facts.restarts, UINT8_MAX));
  }
  return h;
}

}  // namespace srfs
