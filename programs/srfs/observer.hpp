// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <csignal>
#include <string>
#include <vector>

#include "programs/srfs/suite.hpp"

namespace srfs::tool {

/// Prints what the suite says on its own topics as one JSON object a line: ticks, task flags, bus status,
/// activity, telecommands and their reports, events, lifecycle transitions; and what it was too slow for
/// ("lost"). Until @p duration is over (zero: until SIGTERM or SIGINT). Listens only; the suite does not
/// notice. @return exit code
int record(const Target& target, seconds duration);

}  // namespace srfs::tool
