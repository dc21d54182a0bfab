// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "ground/bounded_json.hpp"

namespace srfs::ground {

nlohmann::json parse_bounded(std::string_view text) {
  using Event = nlohmann::json::parse_event_t;
  bool too_deep = false;
  const auto keep = [&too_deep](int depth, Event event, const nlohmann::json&) {
    const bool begins = event == Event::object_start || event == Event::array_start;
    if (begins && depth >= json_depth_max) too_deep = true;
    return !too_deep;
  };
  auto json = nlohmann::json::parse(text, keep, false);
  if (too_deep) return nlohmann::json(nlohmann::json::value_t::discarded);
  return json;
}

}  // namespace srfs::ground
