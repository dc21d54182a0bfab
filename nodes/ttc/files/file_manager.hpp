// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <optional>
#include <string>

#include "cfdp/file_digest.hpp"
#include "cfdp/file_tree.hpp"
#include "cfdp/transfer_folders.hpp"
#include "nodes/ttc/files/file_order.hpp"

namespace srfs {

/// Carries out orders about files on the thread that owns the disk. Blocks on it; a file is read in parts, so
/// that what waits behind an order waits for one part only.
class FileManager {
 public:
  static constexpr std::size_t octets_per_part = 1U << 20;

  explicit FileManager(std::filesystem::path root) : root_(std::move(root)) {}

  [[nodiscard]] FileOutcome serve(cfdp::TransferFolders& transfer_folders, const FileOrder& order,
                                  MonotonicTime now);

 private:
  struct Reading {
    std::uint64_t order;
    cfdp::OpenFile file;
    cfdp::FileDigest digest;
  };
  [[nodiscard]] FileOutcome delete_file(const cfdp::TransferFolders& transfer_folders,
                                        const FileOrder& order) const;
  [[nodiscard]] FileOutcome report_attributes(const FileOrder& order);
  [[nodiscard]] FileOutcome change_folder(const FileOrder& order) const;
  [[nodiscard]] FileOutcome list(const FileOrder& order) const;
  [[nodiscard]] FileOutcome copy(cfdp::TransferFolders& transfer_folders, const FileOrder& order) const;
  [[nodiscard]] static FileOutcome change_copies(cfdp::TransferFolders& transfer_folders,
                                                 const FileOrder& order, MonotonicTime now);
  [[nodiscard]] static FileOutcome report_copies(const cfdp::TransferFolders& transfer_folders);

  std::filesystem::path root_;
  std::optional<cfdp::FileTree> tree_;
  std::optional<Reading> reading_;
};

/// The id of a copy: as the ground chose it, else entity of the sender * 2^32 + CFDP sequence number.
[[nodiscard]] std::uint64_t operation_of(const cfdp::Report& report);

}  // namespace srfs
