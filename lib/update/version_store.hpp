// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>
#include <string>

#include "update/version_files.hpp"
#include "update/version_table.hpp"

namespace srfs::update {

/// The versions of one node on disk: the programs NAME.1, NAME.2..., and the table in two copies, table_a and
/// table_b, each replaced atomically one after the other, of which the newest readable one counts. After a
/// power loss at any instant each change has happened whole or not at all, and the program of every version
/// in the table is there. Without a readable table golden is active, and the next change begins anew and
/// removes what no table names. Blocks on the disk; one writer at a time (PosixVersionFiles::lock).
class VersionStore {
 public:
  VersionStore(VersionFiles& files, std::string name) : files_(files), name_(std::move(name)) {}

  struct Reading {
    VersionTable table;
    std::string problem;  ///< for people; empty: all is well. A copy that cannot be read is none yet
  };
  [[nodiscard]] Reading read() const;

  /// Takes the program in as a candidate. @return its number
  [[nodiscard]] Result<VersionNumber, std::string> add(const std::filesystem::path& program,
                                                       const std::string& origin, UtcTime now);
  [[nodiscard]] Result<void, std::string> use(VersionNumber number, milliseconds probation,
                                              const std::string& reason);
  [[nodiscard]] Result<void, std::string> commit(VersionNumber number);
  [[nodiscard]] Result<void, std::string> fail(VersionNumber number, const std::string& reason);
  [[nodiscard]] Result<void, std::string> count_reset();
  [[nodiscard]] Result<void, std::string> remove(VersionNumber number);

  /// What is wrong with its program: gone, or not the octets it was added with. nullopt: nothing. Reads all
  /// of it: 1 to 2 ms for a megabyte that is in memory.
  [[nodiscard]] std::optional<std::string> damage(const Version& version) const;
  [[nodiscard]] std::string file_of(VersionNumber number) const;
  /// The folder with the node's state as this version left it (lib/suite/state_files); goes with the version.
  [[nodiscard]] static std::string state_of(VersionNumber number);

 private:
  [[nodiscard]] Result<void, std::string> save(const VersionTable& table);
  template <class Change>
  [[nodiscard]] Result<void, std::string> change(Change change);
  void remove_unnamed(const VersionTable& table);

  VersionFiles& files_;
  std::string name_;
};

}  // namespace srfs::update
