// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <functional>
#include <optional>
#include <string>

#include "base/time.hpp"
#include "nodes/ttc/command/acceptance_journal.hpp"
#include "nodes/ttc/command/journal_file.hpp"
#include "nodes/ttc/link/link_state_file.hpp"

namespace srfs::rescue {

/// The state of the uplink (counters of SDLS, FARM-1) where ttc has it, in the journal of telecommands and in
/// link_state, read and written with ttc's own code: what one has taken, the other takes never again.
/// Telecommands and schedule that stand in the journal are carried along untouched. One object at a time in
/// the whole suite: what one has open another one must not move. Blocks on the disk.
class LinkStore {
 public:
  /// @param folder  VAR/state/ttc
  explicit LinkStore(std::filesystem::path folder);

  /// Once. @return the newest state that can be read; one of generation 0 when there is none
  [[nodiscard]] LinkState load(MonotonicTime now);
  /// Returns when @p link is on the medium, in one of both places at least. @return false: in neither
  [[nodiscard]] bool store(const LinkState& link);

  /// Takes the journal away: first the newest state goes into both copies of link_state, then @p move gets
  /// the path of each file, and the journal begins anew. May be cut off anywhere: no counter goes back, and
  /// of the journal the newest part is left at last, so that nothing that ended in it begins again.
  /// @param move  @return what went wrong; empty: nothing, or there is no such file
  /// @return what went wrong
  [[nodiscard]] std::string set_journal_aside(
      const std::function<std::string(const std::filesystem::path&)>& move);

 private:
  struct Journal {
    Journal(const std::filesystem::path& file, const std::string& boot_id);
    JournalFile file;
    JournalLog log;
    AcceptanceJournal content;
  };
  [[nodiscard]] bool write_journal(const LinkState& link);
  [[nodiscard]] std::string copy_into_both(LinkState link);
  [[nodiscard]] std::filesystem::path segment(unsigned number) const;

  std::filesystem::path folder_;
  std::optional<Journal> journal_;
  LinkStateFile link_file_;
};

}  // namespace srfs::rescue
