// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "ground/pass/pass_journal.hpp"

#include <algorithm>
#include <cerrno>

#include <fcntl.h>
#include <fmt/format.h>
#include <sys/file.h>
#include <nlohmann/json.hpp>

#include "base/checked_text.hpp"

namespace srfs::ground::pass {
namespace {

using Json = nlohmann::json;

std::string text_of(const Json& json) {
  return json.dump(-1, ' ', false, Json::error_handler_t::replace);
}

bool is_kept(const Item& item) {
  return item.kind == ItemKind::down || item.state != ItemState::waiting || item.failures > 0;
}

Json to_json(const Item& item) {
  Json json{{"k", item.key}, {"s", to_text(item.state)}, {"t", item.changed.ns()}};
  if (!item.token.empty()) json["token"] = item.token;
  if (item.operation != 0) json["op"] = item.operation;
  if (item.failures != 0) json["fail"] = item.failures;
  if (!item.detail.empty()) json["why"] = item.detail;
  if (item.kind == ItemKind::down) {
    json["path"] = item.path;
    json["octets"] = item.octets;
    json["prio"] = item.priority;
  }
  return json;
}

Item item_of(const Json& json) {
  Item item;
  if (json.contains("path")) {
    item = item_of_file(json.at("path").get<std::string>(), json.at("octets").get<std::uint64_t>(),
                        json.at("prio").get<unsigned>());
  }
  item.key = json.at("k").get<std::string>();
  item.state = item_state_of(json.at("s").get<std::string>()).value_or(ItemState::unknown);
  item.changed = UtcTime(nanoseconds(json.at("t").get<std::int64_t>()));
  item.token = json.value("token", "");
  item.operation = json.value("op", 0U);
  item.failures = json.value("fail", 0U);
  item.detail = json.value("why", "");
  return item;
}

Json to_json(const FlownPass& pass) {
  Json json{
      {"began", pass.began.ns()}, {"end", pass.end}, {"down", pass.down_octets}, {"done", pass.items_done}};
  if (pass.ended) json["ended"] = pass.ended->ns();
  return json;
}

FlownPass flown_of(const Json& json) {
  FlownPass pass{.began = UtcTime(nanoseconds(json.at("began").get<std::int64_t>())),
                 .end = json.at("end").get<std::string>(),
                 .down_octets = json.at("down").get<std::uint64_t>(),
                 .items_done = json.at("done").get<std::uint32_t>()};
  if (json.contains("ended")) pass.ended = UtcTime(nanoseconds(json.at("ended").get<std::int64_t>()));
  return pass;
}

PassJournal journal_of(const Json& json) {
  PassJournal journal{.plan = json.at("plan").get<std::string>(),
                      .revision = json.at("revision").get<std::uint64_t>(),
                      .suspended = json.at("suspended").get<bool>(),
                      .left_out = json.at("left_out").get<std::uint32_t>()};
  for (const Json& item : json.at("items")) journal.items.push_back(item_of(item));
  for (const Json& pass : json.at("flown")) journal.flown.push_back(flown_of(pass));
  return journal;
}

/// Two items say the same to the journal.
bool are_equal(const Item& a, const Item& b) {
  return a.state == b.state && a.token == b.token && a.operation == b.operation && a.failures == b.failures &&
         a.detail == b.detail;
}

}  // namespace

std::string encode_journal(const PassJournal& journal) {
  Json json{{"plan", journal.plan},         {"revision", journal.revision}, {"suspended", journal.suspended},
            {"left_out", journal.left_out}, {"items", Json::array()},       {"flown", Json::array()}};
  for (const Item& item : journal.items) json["items"].push_back(to_json(item));
  for (const FlownPass& pass : journal.flown) json["flown"].push_back(to_json(pass));
  return with_check(text_of(json));
}

std::optional<PassJournal> decode_journal(std::string_view stored) {
  const auto text = without_check(stored);
  if (!text) return std::nullopt;
  try {
    return journal_of(Json::parse(*text));
  } catch (const Json::exception&) {
    return std::nullopt;  // the checksum is right, the content is another program's
  }
}

JournalFile::JournalFile(const std::filesystem::path& folder, const std::string& plan)
    : plan_(plan),
      folder_(folder),
      file_(
          folder / (plan + ".a"), folder / (plan + ".b"),
          {.encode = encode_journal,
           .decode = decode_journal,
           .is_newer = [](const PassJournal& a, const PassJournal& b) { return a.revision > b.revision; }}) {}

Result<PassJournal, std::string> JournalFile::load() {
  auto found = file_.load();
  if (found.state && found.state->plan == plan_) return std::move(*found.state);
  if (found.existed())
    return Err(
        fmt::format("the journal of plan {} is damaged: what was sent is not known any more. Check it with "
                    "srfs-ground commands, then go on under another name of the plan",
                    plan_));
  PassJournal fresh;
  fresh.plan = plan_;
  return fresh;
}

Result<Fd, std::string> JournalFile::lock() const {
  std::error_code error;
  std::filesystem::create_directories(folder_, error);
  const auto file = folder_ / (plan_ + ".lock");
  constexpr mode_t owner_alone = 0600;
  Fd lock(::open(file.c_str(), O_RDWR | O_CREAT | O_CLOEXEC, owner_alone));
  if (!lock) return Err(fmt::format("{}: cannot open: {}", file.string(), errno_text(errno)));
  if (::flock(lock.get(), LOCK_EX | LOCK_NB) != 0)
    return Err(fmt::format("plan {} is being flown by another srfs-ground; end it first", plan_));
  return lock;
}

Result<void, std::string> JournalFile::store(PassJournal& journal) {
  ++journal.revision;
  if (encode_journal(journal).size() > StateFile<PassJournal>::largest_octets)
    return Err(fmt::format("the journal of plan {} is full: go on under another name of the plan", plan_));
  const auto stored = file_.store(journal);
  if (!stored.durable())
    return Err(fmt::format("the journal of plan {} cannot be written: {}", plan_, stored.problem));
  return {};
}

std::vector<Item> with_journal(std::vector<Item> items, const PassJournal& journal) {
  for (const Item& kept : journal.items) {
    const auto same =
        std::find_if(items.begin(), items.end(), [&](const Item& item) { return item.key == kept.key; });
    if (same == items.end()) {
      if (kept.kind == ItemKind::down) items.push_back(kept);
      continue;
    }
    same->state = kept.state;
    same->token = kept.token;
    same->operation = kept.operation;
    same->failures = kept.failures;
    same->detail = kept.detail;
    same->changed = kept.changed;
  }
  return items;
}

bool take_items(PassJournal& journal, const std::vector<Item>& items) {
  bool changed = false;
  for (const Item& item : items) {
    const auto same = std::find_if(journal.items.begin(), journal.items.end(),
                                   [&](const Item& kept) { return kept.key == item.key; });
    if (same == journal.items.end()) {
      if (!is_kept(item)) continue;
      journal.items.push_back(item);
      changed = true;
    } else if (!are_equal(*same, item)) {
      *same = item;
      changed = true;
    }
  }
  return changed;
}

}  // namespace srfs::ground::pass
