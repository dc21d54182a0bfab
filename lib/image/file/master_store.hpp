// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "image/calibration.hpp"

namespace srfs::image {

/// A master in a store.
struct StoredMaster {
  MasterKind kind;
  std::uint32_t generation;  ///< from 1, of its kind
  int frames;                ///< that it was made of
  std::uint32_t defects;
  DetectorSetting setting;
  std::string sha256;  ///< of its file's content; empty until that was read
};

/// Masters as files FOLDER/KIND_GENERATION.master: whole or not there, also across power loss, each with its
/// checksum. Of one setting the newest two generations are kept (a broken one does not leave the task
/// without), of a kind at most masters_most: the oldest go. One writer. Blocks on the disk.
class MasterStore {
 public:
  explicit MasterStore(std::filesystem::path folder) : folder_(std::move(folder)) {}

  struct Listed {
    std::vector<StoredMaster> masters;  ///< the newest first
    std::vector<std::string> problems;  ///< files that are broken, or why the folder cannot be read
  };
  /// What the files' heads say; their content is not read.
  [[nodiscard]] Listed list(MasterKind kind) const;

  struct Read {
    Master master;
    std::string sha256;
  };
  /// @return a listed one, or how its file is broken
  [[nodiscard]] Result<Read, Refusal> read(const StoredMaster& listed) const;

  struct Saved {
    StoredMaster master;
    std::vector<std::string> problems;  ///< what should be gone and is still there; the next save tries again
  };
  /// As the next generation.
  /// @return the master, on the disk for good; or why not (also: what is there cannot be listed), then the
  /// generation before stays in use: its file is removed. Where the disk refuses even that it stays, whole or
  /// recognised as broken
  [[nodiscard]] Result<Saved, Refusal> save(const Master& master) const;

  static constexpr std::size_t generations_kept = 2;
  static constexpr std::size_t masters_most = 6;

 private:
  struct File {
    std::uint32_t generation;
    std::filesystem::path path;
  };
  /// Newest first.
  /// @return none where there is no folder; why it cannot be read is no proof that there are none
  [[nodiscard]] Result<std::vector<File>, Refusal> files_of(MasterKind kind) const;
  [[nodiscard]] std::filesystem::path path_of(MasterKind kind, std::uint32_t generation) const;
  /// What a power loss left half written. @return what could not be removed
  [[nodiscard]] std::vector<std::string> remove_leftovers() const;
  [[nodiscard]] std::vector<std::string> remove_superseded(MasterKind kind) const;

  std::filesystem::path folder_;
};

}  // namespace srfs::image
