// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>

#include "suite/ring/fault_ledger.hpp"

namespace srfs::suite {

/// FaultLedger::append without its lock, for a caller that is alone: while no node of the suite runs.
/// @param file  FaultLedger::file()
[[nodiscard]] Result<std::uint64_t, std::string> append_fault(const std::filesystem::path& file,
                                                              FaultRecord record);

}  // namespace srfs::suite
