// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "msgs/mission/dictionary.hpp"

namespace srfs::mission {

/// All that a dictionary consists of, for its image. `enums` is the first: fields point into it.
struct DictionaryParts {
  std::map<std::string, Enumeration, std::less<>>& enums;
  std::uint16_t& spacecraft_id;
  std::vector<ApplicationProcess>& apids;
  std::vector<Structure>& structures;
  std::vector<Command>& commands;
  std::vector<Event>& events;
  std::vector<PacketStore>& stores;
  std::vector<FailureCode>& failure_codes;
  std::vector<Parameter>& parameters;
  std::vector<std::string>& payloads;
  std::vector<BeaconSource>& beacon_sources;
  std::vector<Dictionary::Arguments>& monitors;
  std::vector<Dictionary::Arguments>& event_actions;
  std::optional<TelemetryPlace>& attitude;
};
[[nodiscard]] DictionaryParts parts_of(Dictionary& dictionary);
[[nodiscard]] Dictionary empty_dictionary();

}  // namespace srfs::mission
