// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "programs/srfs/doctor_machine.hpp"

#include <algorithm>
#include <cerrno>
#include <limits>
#include <sstream>

#include <net/if.h>
#include <sys/stat.h>
#include <sys/statvfs.h>
#include <unistd.h>

#include "base/file.hpp"
#include "base/text.hpp"

namespace srfs::tool {
namespace {

namespace fs = std::filesystem;

bool is_number(const std::string& name) {
  return !name.empty() && name.find_first_not_of("0123456789") == std::string::npos;
}

std::vector<std::string> fields(const std::string& line, char separator = ':') {
  std::vector<std::string> all;
  std::istringstream in(line);
  for (std::string field; std::getline(in, field, separator);) all.push_back(field);
  return all;
}

}  // namespace

Machine::Machine()
    : look([this](const fs::path& path) -> Result<File, int> {
        struct stat status {};
        if (stat(at(path).c_str(), &status) != 0) return Err(int{errno});
        return File{status.st_mode, status.st_uid, status.st_gid};
      }),
      room([this](const fs::path& path) -> Result<Room, int> {
        struct statvfs status {};
        if (statvfs(at(path).c_str(), &status) != 0) return Err(int{errno});
        return Room{std::uint64_t{status.f_bavail} * status.f_frsize};
      }),
      can_link([](const std::string& interface) -> Result<hw::CanLink, int> {
        const unsigned index = if_nametoindex(interface.c_str());
        if (index == 0) return Err(int{errno});
        return hw::query_can_link(static_cast<int>(index));
      }) {}

std::optional<std::string> Machine::text(const fs::path& path) const {
  auto content = read_file(at(path));
  if (!content) return std::nullopt;
  while (!content->empty() && (content->back() == '\n' || content->back() == '\0')) content->pop_back();
  return std::move(*content);
}

std::optional<std::int64_t> Machine::number(const fs::path& path) const {
  const auto content = text(path);
  return content ? to_number<std::int64_t>(*content) : std::nullopt;
}

std::vector<std::string> Machine::lines(const fs::path& path) const {
  return fields(text(path).value_or(""), '\n');
}

bool Machine::exists(const fs::path& path) const {
  std::error_code ec;
  return fs::exists(at(path), ec);
}

std::optional<std::vector<std::string>> Machine::names(const fs::path& folder) const {
  std::error_code ec;
  std::vector<std::string> all;
  for (fs::directory_iterator entry(at(folder), ec); !ec && entry != fs::directory_iterator();
       entry.increment(ec))
    all.push_back(entry->path().filename());
  if (ec) return std::nullopt;
  std::sort(all.begin(), all.end());
  return all;
}

std::string Machine::name_behind(const fs::path& path) const {
  std::error_code ec;
  const fs::path real = fs::canonical(at(path), ec);
  return (ec ? path : real).filename();
}

Machine::Processes Machine::processes(const std::string& file,
                                      const std::function<bool(const std::string&)>& condition) const {
  Processes result;
  const auto all = names("/proc");
  result.complete = all.has_value();
  for (const std::string& name : all.value_or(std::vector<std::string>())) {
    if (!is_number(name)) continue;
    const auto content = text(fs::path("/proc") / name / file);
    if (content && condition(*content)) result.found.push_back(name);
    // A process that has ended meanwhile does not count.
    if (!content && exists(fs::path("/proc") / name)) result.complete = false;
  }
  return result;
}

bool Account::may(const Machine::File& file, int wanted) const {
  if (user == 0) return true;
  const unsigned shift = file.owner == user ? 6 : groups.contains(file.group) ? 3 : 0;
  const unsigned mode = file.mode >> shift & 7U;
  return (mode & static_cast<unsigned>(wanted)) == static_cast<unsigned>(wanted);
}

std::optional<Account> caller(const Machine& machine) {
  std::optional<Account> account;
  for (const std::string& line : machine.lines("/proc/self/status")) {
    std::istringstream in(line);
    std::string key;
    in >> key;
    if (key == "Uid:") {
      uid_t real = 0;
      account.emplace();
      in >> real >> account->user;
    }
    if (!account) continue;
    if (key == "Gid:" || key == "Groups:") {
      for (gid_t group = 0; in >> group;) account->groups.insert(group);
    }
    std::string digits;
    if (key == "CapEff:" && in >> digits)
      account->capabilities = to_number<std::uint64_t>(digits, 16).value_or(0);
  }
  if (account) account->name = name_of_user(machine, account->user);
  return account;
}

std::optional<Account> account_of(const Machine& machine, const std::string& user) {
  Account account;
  bool found = false;
  for (const std::string& line : machine.lines("/etc/passwd")) {
    const auto entry = fields(line);
    if (entry.size() < 4 || entry[0] != user) continue;
    const auto uid = to_number<uid_t>(entry[2]);
    const auto gid = to_number<gid_t>(entry[3]);
    if (!uid || !gid) continue;
    account = {user, *uid, {*gid}, *uid == 0 ? std::numeric_limits<std::uint64_t>::max() : 0};
    found = true;
  }
  if (!found) return std::nullopt;
  for (const std::string& line : machine.lines("/etc/group")) {
    const auto entry = fields(line);
    if (entry.size() < 4) continue;
    const auto members = fields(entry[3], ',');
    const auto gid = to_number<gid_t>(entry[2]);
    if (gid && std::find(members.begin(), members.end(), user) != members.end()) account.groups.insert(*gid);
  }
  return account;
}

std::string name_of_user(const Machine& machine, uid_t user) {
  for (const std::string& line : machine.lines("/etc/passwd")) {
    const auto entry = fields(line);
    if (entry.size() >= 3 && entry[2] == std::to_string(user)) return entry[0];
  }
  return std::to_string(user);
}

std::string name_of_group(const Machine& machine, gid_t group) {
  for (const std::string& line : machine.lines("/etc/group")) {
    const auto entry = fields(line);
    if (entry.size() >= 3 && entry[2] == std::to_string(group)) return entry[0];
  }
  return std::to_string(group);
}

std::optional<std::uint64_t> hard_limit(const Machine& machine, const std::string& name) {
  for (const std::string& line : machine.lines("/proc/self/limits")) {
    if (!line.starts_with(name + " ")) continue;
    std::istringstream in(line.substr(name.size()));
    std::string soft;
    std::string hard;
    in >> soft >> hard;
    return hard == "unlimited" ? std::numeric_limits<std::uint64_t>::max() : to_number<std::uint64_t>(hard);
  }
  return std::nullopt;
}

std::optional<std::set<int>> parse_cpus(const std::string& list) {
  constexpr int highest = 1023;
  std::set<int> cpus;
  for (const std::string& part : fields(list, ',')) {
    const auto ends = fields(part, '-');
    if (ends.empty() || ends.size() > 2 || part.ends_with('-')) return std::nullopt;
    const auto first = to_number<int>(ends.front());
    const auto last = to_number<int>(ends.back());
    if (!first || !last || *first < 0 || *last > highest) return std::nullopt;
    for (int cpu = *first; cpu <= *last; ++cpu) cpus.insert(cpu);
  }
  return cpus.empty() ? std::nullopt : std::optional(cpus);
}

}  // namespace srfs::tool
