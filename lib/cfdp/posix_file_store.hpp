// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "base/fd.hpp"
#include "base/file.hpp"
#include "cfdp/file_store.hpp"
#include "cfdp/rooted_path.hpp"

namespace srfs::cfdp {

/// The files below one folder of a Linux file system; no name leaves it (rooted_path.hpp). Temporary files
/// stand in ROOT/.cfdp, so that giving them their name is one rename. Missing folders of a destination are
/// refused.
class PosixFileStore final : public FileStore {
 public:
  /// Makes the root and what it needs below it. @param checkpoint file of the checkpoint
  /// @param free_floor_octets temporary files leave so much of the file system free; the checkpoint may use
  /// it
  [[nodiscard]] static Result<std::unique_ptr<PosixFileStore>, FileError> open(
      const std::filesystem::path& root, const std::filesystem::path& checkpoint,
      std::uint64_t free_floor_octets = 0);

  /// What save_checkpoint() wrote last; empty: nothing yet.
  [[nodiscard]] Result<Octets, FileError> load_checkpoint() const;

  FileResult<FileStamp> stamp(std::string_view name) override;
  FileResult<std::size_t> read(std::string_view name, std::uint64_t offset,
                               std::span<std::uint8_t> into) override;
  FileResult<void> check_destination(std::string_view name) override;
  FileResult<void> create_temporary(TransactionId id) override;
  FileResult<void> check_room(std::uint64_t octets) override;
  FileResult<void> write_temporary(TransactionId id, std::uint64_t offset, OctetView data) override;
  FileResult<std::size_t> read_temporary(TransactionId id, std::uint64_t offset,
                                         std::span<std::uint8_t> into) override;
  FileResult<void> sync_temporary(TransactionId id) override;
  FileResult<void> commit(TransactionId id, std::uint64_t octets, std::string_view name) override;
  void discard_temporary(TransactionId id) override;
  void discard_temporaries_except(std::span<const TransactionId> kept) override;
  std::vector<std::string> list(std::string_view folder, std::size_t names_max) override;
  void remove(std::string_view name) override;
  bool rename(std::string_view from, std::string_view to) override;
  FileResult<void> save_checkpoint(OctetView checkpoint) override;

 private:
  struct OpenTemporary {
    TransactionId id;
    Fd fd;
  };
  PosixFileStore(Fd root, std::filesystem::path root_path, Fd temporaries,
                 std::filesystem::path temporaries_path, std::filesystem::path checkpoint,
                 std::uint64_t free_floor_octets);
  [[nodiscard]] FileResult<Place> locate(std::string_view name) const;
  [[nodiscard]] FileResult<int> temporary(TransactionId id);
  void close_temporary(TransactionId id);

  Fd root_;
  std::filesystem::path root_path_;
  Fd temporaries_;
  std::filesystem::path temporaries_path_;
  std::filesystem::path checkpoint_;
  std::uint64_t free_floor_octets_;
  std::vector<OpenTemporary> open_;  // newest last, bounded
  std::string source_name_;          // of source_, the file read last
  FileStamp source_stamp_;
  Fd source_;
};

}  // namespace srfs::cfdp
