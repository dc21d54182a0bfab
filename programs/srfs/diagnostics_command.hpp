// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "programs/srfs/suite.hpp"

namespace srfs::tool {

/// Publishes the suite's health on /diagnostics and /diagnostics_agg each @p period, until SIGINT or SIGTERM.
/// Asks every node for its status and reads what the suite keeps of it; no node works for it otherwise.
/// @return exit code: 1: the suite does not run
int publish_diagnostics(const Target& target, milliseconds period);

}  // namespace srfs::tool
