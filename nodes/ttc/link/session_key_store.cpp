// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "nodes/ttc/link/session_key_store.hpp"

#include <algorithm>
#include <vector>

#include "base/log.hpp"

namespace srfs {
namespace {

/// Those that can be rekeyed by a frame of the contingency association.
std::vector<std::uint16_t> associations_with_contingency(const UplinkConfig& config) {
  std::vector<std::uint16_t> spis;
  for (const UplinkChannel& channel : config.channels) {
    const bool has_contingency =
        std::any_of(channel.associations.begin(), channel.associations.end(),
                    [](const UplinkAssociation& association) { return !association.set; });
    for (const UplinkAssociation& association : channel.associations) {
      if (has_contingency && association.set) spis.push_back(association.spi);
    }
  }
  return spis;
}

}  // namespace

FoundSessionKeys load_session_keys(const std::filesystem::path& folder, UplinkConfig& config) {
  const auto found = wire::session_key_file(folder / wire::session_keys_name).load();
  FoundSessionKeys result;
  if (found.state) {
    result.keys = *found.state;
  } else if (found.existed()) {
    result.keys = wire::SessionKeys::lost(associations_with_contingency(config));
    result.lost = result.keys.uses().empty() ? "there is no contingency key, those of the files are accepted"
                                             : "the contingency key is accepted alone";
  }
  use_session_keys(config, result.keys);
  if (!found.damaged.empty()) (void)store_session_keys(folder, result.keys);
  return result;
}

bool store_session_keys(const std::filesystem::path& folder, const wire::SessionKeys& keys) {
  const auto stored = wire::session_key_file(folder / wire::session_keys_name).store(keys);
  if (!stored.problem.empty()) log::error("{}", stored.problem);
  return stored.durable();
}

}  // namespace srfs
