// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include <mission/structures.hpp>

#include "base/state_file.hpp"
#include "update/package.hpp"
#include "update/version_table.hpp"

namespace srfs::update {

using mission::UpdateStep;
/// Nothing is to be done any more.
[[nodiscard]] bool is_over(UpdateStep step);

/// One package on its way to a running program.
struct Update {
  std::string file;    ///< in the folder of files
  std::string sha256;  ///< of the package
  std::string node;
  PackageKind kind = PackageKind::replace;
  std::uint64_t counter = 0;
  bool activate = true;
  seconds probation{0};
  UpdateStep step = UpdateStep::none;
  UpdateStep ended_in = UpdateStep::none;  ///< the step that failed, or in which it was cancelled
  VersionNumber version = golden;          ///< golden: not stored yet
  std::uint64_t octets = 0;                ///< of the package
  std::uint64_t program_octets = 0;
  std::optional<milliseconds> build;   ///< what it took
  std::optional<milliseconds> outage;  ///< end of the old process to the new one in its desired state
  std::uint32_t starts = 0;            ///< how often it was begun
  std::string reason;                  ///< why it failed

  friend bool operator==(const Update&, const Update&) = default;
};
/// The origin that the resulting version states; of one package only.
[[nodiscard]] std::string origin_of(const Update& update);

/// The package that was accepted last for a node.
struct AcceptedPackage {
  std::string node;
  std::uint64_t counter = 0;
  std::string sha256;

  friend bool operator==(const AcceptedPackage&, const AcceptedPackage&) = default;
};

/// What must survive the end of maintenance and of the computer: the update in progress, or the last one, and
/// the counters that forbid old packages. Pure.
class UpdateJournal {
 public:
  static constexpr std::size_t most_nodes = 64;
  static constexpr std::uint32_t most_starts = 3;

  [[nodiscard]] std::uint64_t revision() const { return revision_; }
  [[nodiscard]] const Update& update() const { return update_; }
  [[nodiscard]] bool is_under_way() const { return !is_over(update_.step); }

  /// What a package's counter has to be above. The package that was accepted last may come again: its
  /// installation may have ended before its end.
  [[nodiscard]] std::uint64_t last_counter(std::string_view node, std::string_view sha256) const;
  /// A verified package, in step `verify` until it is accepted: its counter is used up. @return false: no
  /// room for another node's counter
  [[nodiscard]] bool begin(Update update);
  void set(UpdateStep step);
  void stored(VersionNumber version, std::uint64_t program_octets);
  void built(milliseconds took);
  /// @param step  failed or cancelled
  void end(UpdateStep step, std::string_view reason);
  void installed(std::optional<milliseconds> outage);

  /// Where an update goes on after its process ended, by the node's present table of versions: build (from
  /// the beginning), swap, or it is over. Begun too often, or not accepted for certain, it failed.
  void resume(const VersionTable& table);

  friend bool operator==(const UpdateJournal&, const UpdateJournal&) = default;
  /// One line of JSON and its CRC-32C.
  friend std::string encode(const UpdateJournal& journal);
  friend std::optional<UpdateJournal> decode_update_journal(std::string_view text);

 private:
  std::uint64_t revision_ = 0;
  Update update_;
  std::vector<AcceptedPackage> accepted_;
};
[[nodiscard]] std::string encode(const UpdateJournal& journal);
[[nodiscard]] std::optional<UpdateJournal> decode_update_journal(std::string_view text);

/// The journal in two copies, updates_a and updates_b: damage of one loses no counter.
[[nodiscard]] StateFile<UpdateJournal> update_journal_file(const std::filesystem::path& folder);

}  // namespace srfs::update
