// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "update/control_group.hpp"

#include <array>
#include <cerrno>
#include <charconv>
#include <fstream>
#include <string>

#include <fcntl.h>
#include <fmt/format.h>
#include <sys/stat.h>
#include <unistd.h>

#include "base/fd.hpp"
#include "base/process.hpp"

namespace srfs::update {
namespace {

const std::filesystem::path groups = "/sys/fs/cgroup";
constexpr std::string_view prefix = "srfs_lane.";

bool is_version_2() {
  return access((groups / "cgroup.controllers").c_str(), F_OK) == 0;
}

/// Where groups are made: the one that systemd leaves to us with the bounds of all builds (packaging/
/// srfs-build.service), else the root.
std::filesystem::path parent_of_version_2() {
  const std::filesystem::path delegated = groups / "srfs.slice/srfs-build.slice/srfs-build.service";
  return access((delegated / "cgroup.procs").c_str(), W_OK) == 0 ? delegated : groups;
}

/// @return 0 or errno
int write_value(const std::filesystem::path& file, const std::string& value) {
  const Fd fd(open(file.c_str(), O_WRONLY | O_CLOEXEC));
  if (!fd) return errno;
  return write(fd.get(), value.data(), value.size()) < 0 ? errno : 0;
}

/// The number behind @p key in a file of "key number" lines, or the file's only number.
std::optional<std::uint64_t> read_value(const std::filesystem::path& file, std::string_view key = {}) {
  std::ifstream in(file);
  std::string word;
  while (!key.empty() && in >> word && word != key) in >> word;
  std::uint64_t value = 0;
  return in >> value ? std::optional(value) : std::nullopt;
}

/// A group with one limit. @return 0 or errno; then there is none
int make_group(std::filesystem::path& group, const char* limit, std::uint64_t value) {
  if (mkdir(group.c_str(), 0755) != 0 && errno != EEXIST) return errno;
  return write_value(group / limit, std::to_string(value));
}

/// "PID.START" of the name of a group; its owner's number is the first part.
bool owner_lives(std::string_view name) {
  pid_t pid = 0;
  std::uint64_t start = 0;
  const auto [end, bad] = std::from_chars(name.data(), name.data() + name.size(), pid);
  if (bad != std::errc() || end == name.data() + name.size()) return false;
  std::from_chars(end + 1, name.data() + name.size(), start);
  return process_start_ticks(pid) == start;
}

void remove_abandoned_in(const std::filesystem::path& folder) {
  std::error_code ec;
  for (const auto& entry : std::filesystem::directory_iterator(folder, ec)) {
    const std::string name = entry.path().filename();
    if (!name.starts_with(prefix) || owner_lives(std::string_view(name).substr(prefix.size()))) continue;
    rmdir(entry.path().c_str());  // refused while a process is in it
  }
}

}  // namespace

ControlGroup::ControlGroup(std::uint64_t memory_octets, unsigned processes) {
  const bool v2 = is_version_2();
  // Several of one process, one behind the other, share the name: the one before has gone.
  const std::string name =
      fmt::format("{}{}.{}", prefix, getpid(), process_start_ticks(getpid()).value_or(0));
  memory_ = v2 ? parent_of_version_2() / name : groups / "memory" / name;
  processes_ = v2 ? memory_ : groups / "pids" / name;
  memory_refusal_ = make_group(memory_, v2 ? "memory.max" : "memory.limit_in_bytes", memory_octets);
  process_refusal_ = make_group(processes_, "pids.max", processes);
  const auto made = std::array{memory_, processes_};
  if (memory_refusal_ != 0) memory_.clear();
  if (process_refusal_ != 0) processes_.clear();
  for (const auto& group : made)
    if (group != memory_ && group != processes_) rmdir(group.c_str());
  const auto open_members = [](const std::filesystem::path& group, int& refusal) {
    if (group.empty()) return Fd();
    Fd members(open((group / "cgroup.procs").c_str(), O_WRONLY | O_CLOEXEC));
    if (!members) refusal = errno;
    return members;
  };
  memory_members_ = open_members(memory_, memory_refusal_);
  process_members_ = open_members(processes_, process_refusal_);
}

ControlGroup::~ControlGroup() {
  for (const auto& group : {memory_, processes_}) {
    if (group.empty()) continue;
    // The last process of a group that has just been waited for may still be leaving it.
    for (int attempt = 0; attempt < 100 && rmdir(group.c_str()) != 0 && errno == EBUSY; ++attempt)
      usleep(1000);
  }
}

void ControlGroup::join() {
  constexpr std::string_view oneself = "0";
  if (memory_members_ && write(memory_members_.get(), oneself.data(), oneself.size()) < 0)
    memory_refusal_ = errno;
  if (process_members_ && write(process_members_.get(), oneself.data(), oneself.size()) < 0)
    process_refusal_ = errno;
}

bool ControlGroup::out_of_memory() const {
  if (memory_.empty()) return false;
  const char* const file = is_version_2() ? "memory.events" : "memory.oom_control";
  return read_value(memory_ / file, "oom_kill").value_or(0) > 0;
}

bool ControlGroup::too_many_processes() const {
  return !processes_.empty() && read_value(processes_ / "pids.events", "max").value_or(0) > 0;
}

std::optional<std::uint64_t> ControlGroup::peak_octets() const {
  if (memory_.empty()) return std::nullopt;
  return read_value(memory_ / (is_version_2() ? "memory.peak" : "memory.max_usage_in_bytes"));
}

void ControlGroup::remove_abandoned() {
  if (is_version_2()) {
    remove_abandoned_in(groups);
    remove_abandoned_in(parent_of_version_2());
  } else {
    remove_abandoned_in(groups / "memory");
    remove_abandoned_in(groups / "pids");
  }
}

}  // namespace srfs::update
