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

std::vector<NodeProcess> node_processes(const std::filesystem::path& var) {
  constexpr std::size_t longest = 65536;
  std::vector<NodeProcess> found;
  std::error_code ec;
  for (std::filesystem::directory_iterator entry("/proc", ec), end; !ec && entry != end;
       entry.increment(ec)) {
    const auto pid = to_number<pid_t>(entry->path().filename().string());
    if (!pid || *pid == getpid()) continue;
    auto process = Process::open(*pid);
    const auto line = read_file(entry->path() / "cmdline", longest);
    if (!process || !line || !same_folder(word_behind(*line, "--var"), var)) continue;
    if (std::string node = word_behind(*line, "--name"); !node.empty())
      found.push_back({std::move(node), std::move(*process)});
  }
  return found;
}

}  // namespace srfs::suite
