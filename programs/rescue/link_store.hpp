// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <optional>
#include <string>

#include "base/time.hpp"
#include "nodes/ttc/command/acceptance_journal.hpp"
#include "nodes/ttc/command/journal_file.hpp"
#include "nodes/ttc/link/link_state_file.hpp"

namespace srfs::rescue {

/// The state of the uplink (counters of SDLS, FARM-1) where ttc has it, in the journal of telecommands and in
/// link_state, read and written with ttc's own code: what one has taken, the other takes never again.
/// Telecommands and schedule that stand in the journal are carried along untouched. Blocks on the disk.
class LinkStore {
 public:
  /// @param folder  VAR/state/ttc
  explicit LinkStore(std::filesystem::path folder);

  /// Once. @return the newest state that can be read; one of generation 0 when there is none
  [[nodiscard]] LinkState load(MonotonicTime now);
  /// Returns when @p link is on the medium, in one of both places at least. @return false: in neither
  [[nodiscard]] bool store(const LinkState& link);
  /// Copies the newest state into link_state, so that the journal can go. @return what went wrong
  [[nodiscard]] std::string carry_counters_over();

 private:
  [[nodiscard]] bool write_journal(const LinkState& link);

  std::filesystem::path folder_;
  JournalFile journal_file_;
  JournalLog journal_log_;
  LinkStateFile link_file_;
  AcceptanceJournal journal_;
};

}  // namespace srfs::rescue
