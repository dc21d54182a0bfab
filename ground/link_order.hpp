// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>

#include "ground/command_line.hpp"
#include "ground/station.hpp"

namespace srfs::ground {

/// Carries out a command line about AD service, FARM-1 or file transfers.
/// @return nullopt: it is about something else
[[nodiscard]] std::optional<Result<void, OrderError>> order_link(Station& station,
                                                                 const CommandLine& command);

}  // namespace srfs::ground
