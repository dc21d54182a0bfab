// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <filesystem>
#include <string>
#include <string_view>

#include "base/octets.hpp"
#include "base/result.hpp"

namespace srfs {

/// Why a file could not be read or written: path, what was tried and the system's reason, ready to print.
struct FileError {
  std::string message;
};

/// The whole file. @param limit files larger than this are refused. Blocks on the disk: worker threads and
/// start-up only.
[[nodiscard]] Result<std::string, FileError> read_file(const std::filesystem::path& path,
                                                       std::size_t limit = 16U << 20);

/// The rest of an open file. @param path  for the message
[[nodiscard]] Result<std::string, FileError> read_open_file(int fd, const std::filesystem::path& path,
                                                            std::size_t limit);

/// Who may read what is written.
enum class Access : std::uint8_t {
  everyone,  ///< 0644, less what umask takes away
  owner,     ///< 0600: keys
};

/// Replaces @p path so that after power loss at any instant it holds the old or the new octets, never a
/// mixture: temporary file beside it (new, no link is followed), fsync, rename, fsync of the folder. Creates
/// missing folders. Blocks on the disk.
[[nodiscard]] Result<void, FileError> write_file_atomically(const std::filesystem::path& path,
                                                            std::string_view content,
                                                            Access access = Access::everyone);

/// Removes @p path for good: it does not come back with a power loss. No error when there is none. Blocks on
/// the disk.
[[nodiscard]] Result<void, FileError> remove_durably(const std::filesystem::path& path);

}  // namespace srfs
