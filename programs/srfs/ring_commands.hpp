// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>
#include <string>

#include "programs/srfs/suite.hpp"

namespace srfs::tool {

/// `srfs faults`: the fault ledger, oldest first, as a table or as one JSON object a line. Needs neither DDS
/// nor a running suite.
/// @param since  "2026-11-21T08:00:00Z", or how long ago: "90s", "15m", "2h"; empty: all
/// @param node   as subject; empty: all
int show_faults(const Target& target, const std::string& since, const std::string& node, bool json);

/// `srfs ring status`: running and held nodes, deaths, back-off and quarantine.
int show_ring(const Target& target, bool json);
/// For people: when an order to this node (hold, a state other than Active) ends by itself; empty: it does
/// not.
[[nodiscard]] std::string end_of_order_text(const suite::Deployment& deployment, const std::string& node);
/// `srfs ring hold NODE`: from now on it is not restarted, dead or hung, until it is released; `srfs up` does
/// not start it.
int hold_node(const Target& target, const std::string& node, const std::string& reason, bool json);
/// `srfs ring release NODE`: lifts hold, back-off and quarantine. @param state  of its next start: "active",
/// "inactive", "unconfigured"; empty: as it was. For a running node use `srfs lifecycle` instead.
int release_node(const Target& target, const std::string& node, const std::string& state, bool json);

/// The earliest time that @p since means; nullopt: cannot be read.
[[nodiscard]] std::optional<UtcTime> parse_since(const std::string& since, UtcTime now);

}  // namespace srfs::tool
