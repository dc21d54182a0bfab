// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>

#include "programs/srfs/suite.hpp"

namespace srfs::tool {

/// Prints every topic of a domain with type, number of publishers and subscriptions, and QoS, also those of
/// other programs. Listens for @p wait. @param domain nullopt: that of the running suite @return exit code
int show_topics(const Target& target, std::optional<int> domain, milliseconds wait, bool json);

}  // namespace srfs::tool
