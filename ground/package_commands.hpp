// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <string>

#include "ground/console.hpp"
#include "ground/package_draft.hpp"

namespace srfs::ground {

// The subcommands of `srfs-ground package` that need no spacecraft. Print what they did, errors to standard
// error (with json: as an object of type "error"); block on the disk.

struct PackageCommand {
  PackageDraft said;     ///< make: what the command line says
  std::string manifest;  ///< make: file that says the rest; empty: none
  std::string seed;      ///< file
  std::string output;    ///< file
  std::string file;      ///< the package
  std::string key;       ///< file of the public key; empty: not checked
  std::uint64_t last_counter = 0;
  bool json = false;
};

/// @return done, or unusable
[[nodiscard]] Exit make_package(const PackageCommand& command);
/// A new key pair; never over files that are there. @return done, or unusable
[[nodiscard]] Exit make_keys(const PackageCommand& command);
/// What the package says, and whether @p key signed it. @return done, or unusable when it cannot be read
[[nodiscard]] Exit show_package(const PackageCommand& command);
/// Everything the spacecraft verifies. @return done, refused, or unusable
[[nodiscard]] Exit verify_package(const PackageCommand& command);

/// A package that is to be installed.
struct Installation {
  std::string file;
  std::string name;  ///< on board: NODE_COUNTER.pkg
  bool activate = true;
};
/// Looks whether @p file can be installed: a whole package, signed by the key of @p key_file unless that is
/// empty. The error is ready to print.
[[nodiscard]] Result<Installation, std::string> prepare_installation(const std::string& file,
                                                                     const std::string& key_file);

}  // namespace srfs::ground
