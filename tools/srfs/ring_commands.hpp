#pragma once

#include <optional>
#include <string>

#include "tools/srfs/suite.hpp"

namespace srfs::tool {

/// `srfs faults`: the fault ledger, oldest first, as a table or as one JSON object a line. Needs neither DDS
/// nor a running suite.
/// @param since  "2026-11-21T08:00:00Z", or how long ago: "90s", "15m", "2h"; empty: all
/// @param node   as subject; empty: all
int show_faults(const Target& target, const std::string& since, const std::string& node, bool json);

/// `srfs ring status`: who runs, who is held, deaths, back-off and quarantine.
int show_ring(const Target& target, bool json);
/// `srfs ring hold NODE`: from now on nobody restarts it, dead or hung, until it is released; `srfs up` does
/// not start it.
int hold_node(const Target& target, const std::string& node, const std::string& reason, bool json);
/// `srfs ring release NODE`: lifts hold, back-off and quarantine. @param state  of its next start: "active",
/// "inactive", "unconfigured"; empty: as it was. A node that runs is told by `srfs lifecycle` instead.
int release_node(const Target& target, const std::string& node, const std::string& state, bool json);

/// The earliest time that @p since means; nullopt: cannot be read.
[[nodiscard]] std::optional<UtcTime> parse_since(const std::string& since, UtcTime now);

}  // namespace srfs::tool
