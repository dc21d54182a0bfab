// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <optional>
#include <string>

#include "base/time.hpp"
#include "programs/srfs/suite.hpp"

namespace srfs::tool {

/// `srfs versions`: every node's versions. Needs neither DDS nor a running suite.
/// @param node   empty: all
/// @param check  reads the programs and compares their SHA-256; exit code 1 when one is damaged
int show_versions(const Target& target, const std::string& node, bool check, bool json);
/// `srfs versions add NODE FILE`: a candidate; prints its number.
int add_version(const Target& target, const std::string& node, const std::filesystem::path& program,
                const std::string& origin, bool json);
/// `srfs versions use NODE VERSION`: restarts a running node in it. @param version  a number, "golden" or
/// "previous". @param probation  nullopt: the node's default
int use_version(const Target& target, const std::string& node, const std::string& version,
                std::optional<seconds> probation, bool json);
/// `srfs versions confirm NODE VERSION`: its probation has ended well. Only while the node runs it.
int confirm_version(const Target& target, const std::string& node, const std::string& version, bool json);
int remove_version(const Target& target, const std::string& node, const std::string& version, bool json);

}  // namespace srfs::tool
