// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include <mission/structures.hpp>

#include "base/time.hpp"
#include "msgs/mission/dictionary.hpp"
#include "nodes/ttc/report/beacon_builder.hpp"
#include "nodes/ttc/ttc_core.hpp"

namespace srfs {

/// What ttc knows of nodes that are added and removed while it runs: the dictionary with their fragments,
/// who belongs to the suite, their states, and what the ground is told of it. Pure but for load().
class AddedNodes {
 public:
  /// The list of the deployment.
  struct List {
    std::uint32_t revision = 0;  ///< counts its changes
    std::vector<std::string> names;
    std::vector<mission::Fragment> fragments;
  };
  struct LoadedDictionary {
    std::optional<mission::Dictionary> dictionary;
    std::vector<mission::RefusedFragment> refused;
    std::string problem;  ///< nothing could be loaded
  };

  /// Reads the dictionary. Blocks on the disk. Throws ConfigError.
  explicit AddedNodes(const List& list);
  /// The same again if the list is another one, while nothing uses the dictionary.
  void read_again(const List& list);
  /// For a worker: blocks on the disk.
  [[nodiscard]] static LoadedDictionary load(const std::vector<mission::Fragment>& fragments);
  /// Whether load() is to be called for this revision now: one at a time, and not while so many replaced
  /// dictionaries are kept that another has no room.
  [[nodiscard]] bool wants_load(std::uint32_t revision) const {
    return !loads_ && revision_ != revision && retired_.size() < most_retired;
  }
  void on_load_begun() { loads_ = true; }
  /// The dictionary of @p revision is used from now on. What refers to the old one goes on with it.
  void on_loaded(LoadedDictionary loaded, std::uint32_t revision, TtcCore& core, MonotonicTime now);
  /// One object for its whole life; its content is replaced.
  [[nodiscard]] const mission::Dictionary& dictionary() const { return dictionary_; }

  struct Changes {
    std::vector<std::string> left;
    std::vector<std::string> joined;  ///< may be one of those that left, with another APID
  };
  /// @param tell whether to report new ones
  Changes follow(const std::vector<std::string>& names, bool tell);
  void forget() { joined_.clear(); }

  /// @param state id as in lifecycle_msgs/msg/State
  void on_lifecycle(const std::string& node, std::uint8_t state);
  void on_facts(const std::string& node, const NodeFacts& facts);
  [[nodiscard]] std::vector<std::string> names() const;
  /// Running nodes whose state is not known yet: worth asking.
  [[nodiscard]] std::vector<std::string> nodes_to_ask() const;
  /// nullopt: there are none. To be called with each beacon.
  [[nodiscard]] std::optional<mission::AddedNodesHousekeeping> housekeeping(std::uint32_t revision,
                                                                            MonotonicTime now);

  /// Fragments that were rejected since the last call are logged and reported.
  void report_refused();
  void report_problems(const std::vector<std::string>& problems);
  /// To be raised, in order.
  [[nodiscard]] std::vector<RaiseEvent> take_events() { return std::exchange(events_, {}); }

 private:
  struct Retired {
    MonotonicTime until;
    std::unique_ptr<mission::Dictionary> dictionary;
  };
  struct Joined {
    std::string name;
    std::uint16_t apid = 0;  ///< 0: none
    NodeFacts facts = {};
    std::optional<std::uint8_t> state = {};  ///< last reported
  };
  template <class Event>
  void raise(const Event& event) {
    events_.push_back({event.severity, event.event_id, event.encoded()});
  }
  void fill_again(TtcCore& core, const mission::Dictionary& old) const;
  [[nodiscard]] std::uint16_t apid_of(const std::string& node) const;

  std::vector<mission::RefusedFragment> refused_;  ///< to be reported
  mission::Dictionary dictionary_;
  static constexpr std::size_t most_retired = 8;
  std::vector<Retired> retired_;  ///< commands under way may point into them
  std::uint32_t revision_ = 0;    ///< of the list the dictionary was read with
  bool loads_ = false;
  std::vector<Joined> joined_;
  std::vector<RaiseEvent> events_;
};

}  // namespace srfs
