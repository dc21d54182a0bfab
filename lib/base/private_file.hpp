// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <sys/types.h>

#include <filesystem>
#include <optional>
#include <string>

#include "base/fd.hpp"
#include "base/file.hpp"
#include "base/result.hpp"

namespace srfs {

/// Files that decide what the suite does, in a folder of this user alone (0700). A folder of another user, a
/// folder others may write to and a symbolic link are refused; so is a link in the folder.

/// The folder, opened. Made when it is missing and @p make, with the folder above; taken away from others
/// when they may only read it.
/// @param also  for root: takes the folder of this user, too, and makes it for that user
[[nodiscard]] Result<Fd, FileError> open_private_folder(const std::filesystem::path& folder, bool make,
                                                        std::optional<uid_t> also = std::nullopt);

/// A regular file in such a folder. @param flags  of open(2); with O_CREAT folder and file (0600) are made
[[nodiscard]] Result<Fd, FileError> open_private(const std::filesystem::path& file, int flags,
                                                 std::optional<uid_t> also = std::nullopt);

/// The whole file. @param limit  a larger one is refused
[[nodiscard]] Result<std::string, FileError> read_private(const std::filesystem::path& file,
                                                          std::size_t limit,
                                                          std::optional<uid_t> also = std::nullopt);

/// The file of a lock below VAR, for reading and writing: 0600, never through a link. An older one that
/// others may open is taken away from them. Invalid with errno.
[[nodiscard]] Fd open_lock_file(const std::filesystem::path& file);

}  // namespace srfs
