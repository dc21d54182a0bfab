// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>

#include "base/file.hpp"
#include "update/package.hpp"

namespace srfs::update {

// Keys of packages as files: 64 hexadecimal digits and a newline, as link keys. The seed stays on the ground;
// the public key is on board in VAR/keys/package.pub. All block on the disk; errors never show a key.

/// Where the public key stands below VAR.
inline constexpr const char* public_key_file = "keys/package.pub";

/// Refused when others than its owner may read it.
[[nodiscard]] Result<SigningSeed, FileError> load_seed(const std::filesystem::path& file);
/// Refused when the key behind it may be publicly known (base/known_key.hpp).
[[nodiscard]] Result<PublicKey, FileError> load_public_key(const std::filesystem::path& file);

/// Modes 0600 and 0644, synced. Never over a file that is there, nor through a link.
[[nodiscard]] Result<void, FileError> save_new_seed(const std::filesystem::path& file,
                                                    const SigningSeed& seed);
[[nodiscard]] Result<void, FileError> save_new_public_key(const std::filesystem::path& file,
                                                          const PublicKey& key);

/// Of the system's random numbers; blocks until there are some.
[[nodiscard]] SigningSeed new_seed();

}  // namespace srfs::update
