// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "ground/pass/pass_item.hpp"

#include <algorithm>
#include <array>

#include <fmt/format.h>

#include "base/sha256.hpp"
#include "base/text.hpp"

namespace srfs::ground::pass {
namespace {

constexpr std::size_t key_digits = 16;
constexpr std::array<std::string_view, 6> kinds{"query", "telecommand", "wait", "up", "gaps", "down"};
constexpr std::array<std::string_view, 5> states{"waiting", "ordered", "done", "failed", "unknown"};

std::string key_of(const std::string& what) {
  return to_digits(sha256_of(as_octets(what))).substr(0, key_digits);
}

std::string line_of(const TelecommandText& telecommand) {
  std::string line = telecommand.name;
  for (const std::string& argument : telecommand.arguments) line += " " + argument;
  return line;
}

/// Makes items whose keys differ: the n-th of the same text has n in its key.
class Collection {
 public:
  Item& add(ItemKind kind, const std::string& text, unsigned priority) {
    const std::string what = fmt::format("{} {}", to_text(kind), text);
    items_.push_back({.kind = kind,
                      .key = key_of(fmt::format("{} #{}", what, ++seen_[what])),
                      .text = text,
                      .priority = priority});
    return items_.back();
  }
  [[nodiscard]] std::vector<Item> take() { return std::move(items_); }

 private:
  std::vector<Item> items_;
  std::map<std::string, unsigned> seen_;
};

std::uint64_t whole_octets(double octets) {
  return octets > 0 ? static_cast<std::uint64_t>(octets) : 0;
}

/// What one direction carries in one pass.
void fill(Forecast& pass, const std::vector<Item>& items, std::vector<std::uint64_t>& left, ItemKind kind,
          std::uint64_t room) {
  auto candidates = open_items(items, kind);
  std::erase_if(candidates, [&](std::size_t i) { return left[i] == 0; });
  std::vector<Item> rests = items;
  for (const std::size_t i : candidates) rests[i].octets = left[i];
  while (room > 0) {
    const auto chosen = choose(rests, candidates, static_cast<double>(room));
    if (!chosen) return;
    const std::uint64_t octets = std::min(room, left[*chosen]);
    left[*chosen] -= octets;
    room -= octets;
    pass.parts.push_back({*chosen, octets, left[*chosen] == 0});
    std::erase(candidates, *chosen);
  }
}

}  // namespace

std::string_view to_text(ItemKind kind) {
  return kinds.at(static_cast<std::size_t>(kind));
}

std::string_view to_text(ItemState state) {
  return states.at(static_cast<std::size_t>(state));
}

std::optional<ItemState> item_state_of(std::string_view text) {
  const auto found = std::find(states.begin(), states.end(), text);
  if (found == states.end()) return std::nullopt;
  return static_cast<ItemState>(found - states.begin());
}

std::vector<Item> items_of(const PassPlan& plan) {
  Collection items;
  for (const TelecommandText& query : plan.queries)
    items.add(ItemKind::query, line_of(query), 0).telecommand = query;
  for (const ScriptStep& step : plan.script) {
    const bool waits = step.kind == ScriptStep::Kind::wait;
    Item& item = items.add(waits ? ItemKind::wait : ItemKind::telecommand, step.text, 0);
    item.telecommand = {.name = step.name, .arguments = step.arguments};
    item.step = step;
  }
  if (plan.gaps) items.add(ItemKind::gaps, "packets that the archive misses", 0);
  for (const FileUp& file : plan.up) {
    Item& item =
        items.add(ItemKind::up, fmt::format("{} ({})", file.name, file.sha256.substr(0, 8)), file.priority);
    item.file = file;
    item.octets = file.octets;
  }
  return items.take();
}

Item item_of_file(const std::string& path, std::uint64_t octets, unsigned priority) {
  return {.kind = ItemKind::down,
          .key = key_of(fmt::format("down {} {}", octets, path)),
          .text = path,
          .priority = priority,
          .path = path,
          .octets = octets};
}

const FilesDown* wish_for(const PassPlan& plan, const std::string& folder, const std::string& name) {
  for (const FilesDown& wish : plan.down) {
    if (wish.folder == folder && matches(wish.pattern, name)) return &wish;
  }
  return nullptr;
}

std::vector<std::size_t> open_items(const std::vector<Item>& items, ItemKind kind) {
  std::vector<std::size_t> open;
  for (std::size_t i = 0; i < items.size(); ++i) {
    if (items[i].kind == kind && !is_over(items[i].state)) open.push_back(i);
  }
  std::stable_sort(open.begin(), open.end(),
                   [&](std::size_t a, std::size_t b) { return items[a].priority < items[b].priority; });
  return open;
}

std::optional<std::size_t> choose(const std::vector<Item>& items, const std::vector<std::size_t>& candidates,
                                  double octets_left) {
  for (const std::size_t i : candidates) {
    if (static_cast<double>(items.at(i).octets) <= octets_left) return i;
  }
  return candidates.empty() ? std::nullopt : std::optional(candidates.front());
}

std::vector<Forecast> forecast(const std::vector<PassTimes>& passes, const std::vector<Item>& items,
                               const LineRates& rates, UtcTime now) {
  std::vector<std::uint64_t> left;
  for (const Item& item : items) left.push_back(item.is_file() && !is_over(item.state) ? item.octets : 0);
  std::vector<Forecast> forecasts;
  for (const PassTimes& pass : passes) {
    const double length_s = std::chrono::duration<double>(pass.set - std::max(pass.rise, now)).count();
    Forecast& here = forecasts.emplace_back();
    here.times = pass;
    here.down_octets = whole_octets(length_s * rates.down_octets_s);
    here.up_octets = whole_octets(length_s * rates.up_octets_s);
    fill(here, items, left, ItemKind::up, here.up_octets);
    fill(here, items, left, ItemKind::down, here.down_octets);
  }
  return forecasts;
}

}  // namespace srfs::ground::pass
