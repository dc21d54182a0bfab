// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "nodes/maintenance/limit_watch.hpp"

#include <algorithm>

#include <fmt/format.h>

namespace srfs {

bool has_hard_limits(const mission::Structure& structure) {
  return std::any_of(structure.fields.begin(), structure.fields.end(),
                     [](const mission::Field& field) { return field.hard.has_value(); });
}

std::optional<std::string> LimitWatch::on_sample(const std::string& node, const mission::Structure& structure,
                                                 const std::vector<mission::DecodedField>& fields,
                                                 MonotonicTime since, MonotonicTime now) {
  std::optional<std::string> blame;
  for (const mission::DecodedField& field : fields) {
    if (field.limit == mission::LimitState::none) continue;  // no limits, or the value is not known
    const std::string name = fmt::format("{}.{}", structure.name, field.name);
    const bool red = field.limit == mission::LimitState::red;
    Track& track = tracks_[{node, name}];
    if (!track.last) {
      track.excuse = Excuse::unknown_before;
    } else if (*track.last < since) {  // the first of this process
      const bool stood = track.last_red && since - *track.last_red <= memory;
      track.excuse = stood ? Excuse::stood_before : Excuse::none;
    }
    track.last = now;
    if (red) {
      track.last_red = now;
      if (track.excuse == Excuse::none && !blame) blame = fmt::format("{} {}", name, field.text);
    } else if (track.excuse == Excuse::unknown_before) {
      track.excuse = Excuse::none;
    }
  }
  return blame;
}

std::optional<std::string> LimitWatch::on_event(const std::string& node, const mission::Event& event,
                                                MonotonicTime since, MonotonicTime now) {
  // What a member of the ring says of others is not its own fault.
  if (event.severity != mission::EventSeverity::high || event.name.starts_with("ring.")) return std::nullopt;
  const auto first = raised_.try_emplace({node, event.id}, now).first->second;
  if (first < since) return std::nullopt;
  return event.name;
}

}  // namespace srfs
