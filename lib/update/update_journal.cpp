// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "update/update_journal.hpp"

#include <algorithm>
#include <array>
#include <limits>
#include <utility>

#include <fmt/format.h>

#include "update/json_line.hpp"

namespace srfs::update {
namespace {

using update::get;

constexpr std::string_view format_name = "srfs updates 1";
constexpr std::array step_names{"none", "verify",    "build",     "self_test", "store",
                                "swap", "installed", "candidate", "failed",    "cancelled"};
constexpr std::size_t longest_text = 200;

bool get(const Json& json, const char* key, UpdateStep& step) {
  std::string name;
  if (!get(json, key, name)) return false;
  const auto found = std::find(step_names.begin(), step_names.end(), name);
  if (found == step_names.end()) return false;
  step = static_cast<UpdateStep>(found - step_names.begin());
  return true;
}

/// null: nullopt
bool get(const Json& json, const char* key, std::optional<milliseconds>& value) {
  const auto found = json.find(key);
  if (found == json.end()) return false;
  value.reset();
  if (found->is_null()) return true;
  std::uint32_t ms = 0;
  if (!get(json, key, ms)) return false;
  value = milliseconds(ms);
  return true;
}

Json to_json(const std::optional<milliseconds>& value) {
  return value ? Json(static_cast<std::uint32_t>(
                     std::clamp<std::int64_t>(value->count(), 0, std::numeric_limits<std::uint32_t>::max())))
               : Json(nullptr);
}

std::optional<Update> update_of(const Json& json) {
  Update u;
  bool adds = false;
  std::uint32_t probation_s = 0;
  const bool complete =
      get(json, "file", u.file) && get(json, "sha256", u.sha256) && get(json, "node", u.node) &&
      get(json, "adds", adds) && get(json, "counter", u.counter) && get(json, "activate", u.activate) &&
      get(json, "probation_s", probation_s) && get(json, "step", u.step) &&
      get(json, "ended_in", u.ended_in) && get(json, "version", u.version) && get(json, "octets", u.octets) &&
      get(json, "program_octets", u.program_octets) && get(json, "build_ms", u.build) &&
      get(json, "outage_ms", u.outage) && get(json, "starts", u.starts) && get(json, "reason", u.reason);
  if (!complete) return std::nullopt;
  u.kind = adds ? PackageKind::add : PackageKind::replace;
  u.probation = seconds(probation_s);
  return u;
}

}  // namespace

bool is_over(UpdateStep step) {
  switch (step) {
    case UpdateStep::verify:
    case UpdateStep::build:
    case UpdateStep::self_test:
    case UpdateStep::store:
    case UpdateStep::swap:
      return false;
    default:
      return true;
  }
}

std::string origin_of(const Update& update) {
  return fmt::format("package {} {}", update.counter, update.sha256.substr(0, 16));
}

std::uint64_t UpdateJournal::last_counter(std::string_view node, std::string_view sha256) const {
  const auto found = std::find_if(accepted_.begin(), accepted_.end(),
                                  [&](const AcceptedPackage& a) { return a.node == node; });
  if (found == accepted_.end()) return 0;
  return found->sha256 == sha256 && found->counter > 0 ? found->counter - 1 : found->counter;
}

bool UpdateJournal::begin(Update update) {
  auto found = std::find_if(accepted_.begin(), accepted_.end(),
                            [&](const AcceptedPackage& a) { return a.node == update.node; });
  if (found == accepted_.end()) {
    if (accepted_.size() >= most_nodes) return false;
    found = accepted_.insert(accepted_.end(), AcceptedPackage{update.node, 0, {}});
  }
  found->counter = update.counter;
  found->sha256 = update.sha256;
  update_ = std::move(update);
  update_.file = plain_text(update_.file, longest_text);
  update_.step = UpdateStep::verify;
  update_.starts = 1;
  ++revision_;
  return true;
}

void UpdateJournal::set(UpdateStep step) {
  update_.step = step;
  ++revision_;
}

void UpdateJournal::stored(VersionNumber version, std::uint64_t program_octets) {
  update_.version = version;
  update_.program_octets = program_octets;
  ++revision_;
}

void UpdateJournal::built(milliseconds took) {
  update_.build = took;
  ++revision_;
}

void UpdateJournal::end(UpdateStep step, std::string_view reason) {
  update_.ended_in = update_.step;
  update_.step = step;
  update_.reason = plain_text(reason, longest_text);
  ++revision_;
}

void UpdateJournal::installed(std::optional<milliseconds> outage) {
  update_.outage = outage;
  set(UpdateStep::installed);
}

void UpdateJournal::resume(const VersionTable& table) {
  if (!is_under_way()) return;
  // Whether it was accepted is not on record, and what was refused must not begin.
  if (update_.step == UpdateStep::verify) return end(UpdateStep::failed, "interrupted before it began");
  const auto stored_version =
      std::find_if(table.versions().begin(), table.versions().end(),
                   [origin = origin_of(update_)](const Version& v) { return v.origin == origin; });
  const bool is_stored = stored_version != table.versions().end();
  if (is_stored) stored(stored_version->number, stored_version->octets);
  if (is_stored && stored_version->state == VersionState::failed) {
    end(UpdateStep::failed, stored_version->reason);
  } else if (is_stored && table.active() == stored_version->number) {
    update_.step = UpdateStep::swap;
    installed(std::nullopt);
  } else if (is_stored && !update_.activate) {
    set(UpdateStep::candidate);
  } else if (update_.starts >= most_starts) {
    end(UpdateStep::failed, fmt::format("interrupted {} times", update_.starts));
  } else {
    ++update_.starts;
    set(is_stored ? UpdateStep::swap : UpdateStep::build);
  }
}

std::string encode(const UpdateJournal& journal) {
  const Update& u = journal.update_;
  const Json update{{"file", u.file},
                    {"sha256", u.sha256},
                    {"node", u.node},
                    {"adds", u.kind == PackageKind::add},
                    {"counter", u.counter},
                    {"activate", u.activate},
                    {"probation_s", static_cast<std::uint32_t>(u.probation.count())},
                    {"step", to_text(u.step)},
                    {"ended_in", to_text(u.ended_in)},
                    {"version", u.version},
                    {"octets", u.octets},
                    {"program_octets", u.program_octets},
                    {"build_ms", to_json(u.build)},
                    {"outage_ms", to_json(u.outage)},
                    {"starts", u.starts},
                    {"reason", u.reason}};
  Json accepted = Json::array();
  for (const AcceptedPackage& a : journal.accepted_)
    accepted.push_back({{"node", a.node}, {"counter", a.counter}, {"sha256", a.sha256}});
  const Json json{
      {"format", format_name}, {"revision", journal.revision_}, {"update", update}, {"accepted", accepted}};
  return to_checked_line(json);
}

std::optional<UpdateJournal> decode_update_journal(std::string_view text) {
  const auto read = from_checked_line(text);
  if (!read) return std::nullopt;
  const Json& json = *read;
  UpdateJournal journal;
  std::string format;
  if (!get(json, "format", format) || format != format_name || !get(json, "revision", journal.revision_))
    return std::nullopt;
  const auto update = json.find("update");
  const auto accepted = json.find("accepted");
  if (update == json.end() || !update->is_object() || accepted == json.end() || !accepted->is_array() ||
      accepted->size() > UpdateJournal::most_nodes)
    return std::nullopt;
  auto decoded = update_of(*update);
  if (!decoded) return std::nullopt;
  journal.update_ = std::move(*decoded);
  for (const Json& entry : *accepted) {
    AcceptedPackage a;
    if (!entry.is_object() || !get(entry, "node", a.node) || !get(entry, "counter", a.counter) ||
        !get(entry, "sha256", a.sha256))
      return std::nullopt;
    journal.accepted_.push_back(std::move(a));
  }
  return journal;
}

StateFile<UpdateJournal> update_journal_file(const std::filesystem::path& folder) {
  constexpr StateCodec<UpdateJournal> codec{
      .encode = encode,
      .decode = decode_update_journal,
      .is_newer = [](const UpdateJournal& journal,
                     const UpdateJournal& than) { return journal.revision() > than.revision(); },
  };
  return {folder / "updates_a", folder / "updates_b", codec};
}

}  // namespace srfs::update
