// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <functional>
#include <memory>

#include "nodes/ttc/files/files_folder.hpp"
#include "nodes/ttc/stored_state.hpp"
#include "nodes/ttc/ttc_core.hpp"
#include "ros/worker.hpp"

namespace srfs {

/// What ttc has on disk, each part on a worker of its own, so that no other write delays a telecommand.
/// Carries out what TtcCore wants of it; each answer goes to the core on the work thread.
class TtcDisk {
 public:
  struct Parts {
    std::unique_ptr<StoredState> state;
    FrameCountFile frame_counts;
    StateFile<std::uint64_t> frame_numbers;
    std::unique_ptr<PacketStores> stores;
    FilesFolder::Settings files;
  };
  struct Workers {
    std::shared_ptr<ros::Worker> journal;  ///< telecommands wait for it
    std::shared_ptr<ros::Worker> state;    ///< small synced writes, and reading small files
    std::shared_ptr<ros::Worker> stores;   ///< packet stores, counters and numbers of frames
    std::shared_ptr<ros::Worker> files;    ///< CFDP, PUS 23, products of imaging
  };
  /// Opens the packet stores. @param core  outlives it. @param answered  called after each answer
  TtcDisk(Parts parts, Workers workers, TtcCore& core, std::function<void()> answered);

  void carry_out(const WriteJournal& action);
  void carry_out(const WriteState& action);
  void carry_out(const WriteKeys& action);
  void carry_out(const WriteSessionKeys& action);
  void carry_out(const WriteRescueEntry& action);
  void carry_out(const WriteTable& action);
  void carry_out(const CopyLinkState& action);
  void carry_out(const ForgetWantedFloor& action);
  void carry_out(const CommitStores& action);
  void carry_out(const ReadStore& action);
  void carry_out(const ServeFile& action);
  void carry_out(const TakeFilesTurn& action);
  void carry_out(const ServeImages& action);

  /// For reading small files off the work thread.
  [[nodiscard]] ros::Worker& small_files() { return *workers_.state; }
  /// Packets that no commit had.
  void store_rest();
  /// Waits for the journal's worker, and its answers.
  void drain_journal() { workers_.journal->drain(); }
  /// Stores the rest and where the frame counters go on. Blocks until everything but the journal is written.
  void close();

 private:
  /// Where counters and numbers of frames may go on. On the stores' worker.
  [[nodiscard]] Result<void, FileError> store_frames(const CommitStores& commit);

  TtcCore& core_;
  std::function<void()> answered_;
  std::unique_ptr<StoredState> state_;
  FrameCountFile frame_counts_;
  StateFile<std::uint64_t> frame_numbers_;
  std::unique_ptr<PacketStores> stores_;
  FilesFolder files_;
  Workers workers_;  ///< end first: their jobs use all above
};

}  // namespace srfs
