// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "base/fd.hpp"
#include "base/state_file.hpp"
#include "ground/pass/pass_item.hpp"

namespace srfs::ground::pass {

/// A pass in which something of the plan was done.
struct FlownPass {
  UtcTime began;
  std::optional<UtcTime> ended = {};  ///< nullopt: the program ended before the pass did
  std::string end = {};               ///< why it ended, for people
  std::uint64_t down_octets = 0;      ///< of the line
  std::uint32_t items_done = 0;
};

/// What is remembered of a plan between its passes, and over the end of the program at any instant.
struct PassJournal {
  static constexpr std::size_t flown_max = 32;         ///< the oldest is forgotten first
  static constexpr std::size_t found_files_max = 128;  ///< on board; more are left out, and counted

  std::string plan = {};
  std::uint64_t revision = 0;    ///< counts the changes
  bool suspended = false;        ///< copies on board were suspended at the end of a pass
  std::uint32_t left_out = 0;    ///< files on board beyond found_files_max, of the last listing
  std::vector<Item> items = {};  ///< only what the journal keeps of an item; with those found on board
  std::vector<FlownPass> flown = {};
};

[[nodiscard]] std::string encode_journal(const PassJournal& journal);
/// nullopt: damaged, or none.
[[nodiscard]] std::optional<PassJournal> decode_journal(std::string_view stored);

/// The journal of a plan in its folder, in two copies. Blocks on the disk.
class JournalFile {
 public:
  /// @param folder  STATE/passes
  JournalFile(const std::filesystem::path& folder, const std::string& plan);
  /// An empty one if there is none. The error, ready to print: both copies are damaged.
  [[nodiscard]] Result<PassJournal, std::string> load();
  /// One run at a time: as long as it is held. The error is ready to print.
  [[nodiscard]] Result<Fd, std::string> lock() const;
  /// On the medium when this returns. The error is ready to print.
  [[nodiscard]] Result<void, std::string> store(PassJournal& journal);

 private:
  std::string plan_;
  std::filesystem::path folder_;
  StateFile<PassJournal> file_;
};

/// The items of a plan as they stand: those that it says with their states, and those found on board. Items
/// that the plan does not say any more are not among them.
[[nodiscard]] std::vector<Item> with_journal(std::vector<Item> items, const PassJournal& journal);
/// Takes the states of items over. @return whether anything changed
bool take_items(PassJournal& journal, const std::vector<Item>& items);

}  // namespace srfs::ground::pass
