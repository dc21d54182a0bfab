// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

#include "base/file.hpp"
#include "base/result.hpp"
#include "base/time.hpp"
#include "nodes/ttc/command/journal_file.hpp"
#include "nodes/ttc/link/link_state_file.hpp"
#include "nodes/ttc/link/session_key_store.hpp"
#include "nodes/ttc/ttc_core.hpp"

namespace srfs {

/// What outlives ttc in its folder: the journal of telecommands, counters of the link, mode, keys, silence.
/// Blocks on the disk. At the start one thread reads all of it; then the journal and the rest may have one
/// thread each.
class StoredState {
 public:
  /// @param keys  folder of the session keys
  StoredState(std::filesystem::path folder, std::filesystem::path keys);

  // ---- start. What is lost or damaged is logged.

  /// @param stores  folder of the packet stores. @return whether ttc ran here before
  [[nodiscard]] bool ran_before(const std::filesystem::path& stores) const;
  /// @param initial  mode of a deployment that never ran
  [[nodiscard]] ModeManager load_mode(MissionMode initial, bool ran) const;
  [[nodiscard]] TransmitterSwitch load_transmitter(MonotonicTime now) const;
  [[nodiscard]] CommandLossTimer load_command_loss(seconds patience, MonotonicTime now) const;
  /// Settings of the packet stores, empty when there are none.
  [[nodiscard]] std::string load_stores() const;
  /// The table of a service.
  [[nodiscard]] FoundTable load_table(std::string_view name) const;
  /// Chooses the set of each channel: as it was stored, else one that can be used.
  [[nodiscard]] KeySelection load_keys(UplinkConfig& config, std::vector<TtcCore::KeyNews>& news) const;
  /// The session keys, which @p config uses from then on.
  [[nodiscard]] FoundSessionKeys load_session_keys(UplinkConfig& config) const;
  /// Journal and link state into @p setup, and what their state means.
  /// @param ran  ran_before(). @param known_id  the next telecommand id of this process, 0: none yet
  void load_journal(TtcCore::Setup& setup, bool ran, std::uint64_t known_id, UtcTime utc, MonotonicTime now);

  // ---- the thread of the journal

  struct JournalWritten {
    Result<void, FileError> written;
    std::size_t used_octets = 0;
  };
  [[nodiscard]] JournalWritten write_journal(const JournalBatch& batch);

  // ---- the other thread. What cannot be written is logged.

  [[nodiscard]] std::filesystem::path path_of(const std::string& name) const { return folder_ / name; }
  [[nodiscard]] bool write(const std::string& name, const std::string& text) const;
  [[nodiscard]] bool write_keys(const KeySelection& selection) const;
  [[nodiscard]] bool write_session_keys(const wire::SessionKeys& keys) const;
  /// In the record of the step of the start (suite/step_down.hpp).
  [[nodiscard]] bool write_rescue_entry() const;
  [[nodiscard]] bool write_table(const std::string& name, const StoredTable& table) const;
  void copy_link_state(const LinkState& state);
  void forget_wanted_floor() const;

 private:
  [[nodiscard]] FloorWanted floor_wanted(bool nothing, bool ran) const;

  std::filesystem::path folder_;
  std::filesystem::path keys_;
  JournalFile journal_file_;
  JournalLog journal_log_;
  LinkStateFile link_file_;
};

}  // namespace srfs
