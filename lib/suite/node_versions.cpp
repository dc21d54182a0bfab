// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "suite/node_versions.hpp"

#include <algorithm>
#include <sstream>

#include <fcntl.h>
#include <fmt/format.h>
#include <sys/stat.h>
#include <unistd.h>

#include "base/private_file.hpp"

namespace srfs::suite {
namespace {

using update::PosixVersionFiles;
using update::VersionNumber;
using update::VersionStore;
using update::VersionTable;

constexpr milliseconds lock_patience{2000};
constexpr std::size_t largest_note = 8192;

std::string aside_file(const std::string& node) {
  return node + ".set_aside";
}

std::string started_file(const std::string& node) {
  return node + ".starting";
}

std::string violation_file(const std::string& node) {
  return node + ".violation";
}

struct SetAside {
  VersionNumber version;
  std::string reason;
};

/// What was set aside while the table on disk had this revision; a later one knows of it, or of something
/// newer.
std::vector<SetAside> set_aside_at(const VarPaths& var, const std::string& node, std::uint64_t revision) {
  std::istringstream in(read_from_memory(var, aside_file(node), largest_note));
  std::uint64_t of = 0;
  std::vector<SetAside> all;
  if (!(in >> of) || of != revision) return all;
  VersionNumber version = 0;
  while (in >> version) {
    std::string reason;
    std::getline(in >> std::ws, reason);
    all.push_back({version, reason});
  }
  return all;
}

bool has_versions(const VarPaths& var, const std::string& node) {
  struct stat status {};
  return stat(versions_folder(var, node).c_str(), &status) == 0;
}

}  // namespace

bool replace_in_memory(const VarPaths& var, const std::string& name, const std::string& text) {
  const auto file = var.memory() / name;
  const std::string temporary = file.string() + ".tmp";
  {
    const auto fd = open_private(temporary, O_WRONLY | O_CREAT | O_TRUNC, var.owner());
    if (!fd || write(fd->get(), text.data(), text.size()) != static_cast<ssize_t>(text.size())) return false;
  }
  return rename(temporary.c_str(), file.c_str()) == 0;
}

std::string read_from_memory(const VarPaths& var, const std::string& name, std::size_t limit) {
  return read_private(var.memory() / name, limit, var.owner()).value_or("");
}

std::filesystem::path versions_folder(const VarPaths& var, const std::string& node) {
  return var.root / "versions" / node;
}

NodeVersions read_versions(const VarPaths& var, const std::string& node) {
  if (!has_versions(var, node)) return {};
  PosixVersionFiles files(versions_folder(var, node));
  auto [table, problem] = VersionStore(files, node).read();
  for (const SetAside& failed : set_aside_at(var, node, table.revision()))
    (void)table.fail(failed.version, failed.reason);
  return {std::move(table), std::move(problem)};
}

bool set_aside(const VarPaths& var, const std::string& node, VersionNumber version,
               const std::string& reason) {
  PosixVersionFiles files(versions_folder(var, node));
  const std::uint64_t revision = VersionStore(files, node).read().table.revision();
  std::string text = fmt::format("{}\n", revision);
  for (const SetAside& earlier : set_aside_at(var, node, revision))
    text += fmt::format("{} {}\n", earlier.version, earlier.reason);
  std::string line = reason.substr(0, VersionTable::longest_text);
  std::replace(line.begin(), line.end(), '\n', ' ');
  return replace_in_memory(var, aside_file(node), text + fmt::format("{} {}\n", version, line));
}

Result<void, std::string> settle_versions(const VarPaths& var, const std::string& node) {
  if (!has_versions(var, node)) return {};
  return change_versions(var, node, [](VersionStore&) { return Result<void, std::string>(); });
}

Result<void, std::string> change_versions(const VarPaths& var, const std::string& node,
                                          const VersionChange& change) {
  PosixVersionFiles files(versions_folder(var, node));
  const auto lock = files.lock(lock_patience);
  if (!lock) return Err(lock.error().message);
  VersionStore store(files, node);
  for (const SetAside& failed : set_aside_at(var, node, store.read().table.revision())) {
    if (auto done = store.fail(failed.version, failed.reason); !done) return done;
  }
  return change(store);
}

void remember_started(const VarPaths& var, const std::string& node, const Process& process, MonotonicTime now,
                      VersionNumber version) {
  if (const auto ticks = process_start_ticks(process.pid()))
    replace_in_memory(var, started_file(node),
                      fmt::format("{} {} {} {}\n", process.pid(), *ticks, now.ns(), version));
}

std::optional<StartedProcess> last_started(const VarPaths& var, const std::string& node) {
  std::istringstream in(read_from_memory(var, started_file(node), 256));
  StartedProcess started;
  std::int64_t since_ns = 0;
  if (!(in >> started.pid >> started.start_ticks >> since_ns >> started.version)) return std::nullopt;
  started.since = MonotonicTime(nanoseconds(since_ns));
  return started;
}

std::optional<VersionTrial> trial_of(const VarPaths& var, const RingSettings& ring, const std::string& node,
                                     const VersionTable& table, bool seen, MonotonicTime now) {
  const update::Version* version = table.on_trial();
  if (version == nullptr) return std::nullopt;
  const auto started = last_started(var, node);
  if (!started) {
    if (!seen) return std::nullopt;
    return VersionTrial{version->number, version->probation, nanoseconds(0), needs_confirmation(ring, node)};
  }
  if (started->version != version->number) return std::nullopt;
  return VersionTrial{version->number, version->probation, now - started->since,
                      needs_confirmation(ring, node)};
}

void report_violation(const VarPaths& var, const std::string& node, pid_t pid, const std::string& what) {
  std::string line = what.substr(0, VersionTable::longest_text);
  std::replace(line.begin(), line.end(), '\n', ' ');
  replace_in_memory(var, violation_file(node), fmt::format("{} {}\n", pid, line));
}

std::optional<std::string> violation_of(const VarPaths& var, const std::string& node, pid_t pid) {
  std::istringstream in(read_from_memory(var, violation_file(node), largest_note));
  pid_t blamed = 0;
  std::string what;
  if (!(in >> blamed) || blamed != pid || !std::getline(in >> std::ws, what)) return std::nullopt;
  return what;
}

bool needs_confirmation(const RingSettings& ring, const std::string& node) {
  return std::find(ring.confirmed.begin(), ring.confirmed.end(), node) != ring.confirmed.end();
}

milliseconds default_probation(const RingSettings& ring, const std::string& node) {
  return needs_confirmation(ring, node) ? VersionTable::default_confirmed_probation
                                        : VersionTable::default_probation;
}

std::optional<MonotonicTime> runs_since(const VarPaths& var, const std::string& node, VersionNumber version) {
  const auto instance = find_instance(var, node);
  const auto started = last_started(var, node);
  if (!instance || !started || started->pid != instance->pid || started->version != version)
    return std::nullopt;
  return started->since;
}

}  // namespace srfs::suite
