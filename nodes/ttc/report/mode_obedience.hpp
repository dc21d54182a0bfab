// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>
#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include <mission/structures.hpp>

#include "base/octets.hpp"
#include "msgs/mission/dictionary.hpp"

namespace srfs {

/// Which nodes obey the mode: by their event when they do, and by the housekeeping of their work thread,
/// which comes again and again. Pure.
class ModeObedience {
 public:
  /// @param dictionary  is not kept  @param asked  nodes of which some mode asks something
  ModeObedience(const mission::Dictionary& dictionary, std::vector<std::string> asked)
      : nodes_(dictionary.nodes()), asked_(std::move(asked)) {
    for (const mission::Structure& structure : dictionary.structures()) {
      if (const auto offset = mission::Dictionary::offset_of(structure, "mode_change");
          offset && structure.id != 0)
        places_[structure.id] = *offset;
    }
  }

  void on_telemetry(const std::string& node, std::uint16_t structure_id, OctetView data) {
    const auto place = places_.find(structure_id);
    if (place == places_.end()) return;
    OctetReader reader(data);
    (void)reader.bytes(place->second);
    const std::uint32_t change = reader.u32();
    if (reader.ok()) obeyed_[node] = change == UINT32_MAX ? std::nullopt : std::optional(change);
  }
  void on_event(const std::string& node, std::uint16_t event_id, OctetView data) {
    if (event_id == mission::NodeModeObeyedEvent::event_id) {
      OctetReader reader(data);
      (void)reader.u8();
      const std::uint32_t change = reader.u32();
      if (reader.ok()) obeyed_[node] = change;
    } else if (event_id == mission::NodeModeByItselfEvent::event_id) {
      obeyed_[node].reset();
    }
  }

  /// Per node, in APID order. @param own  this node, which obeys at once
  [[nodiscard]] std::vector<mission::ModeObedience> of(std::uint32_t change, std::string_view own) const {
    std::vector<mission::ModeObedience> all;
    for (const std::string& node : nodes_) {
      const bool is_asked = std::find(asked_.begin(), asked_.end(), node) != asked_.end();
      const auto known = obeyed_.find(node);
      const bool obeys = node == own || (known != obeyed_.end() && known->second == change);
      all.push_back(!is_asked ? mission::ModeObedience::no_order
                    : obeys   ? mission::ModeObedience::obeys
                              : mission::ModeObedience::pending);
    }
    return all;
  }

 private:
  std::vector<std::string> nodes_;
  std::vector<std::string> asked_;
  std::map<std::uint16_t, std::size_t> places_;  ///< of the number in each structure of a work thread
  std::map<std::string, std::optional<std::uint32_t>> obeyed_;
};

}  // namespace srfs
