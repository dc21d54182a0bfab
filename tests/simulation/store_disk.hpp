// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <map>
#include <optional>
#include <utility>
#include <vector>

#include "nodes/ttc/store/segment_files.hpp"
#include "tests/simulation/kernel.hpp"

namespace srfs::simulation {

/// A record that lies on the disk.
struct StoredRecord {
  std::uint32_t sequence = 0;
  TaiTime at;
  std::uint32_t checksum = 0;  ///< of its packet
};

/// Of the disk that all packet stores share.
struct StoreDiskState {
  bool failing = false;
  /// The process that writes lets so many more changes through, then it has ended; nullopt: it lives.
  std::optional<unsigned> changes_left;
};

/// The folder of one packet store. What was not synced is lost with the power, in any order, whole or in
/// part; not with the process.
class SegmentDisk {
 public:
  /// @param state  outlives it
  SegmentDisk(Random random, StoreDiskState& state) : random_(random), state_(state) {}

  void lose_power();
  /// What is there, in the order of the files.
  [[nodiscard]] std::vector<StoredRecord> records() const;
  [[nodiscard]] std::size_t octets() const;
  [[nodiscard]] std::size_t longest_file() const;

  /// A file that was deleted.
  struct Deletion {
    bool was_oldest = false;
    std::size_t octets_before = 0;  ///< of all files, this one too
    std::vector<StoredRecord> records;
  };
  /// Those since the last call.
  [[nodiscard]] std::vector<Deletion> take_deletions() { return std::exchange(deletions_, {}); }

 private:
  friend class PlayedSegmentFiles;
  struct Write {
    std::size_t offset;
    Octets octets;
  };
  struct File {
    Octets now;
    Octets durable;
    std::vector<Write> unsynced;
  };
  [[nodiscard]] bool may_change();

  std::map<std::uint32_t, File> files_;
  std::vector<Deletion> deletions_;
  Random random_;
  StoreDiskState& state_;
};

/// The same as a process sees it.
class PlayedSegmentFiles final : public SegmentFiles {
 public:
  explicit PlayedSegmentFiles(SegmentDisk& disk) : disk_(disk) {}

  Result<std::vector<std::uint32_t>, SegmentError> list() override;
  Result<Octets, SegmentError> read(std::uint32_t number, std::size_t octets_max) override;
  bool exists(std::uint32_t number) override { return disk_.files_.contains(number); }
  Result<void, SegmentError> cut(std::uint32_t number, std::size_t octets) override;
  Result<void, SegmentError> remove(std::uint32_t number) override;
  Result<void, SegmentError> create(std::uint32_t number, OctetView header) override;
  Result<void, SegmentError> open(std::uint32_t number) override;
  [[nodiscard]] bool is_open() const override { return open_.has_value(); }
  Result<void, SegmentError> check_open() override { return {}; }
  Result<void, SegmentError> write(std::size_t offset, OctetView octets) override;
  Result<void, SegmentError> sync() override;
  void close() override { open_.reset(); }

 private:
  SegmentDisk& disk_;
  std::optional<std::uint32_t> open_;
};

}  // namespace srfs::simulation
