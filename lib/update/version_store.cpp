// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "update/version_store.hpp"

#include <algorithm>
#include <array>

#include <fmt/format.h>

namespace srfs::update {
namespace {

constexpr std::array copies{"table_a", "table_b"};
constexpr std::string_view unfinished = ".new";

bool is_copy(std::string_view name) {
  return std::find(copies.begin(), copies.end(), name) != copies.end();
}

}  // namespace

std::string VersionStore::file_of(VersionNumber number) const {
  return fmt::format("{}.{}", name_, number);
}

std::string VersionStore::state_of(VersionNumber number) {
  return fmt::format("state.{}", number);
}

VersionStore::Reading VersionStore::read() const {
  std::optional<VersionTable> newest;
  std::string problem;
  const auto names = files_.names();
  for (const char* copy : copies) {
    if (std::find(names.begin(), names.end(), copy) == names.end()) continue;
    const auto text = files_.read(copy);
    auto table = text ? decode_versions(*text) : std::nullopt;
    if (!table) {
      problem += fmt::format("{}{}", problem.empty() ? "" : "; ",
                             text ? fmt::format("{} is damaged", copy) : text.error().message);
    } else if (!newest || table->revision() > newest->revision()) {
      newest = std::move(table);
    }
  }
  if (!newest && !problem.empty()) problem += ": golden is active";
  return {newest.value_or(VersionTable()), std::move(problem)};
}

/// One durable copy is a change that has happened.
Result<void, std::string> VersionStore::save(const VersionTable& table) {
  const std::string text = encode(table);
  std::size_t written = 0;
  std::string why;
  // The copy that is already the older or damaged one goes first, so that the newest readable one is never
  // the one being replaced.
  auto order = copies;
  const auto revision_of = [&](const char* copy) {
    const auto present = files_.read(copy);
    const auto decoded = present ? decode_versions(*present) : std::nullopt;
    return decoded ? decoded->revision() : 0;
  };
  if (revision_of(order[0]) > revision_of(order[1])) std::swap(order[0], order[1]);
  for (const char* copy : order) {
    const std::string temporary = std::string(copy) + std::string(unfinished);
    auto done = files_.write(temporary, text);
    if (done) done = files_.rename(temporary, copy);
    if (done) done = files_.sync_names();
    if (done) {
      ++written;
    } else {
      why = done.error().message;
      if (written == 0) break;
    }
  }
  if (written == 0) return Err(why);
  return {};
}

template <class Change>
Result<void, std::string> VersionStore::change(Change change) {
  VersionTable table = read().table;
  const VersionTable before = table;
  if (const auto done = change(table); !done) return Err(std::string(to_text(done.error())));
  if (table == before) return {};
  if (auto saved = save(table); !saved) return saved;
  remove_unnamed(table);
  return {};
}

/// Removes programs of versions that no longer exist, and what was begun and not finished. What cannot be
/// removed now is tried again at the next change.
void VersionStore::remove_unnamed(const VersionTable& table) {
  for (const std::string& name : files_.names()) {
    const auto& versions = table.versions();
    const bool named = is_copy(name) || name == state_of(golden) ||
                       std::any_of(versions.begin(), versions.end(), [&](const Version& v) {
                         return file_of(v.number) == name || state_of(v.number) == name;
                       });
    if (!named) (void)files_.remove(name);
  }
}

Result<VersionNumber, std::string> VersionStore::add(const std::filesystem::path& program,
                                                     const std::string& origin, UtcTime now) {
  VersionTable table = read().table;
  // The table names a file only once it is there: a crash in between leaves a file without an entry.
  const std::string file = file_of(table.next_number());
  const auto digest = files_.copy_in(program, file + std::string(unfinished));
  if (!digest) {
    (void)files_.remove(file + std::string(unfinished));
    return Err(digest.error().message);
  }
  if (digest->octets == 0) {
    (void)files_.remove(file + std::string(unfinished));
    return Err(program.string() + ": is empty");
  }
  auto placed = files_.rename(file + std::string(unfinished), file);
  if (placed) placed = files_.sync_names();
  if (!placed) return Err(placed.error().message);
  const VersionNumber number = table.add(digest->sha256, digest->octets, origin, now);
  if (auto saved = save(table); !saved) return Err(saved.error());
  remove_unnamed(table);
  return number;
}

Result<void, std::string> VersionStore::use(VersionNumber number, milliseconds probation,
                                            const std::string& reason) {
  return change([&](VersionTable& table) { return table.use(number, probation, reason); });
}

Result<void, std::string> VersionStore::commit(VersionNumber number) {
  return change([&](VersionTable& table) { return table.commit(number); });
}

Result<void, std::string> VersionStore::fail(VersionNumber number, const std::string& reason) {
  return change([&](VersionTable& table) { return table.fail(number, reason); });
}

Result<void, std::string> VersionStore::count_reset() {
  return change([](VersionTable& table) { return table.count_reset(); });
}

Result<void, std::string> VersionStore::remove(VersionNumber number) {
  return change([&](VersionTable& table) { return table.remove(number); });
}

std::optional<std::string> VersionStore::damage(const Version& version) const {
  const auto digest = files_.digest(file_of(version.number));
  if (!digest) return digest.error().message;
  if (digest->octets != version.octets)
    return fmt::format("{} octets instead of {}", digest->octets, version.octets);
  if (digest->sha256 != version.sha256) return "wrong SHA-256";
  return std::nullopt;
}

}  // namespace srfs::update
