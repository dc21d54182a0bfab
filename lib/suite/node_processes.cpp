// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "suite/node_processes.hpp"

#include <string_view>

#include <unistd.h>

#include "base/file.hpp"
#include "base/text.hpp"

namespace srfs::suite {
namespace {

/// The words of a process' command line that follow @p option, nothing where it has no such option.
std::string word_behind(const std::string& command_line, std::string_view option) {
  const std::string key = '\0' + std::string(option) + '\0';
  const auto at = command_line.find(key);
  if (at == std::string::npos) return "";
  return command_line.substr(at + key.size(), command_line.find('\0', at + key.size()) - at - key.size());
}

bool same_folder(const std::filesystem::path& a, const std::filesystem::path& b) {
  return (a / "").lexically_normal() == (b / "").lexically_normal();
}

}  // namespace

namespace {

/// Calls @p visit(process, command line) for every other process.
template <class F>
void for_each_process(F visit) {
  constexpr std::size_t longest = 65536;
  std::error_code ec;
  for (std::filesystem::directory_iterator entry("/proc", ec), end; !ec && entry != end;
       entry.increment(ec)) {
    const auto pid = to_number<pid_t>(entry->path().filename().string());
    if (!pid || *pid == getpid()) continue;
    auto process = Process::open(*pid);
    const auto line = read_file(entry->path() / "cmdline", longest);
    if (process && line) visit(std::move(*process), *line);
  }
}

}  // namespace

std::vector<NodeProcess> node_processes(const std::filesystem::path& var) {
  std::vector<NodeProcess> found;
  for_each_process([&](Process process, const std::string& line) {
    if (!same_folder(word_behind(line, "--var"), var)) return;
    if (std::string node = word_behind(line, "--name"); !node.empty())
      found.push_back({std::move(node), std::move(process)});
  });
  return found;
}

std::vector<Process> starter_processes(const std::filesystem::path& var) {
  std::vector<Process> found;
  const std::string folder = '\0' + std::filesystem::absolute(var).string() + '\0';
  for_each_process([&](Process process, const std::string& line) {
    if (line.find(folder) == std::string::npos) return;
    const bool waits = std::filesystem::path(line.c_str()).filename() == "srfs-starter";
    if (waits || line.find(std::string("\0serve-starter\0", 15)) != std::string::npos)
      found.push_back(std::move(process));
  });
  return found;
}

}  // namespace srfs::suite
