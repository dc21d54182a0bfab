// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <memory>
#include <string>

#include "base/result.hpp"
#include "base/time.hpp"
#include "cfdp/transfer_folders.hpp"
#include "nodes/ttc/files/file_manager.hpp"
#include "nodes/ttc/files/file_order.hpp"
#include "nodes/ttc/imaging/image_outbox.hpp"
#include "nodes/ttc/imaging/imaging_scheduler.hpp"

namespace srfs {

/// The folder of files, for CFDP, the PUS service 23 and the products of imaging. Opened by the first call
/// that finds a disk. Blocks on the disk; one thread at a time.
class FilesFolder {
 public:
  struct Settings {
    std::filesystem::path root;
    std::filesystem::path images;      ///< what image_acquisition and image_processing have stored
    std::filesystem::path checkpoint;  ///< of CFDP
    std::uint64_t uplink_quota_octets = 0;
    std::uint64_t free_floor_octets = 0;
    /// Above all numbers that were ever used, should the checkpoint be lost: asked when the folder is opened,
    /// because the clock may not be set before. On the worker.
    std::function<std::uint32_t()> first_transaction;
  };
  explicit FilesFolder(const Settings& settings)
      : settings_(settings), manager_(settings.root), images_(settings.images, settings.root) {}

  /// @return why the folder cannot be opened, for people
  [[nodiscard]] Result<cfdp::TransferTurnResult, std::string> take_turn(const cfdp::TransferTurn& turn,
                                                                        MonotonicTime now);
  [[nodiscard]] FileOutcome serve(const FileOrder& order, MonotonicTime now);
  [[nodiscard]] ImagingOutcome serve(const ImagingOrder& order, MonotonicTime now);

 private:
  [[nodiscard]] Result<void, std::string> open(MonotonicTime now);

  Settings settings_;
  std::unique_ptr<cfdp::TransferFolders> transfer_folders_;
  FileManager manager_;
  ImageOutbox images_;
};

}  // namespace srfs
