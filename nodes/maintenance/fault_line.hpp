// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <mission/structures.hpp>

#include "suite/ring/fault_ledger.hpp"

namespace srfs {

/// A line of the ledger as the ground gets it; what the structure has no room for is cut. Pure.
[[nodiscard]] mission::RingFaultHousekeeping to_mission(const suite::FaultRecord& record);

}  // namespace srfs
