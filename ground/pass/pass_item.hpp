// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "base/result.hpp"
#include "ground/pass/pass_plan.hpp"

namespace srfs::ground::pass {

enum class ItemKind : std::uint8_t {
  query,        ///< a telecommand that asks; may be repeated
  telecommand,  ///< of the script; never sent twice
  wait,         ///< of the script
  up,           ///< a file
  gaps,         ///< packets that the archive misses
  down,         ///< a file that the spacecraft has
};
[[nodiscard]] std::string_view to_text(ItemKind kind);

enum class ItemState : std::uint8_t {
  waiting,  ///< nothing was sent
  ordered,  ///< perhaps sent; how it ended is not known yet
  done,
  failed,   ///< it ended otherwise than wanted, or cannot be had
  unknown,  ///< sent or not, and no one can tell any more: an operator decides
};
[[nodiscard]] std::string_view to_text(ItemState state);
[[nodiscard]] std::optional<ItemState> item_state_of(std::string_view text);
[[nodiscard]] constexpr bool is_over(ItemState state) {
  return state == ItemState::done || state == ItemState::failed || state == ItemState::unknown;
}

/// One thing that a plan wants, and what became of it.
struct Item {
  ItemKind kind = ItemKind::query;
  std::string key = {};   ///< the same in each reading of the plan, and no other item's; of the journal
  std::string text = {};  ///< for people
  unsigned priority = 0;
  TelecommandText telecommand = {};  ///< query and telecommand
  std::optional<ScriptStep> step = {};
  FileUp file = {};          ///< up
  std::string path = {};     ///< down: on board
  std::uint64_t octets = 0;  ///< of a file; 0: not known
  // What the journal keeps.
  ItemState state = ItemState::waiting;
  std::string token = {};       ///< of a telecommand that was ordered
  std::uint32_t operation = 0;  ///< of a copy that was ordered; 0: none
  unsigned failures = 0;
  std::string detail = {};  ///< why it is as it is, for people
  UtcTime changed = {};

  [[nodiscard]] bool is_file() const { return kind == ItemKind::up || kind == ItemKind::down; }
};

/// All that the plan says, in the order in which it is done.
[[nodiscard]] std::vector<Item> items_of(const PassPlan& plan);
/// A file on board that the plan wants.
[[nodiscard]] Item item_of_file(const std::string& path, std::uint64_t octets, unsigned priority);
/// The first wish for which a file is wanted; nullptr: it is not.
[[nodiscard]] const FilesDown* wish_for(const PassPlan& plan, const std::string& folder,
                                        const std::string& name);

/// Items of a kind that are not over, the most urgent first.
[[nodiscard]] std::vector<std::size_t> open_items(const std::vector<Item>& items, ItemKind kind);

/// Which file is next: of those that fit into what is left of the pass, the most urgent one; if none fits,
/// the most urgent one of all, which goes on in the next pass. @param candidates  indices of files, most
/// urgent first
[[nodiscard]] std::optional<std::size_t> choose(const std::vector<Item>& items,
                                                const std::vector<std::size_t>& candidates,
                                                double octets_left);

/// What a pass would carry.
struct Forecast {
  PassTimes times = {};
  std::uint64_t down_octets = 0;  ///< room
  std::uint64_t up_octets = 0;
  struct Part {
    std::size_t item = 0;
    std::uint64_t octets = 0;
    bool whole = true;  ///< its last octet too
  };
  std::vector<Part> parts = {};
};
/// Which files go with which pass, as choose() takes them, from now on. What is no file takes no time here.
[[nodiscard]] std::vector<Forecast> forecast(const std::vector<PassTimes>& passes,
                                             const std::vector<Item>& items, const LineRates& rates,
                                             UtcTime now);

}  // namespace srfs::ground::pass
