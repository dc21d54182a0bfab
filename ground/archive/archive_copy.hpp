// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <functional>
#include <string>
#include <string_view>
#include <vector>

#include "base/result.hpp"
#include "ground/archive/archive.hpp"

namespace srfs::ground {

/// Of one table.
struct CopiedRows {
  std::string table;
  std::uint64_t read = 0;
  std::uint64_t added = 0;  ///< the others were there
};

/// After each batch.
using CopyProgress = std::function<void(const CopiedRows& so_far)>;

/// Adds all rows of one archive to another one of the same spacecraft, which is made if it is not there. What
/// both have (the same packet, telecommand, file event, pass, gap) is one row, so a copy that was ended
/// anywhere is completed by another one, and archives can be copied into one in any order. The source is only
/// read, as it is when the copy begins; a server may go on writing it. A PostgreSQL gets rows in short
/// transactions, beside its servers; of an SQLite file the caller has seen to it that nobody else writes it.
///
/// Aggregates of minutes of which both have packets are made anew by the next server. A verification report
/// belongs to the newest telecommand with its request that was sent before it came.
/// @param into  with the station whose rows these are, where the source does not say it
/// @return each table; the error is ready to print
[[nodiscard]] Result<std::vector<CopiedRows>, std::string> copy_archive(const ArchivePlace& from,
                                                                        const ArchivePlace& into,
                                                                        const CopyProgress& progress);

}  // namespace srfs::ground
