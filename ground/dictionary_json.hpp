// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <nlohmann/json.hpp>

#include "msgs/mission/dictionary.hpp"

namespace srfs::ground {

/// {"type": "command", name, description, node, apid, service, subtype, function, hazardous, repeat, modes
/// [name], reports {service, subtype, structure, argument, several, may_be_none} | null, timeout_s, groups
/// {min, max, after} | null, arguments [{name, type, unit, description, count, min, max, enum {text: number},
/// reference, default, length}]}. What an argument does not have is left out.
[[nodiscard]] nlohmann::json to_json(const mission::Command& command, const mission::Dictionary& dictionary);

/// The whole dictionary: {mission {spacecraft_id, payloads, nodes}, telecommands, structures, events,
/// parameters, stores, failure_codes}. Elements of an array are parameters of their own, named as their
/// values are.
[[nodiscard]] nlohmann::json to_json(const mission::Dictionary& dictionary);

}  // namespace srfs::ground
