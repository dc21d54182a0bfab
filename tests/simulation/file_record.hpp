// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <map>
#include <memory>
#include <string>
#include <vector>

#include "cfdp/transfer_folders.hpp"
#include "lib/cfdp/test/memory_file_store.hpp"
#include "tests/simulation/kernel.hpp"

namespace srfs::simulation {

/// Less than one file a second was ever sent.
[[nodiscard]] inline std::uint64_t first_transaction(MonotonicTime now) {
  return 1'795'000'000U + static_cast<std::uint64_t>(now.since_epoch() / seconds(1));
}

/// The files of the transactions that an end has.
[[nodiscard]] std::vector<std::string> names_under_way(cfdp::TransferFolders& folders);

/// The files of both ends, and what became of each one that is to be sent. Its functions check requirements
/// L11, L12 and L14.
class FileRecord {
 public:
  enum class End : std::uint8_t { ground, board };
  explicit FileRecord(Kernel& kernel);

  /// What lies on the disk of an end; outlives its process.
  [[nodiscard]] const std::shared_ptr<cfdp::MemoryFileStore>& disk(End end) const {
    return disks_.at(static_cast<std::size_t>(end));
  }
  /// A file of some kilooctets comes into the outbox. @return its name
  std::string put(End from, Random& random);
  /// What an entity says of a file.
  void on_news(End at, const cfdp::News& news);
  /// The process of an end has ended: what it had to say may be lost.
  void on_process_end(End end) { ++processes(end); }
  using Names = std::vector<std::string>;
  /// At the end of a calm: what waited before it has been sent and is there, or its failure was reported and
  /// it is kept as unsent. @param under_way  files of the transactions that each end still has
  void check_ends(MonotonicTime put_before, const std::array<Names, 2>& under_way);
  /// The disk of the spacecraft refuses what is to be changed.
  void set_failing(bool failing);
  void lose_power();

  struct Counters {
    std::uint64_t put = 0;
    std::uint64_t arrived = 0;  ///< and compared
    std::uint64_t failed = 0;
  };
  [[nodiscard]] const Counters& counters() const { return counters_; }

 private:
  struct File {
    End from = End::ground;
    Octets content;
    MonotonicTime put;
    std::uint64_t process = 0;  ///< of its sender, when it was put
    bool ended = false;         ///< at its sender
    bool failed = false;        ///< the same
  };
  void compare(const std::string& name, const File& file) const;
  [[nodiscard]] bool is_there(const std::string& name, const File& file) const;
  void settle(const std::string& name, File& file) const;
  [[nodiscard]] std::uint64_t& processes(End end) { return processes_.at(static_cast<std::size_t>(end)); }

  Kernel& kernel_;
  std::array<std::shared_ptr<cfdp::MemoryFileStore>, 2> disks_;
  std::array<std::uint64_t, 2> processes_{};  ///< of each end, that have ended
  std::map<std::string, File> files_;         ///< by name
  Counters counters_;
};

}  // namespace srfs::simulation
