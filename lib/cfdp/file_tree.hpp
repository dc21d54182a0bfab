// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <filesystem>
#include <string>
#include <string_view>
#include <vector>

#include "base/fd.hpp"
#include "base/file.hpp"
#include "base/time.hpp"
#include "cfdp/file_store.hpp"

namespace srfs::cfdp {

enum class EntryKind : std::uint8_t { file, folder, other };

struct FolderEntry {
  std::string name;
  EntryKind kind = EntryKind::file;
  std::uint64_t octets = 0;  ///< of a file
};

/// A part of a folder's entries, in the order of their names.
struct FolderPage {
  std::vector<FolderEntry> entries;
  std::uint32_t total = 0;  ///< in the folder
  std::uint32_t left = 0;   ///< behind this page
};

/// A file that was opened for reading.
struct OpenFile {
  Fd fd;
  FileStamp stamp;
};

/// What an operator does with the files below a folder: names as in PosixFileStore, so none leaves the root.
/// Hidden entries are neither shown nor counted. All calls block on the disk; a change is on the disk when
/// its call returns.
class FileTree {
 public:
  /// Entries of one folder that are read; a folder with more is listed as far as that.
  static constexpr std::uint32_t entries_max = 20'000;

  [[nodiscard]] static Result<FileTree, FileError> open(const std::filesystem::path& root);

  /// The entries with names after @p after (empty: from the first), at most @p most.
  [[nodiscard]] FileResult<FolderPage> list(std::string_view folder, std::string_view after,
                                            std::size_t most) const;
  [[nodiscard]] FileResult<OpenFile> open_file(std::string_view name) const;
  [[nodiscard]] FileResult<FileStamp> stamp(std::string_view name) const;
  /// Anything but a folder; of a symbolic link the link.
  [[nodiscard]] FileResult<void> remove_file(std::string_view name) const;
  /// One that is there already is success.
  [[nodiscard]] FileResult<void> make_folder(std::string_view name) const;
  /// An empty one.
  [[nodiscard]] FileResult<void> remove_folder(std::string_view name) const;

 private:
  explicit FileTree(Fd root) : root_(std::move(root)) {}
  Fd root_;
};

/// Up to @p into's size from @p offset on; fewer only at the end of the file.
[[nodiscard]] FileResult<std::size_t> read_at(int fd, std::uint64_t offset, std::span<std::uint8_t> into);
[[nodiscard]] FileResult<FileStamp> stamp_of(int fd);

}  // namespace srfs::cfdp
