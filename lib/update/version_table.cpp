// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "update/version_table.hpp"

#include <algorithm>
#include <array>
#include <utility>

#include <fmt/format.h>

#include "update/json_line.hpp"

namespace srfs::update {
namespace {

constexpr std::array state_names{"candidate", "probation", "committed", "previous", "failed"};
constexpr std::string_view format_name = "srfs versions 1";
constexpr std::size_t hash_digits = 64;

bool is_hash(std::string_view text) {
  return text.size() == hash_digits && text.find_first_not_of("0123456789abcdef") == std::string_view::npos;
}

std::optional<Version> version_of(const Json& json) {
  Version v;
  std::string state;
  std::string added;
  std::uint64_t probation_ms = 0;
  const bool complete = get(json, "number", v.number) && get(json, "state", state) &&
                        get(json, "sha256", v.sha256) && get(json, "octets", v.octets) &&
                        get(json, "origin", v.origin) && get(json, "added", added) &&
                        get(json, "probation_ms", probation_ms) &&
                        get(json, "good_revision", v.good_revision) && get(json, "reason", v.reason);
  if (!complete) return std::nullopt;
  const auto known = std::find(state_names.begin(), state_names.end(), state);
  const auto time = from_iso8601(added);
  const auto longest = static_cast<std::uint64_t>(VersionTable::longest_probation.count());
  if (known == state_names.end() || !time || probation_ms > longest || !is_hash(v.sha256))
    return std::nullopt;
  if (json.contains("resets") && !get(json, "resets", v.resets)) return std::nullopt;  // older tables: none
  v.state = static_cast<VersionState>(known - state_names.begin());
  v.added = *time;
  v.probation = milliseconds(probation_ms);
  return v;
}

}  // namespace

std::string_view to_text(VersionState state) {
  return state_names[static_cast<std::size_t>(state)];
}

std::string_view to_text(VersionRefusal refusal) {
  switch (refusal) {
    case VersionRefusal::unknown_version:
      return "there is no such version";
    case VersionRefusal::in_use:
      return "it is active, the last good or the golden version";
    case VersionRefusal::not_on_trial:
      return "it is not on probation";
    case VersionRefusal::no_previous:
      return "there is no previous version";
  }
  return "?";
}

const Version* VersionTable::find(VersionNumber number) const {
  const auto found =
      std::find_if(versions_.begin(), versions_.end(), [&](const Version& v) { return v.number == number; });
  return found == versions_.end() ? nullptr : &*found;
}

Version* VersionTable::entry(VersionNumber number) {
  return const_cast<Version*>(std::as_const(*this).find(number));
}

const Version* VersionTable::on_trial() const {
  const Version* version = find(active_);
  return version != nullptr && version->state == VersionState::probation ? version : nullptr;
}

std::vector<VersionNumber> VersionTable::start_order() const {
  std::vector<VersionNumber> order{active_};
  for (const VersionNumber number : {last_good_, golden}) {
    if (std::find(order.begin(), order.end(), number) == order.end()) order.push_back(number);
  }
  std::vector<const Version*> once_good;
  for (const Version& v : versions_) {
    if (v.state == VersionState::previous) once_good.push_back(&v);
  }
  std::sort(once_good.begin(), once_good.end(),
            [](const Version* a, const Version* b) { return a->good_revision > b->good_revision; });
  for (const Version* v : once_good) order.push_back(v->number);
  return order;
}

std::optional<VersionNumber> VersionTable::previous() const {
  if (active_ != last_good_) return last_good_;
  const Version* best = nullptr;
  for (const Version& v : versions_) {
    if (v.state == VersionState::previous && (best == nullptr || v.good_revision > best->good_revision))
      best = &v;
  }
  if (best != nullptr) return best->number;
  return active_ == golden ? std::nullopt : std::optional(golden);
}

VersionNumber VersionTable::add(std::string sha256, std::uint64_t octets, std::string_view origin,
                                UtcTime now) {
  for (const auto state : {VersionState::failed, VersionState::previous, VersionState::candidate}) {
    if (versions_.size() < most_versions) break;
    const auto oldest =
        std::find_if(versions_.begin(), versions_.end(), [&](const Version& v) { return v.state == state; });
    if (oldest != versions_.end()) versions_.erase(oldest);
  }
  Version version;
  version.number = next_++;
  version.sha256 = std::move(sha256);
  version.octets = octets;
  version.origin = plain_text(origin, VersionTable::longest_text);
  version.added = UtcTime(nanoseconds(now.ns() / 1000 * 1000));  // as it is written
  versions_.push_back(std::move(version));
  ++revision_;
  return versions_.back().number;
}

/// Active and the last good version.
void VersionTable::settle(VersionNumber number) {
  if (number != last_good_) {
    if (Version* before = entry(last_good_); before != nullptr && before->state == VersionState::committed)
      before->state = VersionState::previous;
  }
  active_ = last_good_ = number;
  if (Version* version = entry(number)) {
    version->state = VersionState::committed;
    version->good_revision = revision_;
    version->reason.clear();
  }
}

Result<void, VersionRefusal> VersionTable::use(VersionNumber number, milliseconds probation,
                                               std::string_view reason) {
  Version* wanted = entry(number);
  if (wanted == nullptr && number != golden) return Err(VersionRefusal::unknown_version);
  if (number == active_) return {};
  ++revision_;
  const bool settles = number == golden || number == last_good_;
  if (active_ != last_good_) {
    Version* before = entry(active_);
    before->state = settles                      ? VersionState::failed
                    : before->good_revision != 0 ? VersionState::previous
                                                 : VersionState::candidate;
    if (settles) before->reason = plain_text(reason, VersionTable::longest_text);
  }
  if (settles) {
    settle(number);
    return {};
  }
  wanted->state = VersionState::probation;
  wanted->probation = std::clamp(probation, milliseconds(0), longest_probation);
  wanted->resets = 0;
  wanted->reason.clear();
  active_ = number;
  return {};
}

Result<void, VersionRefusal> VersionTable::commit(VersionNumber number) {
  const Version* trial = on_trial();
  if (trial == nullptr || trial->number != number) return Err(VersionRefusal::not_on_trial);
  ++revision_;
  settle(number);
  return {};
}

Result<void, VersionRefusal> VersionTable::fail(VersionNumber number, std::string_view reason) {
  Version* version = entry(number);
  if (version == nullptr) return Err(VersionRefusal::unknown_version);
  ++revision_;
  const bool was_active = number == active_;
  const bool was_good = number == last_good_;
  version->state = VersionState::failed;
  version->reason = plain_text(reason, VersionTable::longest_text);
  if (!was_active && !was_good) return {};
  const auto order = start_order();
  const VersionNumber next =
      *std::find_if(order.begin(), order.end(), [&](VersionNumber n) { return n != number; });
  if (was_active && was_good) {
    settle(next);
  } else if (was_active) {
    active_ = last_good_;
  } else {
    // Another version is on trial: only what it would go back to has changed. Golden is beyond doubt.
    last_good_ = golden;
  }
  return {};
}

Result<void, VersionRefusal> VersionTable::count_reset() {
  if (on_trial() == nullptr) return Err(VersionRefusal::not_on_trial);
  Version& trial = *entry(active_);
  if (++trial.resets > most_resets)
    return fail(active_, fmt::format("{} resets or starts of the suite in its probation", trial.resets));
  ++revision_;
  return {};
}

Result<void, VersionRefusal> VersionTable::remove(VersionNumber number) {
  if (number == golden || number == active_ || number == last_good_) return Err(VersionRefusal::in_use);
  const auto found =
      std::find_if(versions_.begin(), versions_.end(), [&](const Version& v) { return v.number == number; });
  if (found == versions_.end()) return Err(VersionRefusal::unknown_version);
  versions_.erase(found);
  ++revision_;
  return {};
}

bool VersionTable::is_sound() const {
  if (versions_.size() > most_versions) return false;
  VersionNumber before = golden;
  for (const Version& v : versions_) {
    if (v.number <= before || v.number >= next_) return false;
    before = v.number;
    if ((v.state == VersionState::committed) != (v.number == last_good_)) return false;
    if ((v.state == VersionState::probation) != (v.number == active_ && active_ != last_good_)) return false;
  }
  return (active_ == golden || find(active_) != nullptr) &&
         (last_good_ == golden || find(last_good_) != nullptr) && (active_ != golden || last_good_ == golden);
}

std::string encode(const VersionTable& table) {
  Json versions = Json::array();
  for (const Version& v : table.versions_) {
    versions.push_back({{"number", v.number},
                        {"state", to_text(v.state)},
                        {"sha256", v.sha256},
                        {"octets", v.octets},
                        {"origin", v.origin},
                        {"added", to_iso8601(v.added, 6)},
                        {"probation_ms", static_cast<std::uint64_t>(v.probation.count())},
                        {"good_revision", v.good_revision},
                        {"resets", v.resets},
                        {"reason", v.reason}});
  }
  const Json json{{"format", format_name},   {"revision", table.revision_},   {"next", table.next_},
                  {"active", table.active_}, {"last_good", table.last_good_}, {"versions", versions}};
  return to_checked_line(json);
}

std::optional<VersionTable> decode_versions(std::string_view text) {
  const auto read = from_checked_line(text);
  if (!read) return std::nullopt;
  const Json& json = *read;
  VersionTable table;
  std::string format;
  const bool complete = get(json, "format", format) && get(json, "revision", table.revision_) &&
                        get(json, "next", table.next_) && get(json, "active", table.active_) &&
                        get(json, "last_good", table.last_good_);
  const auto list = json.find("versions");
  if (!complete || format != format_name || list == json.end() || !list->is_array()) return std::nullopt;
  if (list->size() > VersionTable::most_versions) return std::nullopt;
  for (const Json& entry : *list) {
    if (!entry.is_object()) return std::nullopt;
    auto version = version_of(entry);
    if (!version) return std::nullopt;
    table.versions_.push_back(std::move(*version));
  }
  if (!table.is_sound()) return std::nullopt;
  return table;
}

}  // namespace srfs::update
