// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "base/cpu_users.hpp"

#include <algorithm>
#include <charconv>
#include <cstdlib>
#include <filesystem>

#include <fmt/format.h>
#include <unistd.h>

#include "base/file.hpp"

namespace srfs {
namespace {

constexpr std::size_t largest_file = 4096;
constexpr std::size_t most_processes = 4096;
constexpr double least_share = 0.05;

}  // namespace

std::optional<ProcessTicks> parse_process_stat(std::string_view text) {
  constexpr int user_field = 11;  // behind the name's end, from 0: proc(5)'s fields 14 and 15
  const auto name_begin = text.find('(');
  const auto name_end = text.rfind(')');  // the name may hold anything
  if (name_begin == std::string_view::npos || name_end == std::string_view::npos || name_end < name_begin)
    return std::nullopt;
  ProcessTicks process{std::string(text.substr(name_begin + 1, name_end - name_begin - 1)), 0};
  text.remove_prefix(name_end + 1);
  for (int field = 0; field <= user_field + 1; ++field) {
    text.remove_prefix(std::min(text.find_first_not_of(' '), text.size()));
    const auto end = std::min(text.find(' '), text.size());
    if (field >= user_field) {
      std::uint64_t ticks = 0;
      if (std::from_chars(text.data(), text.data() + end, ticks).ec != std::errc()) return std::nullopt;
      process.ticks += ticks;
    }
    text.remove_prefix(end);
  }
  return process;
}

ProcessTable read_process_table() {
  ProcessTable table;
  std::error_code ec;
  for (std::filesystem::directory_iterator entry("/proc", ec);
       !ec && entry != std::filesystem::directory_iterator() && table.size() < most_processes;
       entry.increment(ec)) {
    const pid_t pid = std::atoi(entry->path().filename().c_str());
    if (pid <= 0) continue;
    const auto text = read_file(entry->path() / "stat", largest_file);
    if (auto process = text ? parse_process_stat(*text) : std::nullopt) table[pid] = std::move(*process);
  }
  return table;
}

std::vector<CpuUser> largest_cpu_users(const ProcessTable& before, const ProcessTable& after,
                                       nanoseconds elapsed, std::size_t most) {
  const double ticks_of_a_cpu =
      std::chrono::duration<double>(elapsed).count() * static_cast<double>(sysconf(_SC_CLK_TCK));
  std::map<std::string, CpuUser> by_name;
  std::map<std::string, std::uint64_t> most_of_name;
  for (const auto& [pid, now] : after) {
    const auto then = before.find(pid);
    const std::uint64_t known =
        then == before.end() || then->second.name != now.name ? 0 : then->second.ticks;
    if (now.ticks <= known) continue;
    CpuUser& user = by_name[now.name];
    user.name = now.name;
    ++user.processes;
    user.cpus += static_cast<double>(now.ticks - known) / ticks_of_a_cpu;
    std::uint64_t& most_ticks = most_of_name[now.name];
    if (now.ticks - known < most_ticks) continue;
    most_ticks = now.ticks - known;
    user.largest = pid;
  }
  std::vector<CpuUser> all;
  for (auto& [name, user] : by_name) {
    if (user.cpus >= least_share) all.push_back(std::move(user));
  }
  std::stable_sort(all.begin(), all.end(),
                   [](const CpuUser& a, const CpuUser& b) { return a.cpus > b.cpus; });
  if (all.size() > most) all.resize(most);
  return all;
}

std::string to_text(const std::vector<CpuUser>& users) {
  std::string text;
  for (const CpuUser& user : users) {
    const std::string many = user.processes > 1 ? fmt::format(" ({} processes)", user.processes) : "";
    text += fmt::format("{}{}{} {:.0f} %", text.empty() ? "" : ", ", user.name, many, 100 * user.cpus);
  }
  return text;
}

std::optional<double> parse_pressure(std::string_view text) {
  constexpr std::string_view key = "some avg10=";
  if (!text.starts_with(key)) return std::nullopt;
  text.remove_prefix(key.size());
  double percent = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), percent);
  if (error != std::errc() || !(percent >= 0 && percent <= 100)) return std::nullopt;
  return percent / 100;
}

std::optional<double> cpu_pressure() {
  const auto text = read_file("/proc/pressure/cpu", largest_file);
  return text ? parse_pressure(*text) : std::nullopt;
}

}  // namespace srfs
