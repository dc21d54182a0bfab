// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include <mission/structures.hpp>

#include "base/result.hpp"
#include "nodes/maintenance/lane_call.hpp"
#include "suite/commanding/telecommand_journal.hpp"
#include "suite/deployment.hpp"
#include "update/update_journal.hpp"

namespace srfs {

/// From an uplinked file to sources that may be built.

/// What the satellite knows of its nodes.
struct IntakeRules {
  std::filesystem::path files;       ///< the folder of files
  std::filesystem::path public_key;  ///< 64 hexadecimal digits
  std::vector<std::string> nodes;    ///< of the suite
  suite::RingSettings ring;          ///< whose versions the operator confirms
};

struct Intake {
  update::Update update;  ///< step build, not in the journal yet
  update::Manifest manifest;
  std::string dictionary;  ///< text of the fragment that the package brings; empty: none
};
struct IntakeFailure {
  FailureCode code = mission::failure::package_refused;
  std::string reason;  ///< ready to print
};
/// Reads the package, verifies all of it and unpacks its sources into LaneFolders::sources, in a work folder
/// made anew. Blocks on the disk: some 10 ms for a package of 100 kB.
/// @param file  its name in the folder of files. @param journal  whose counters forbid old packages
[[nodiscard]] Result<Intake, IntakeFailure> take_in_package(const IntakeRules& rules, const std::string& file,
                                                            const update::UpdateJournal& journal,
                                                            const LaneFolders& folders);

}  // namespace srfs
