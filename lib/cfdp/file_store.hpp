// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "base/octets.hpp"
#include "base/result.hpp"

namespace srfs::cfdp {

/// The pair that names a transaction for ever (CCSDS 727.0-B-5, 3.4).
struct TransactionId {
  std::uint64_t source = 0;  ///< entity that sends the file
  std::uint64_t sequence = 0;
  friend auto operator<=>(const TransactionId&, const TransactionId&) = default;
};

/// Shows whether a file is still the one it was.
struct FileStamp {
  std::uint64_t octets = 0;
  std::uint64_t inode = 0;
  std::int64_t modified_ns = 0;
  friend bool operator==(const FileStamp&, const FileStamp&) = default;
};

enum class FileFault : std::uint8_t {
  bad_name,  ///< empty, absolute, '..', hidden, through a symbolic link: would leave the root
  not_found,
  not_a_file,
  not_a_folder,
  not_empty,  ///< of a folder
  denied,     ///< read-only or no permission
  no_space,
  io,  ///< any other error of the disk
};
[[nodiscard]] std::string_view to_string(FileFault fault);

template <class T>
using FileResult = Result<T, FileFault>;

/// The disk as an entity sees it: the files under one root, one temporary file for each transaction that
/// receives, one checkpoint. All calls may block on the disk, so an entity with a real store runs on a worker
/// thread. What sync() and save_checkpoint() have returned for survives power loss; of everything else the
/// later writes may be missing.
class FileStore {
 public:
  FileStore() = default;
  FileStore(const FileStore&) = delete;
  FileStore& operator=(const FileStore&) = delete;
  virtual ~FileStore() = default;

  [[nodiscard]] virtual FileResult<FileStamp> stamp(std::string_view name) = 0;
  /// @return octets read; fewer than asked only at the end of the file
  [[nodiscard]] virtual FileResult<std::size_t> read(std::string_view name, std::uint64_t offset,
                                                     std::span<std::uint8_t> into) = 0;

  /// Whether a received file may get this name, before its octets travel.
  [[nodiscard]] virtual FileResult<void> check_destination(std::string_view name) = 0;
  /// Makes an empty temporary file, over one that is there.
  [[nodiscard]] virtual FileResult<void> create_temporary(TransactionId id) = 0;
  /// Whether the disk has room for @p octets now, above what is left free for others. Sets nothing aside: the
  /// room is taken as the octets are written, and write_temporary() asks again.
  [[nodiscard]] virtual FileResult<void> check_room(std::uint64_t octets) = 0;
  [[nodiscard]] virtual FileResult<void> write_temporary(TransactionId id, std::uint64_t offset,
                                                         OctetView data) = 0;
  [[nodiscard]] virtual FileResult<std::size_t> read_temporary(TransactionId id, std::uint64_t offset,
                                                               std::span<std::uint8_t> into) = 0;
  [[nodiscard]] virtual FileResult<void> sync_temporary(TransactionId id) = 0;
  /// Cuts or extends the temporary file to @p octets and gives it its name, replacing a file that has it.
  /// Durable on return.
  [[nodiscard]] virtual FileResult<void> commit(TransactionId id, std::uint64_t octets,
                                                std::string_view name) = 0;
  virtual void discard_temporary(TransactionId id) = 0;
  virtual void discard_temporaries_except(std::span<const TransactionId> kept) = 0;

  // The outbox (transfer_folders.hpp)
  /// Names of the files in @p folder that do not begin with a dot, at most @p names_max, in no order.
  [[nodiscard]] virtual std::vector<std::string> list(std::string_view folder, std::size_t names_max) = 0;
  virtual void remove(std::string_view name) = 0;
  /// Replaces a file of the new name. @return whether it was done
  [[nodiscard]] virtual bool rename(std::string_view from, std::string_view to) = 0;

  /// Replaces the checkpoint; the old one stays when this fails or the power goes.
  [[nodiscard]] virtual FileResult<void> save_checkpoint(OctetView checkpoint) = 0;
};

}  // namespace srfs::cfdp
