// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "ground/place.hpp"

#include <algorithm>
#include <string_view>

#include <sys/stat.h>
#include <unistd.h>

#include "base/file.hpp"
#include "base/text.hpp"
#include "ground/link.hpp"

namespace srfs::ground {
namespace {

constexpr std::string_view port_name = "rs422";

std::filesystem::path folder_of(const std::string& port) {
  if (is_network_port(port)) return "var";
  const auto parent = std::filesystem::path(port).parent_path();
  return parent.empty() ? std::filesystem::path(".") : parent;
}

/// The arguments in /proc/PID/cmdline.
std::vector<std::string> words_of(const std::string& text) {
  std::vector<std::string> words;
  for (std::size_t begin = 0; begin < text.size();) {
    const std::size_t end = std::min(text.find('\0', begin), text.size());
    words.push_back(text.substr(begin, end - begin));
    begin = end + 1;
  }
  return words;
}

}  // namespace

Place place_of(const PlaceHints& hints) {
  const std::filesystem::path var = hints.var_environment;
  if (!hints.port_argument.empty()) {
    const bool apart = hints.port_argument.starts_with("/dev/") || is_network_port(hints.port_argument);
    return {hints.port_argument, apart && !var.empty() ? var : folder_of(hints.port_argument)};
  }
  if (!hints.port_environment.empty())
    return {hints.port_environment, var.empty() ? folder_of(hints.port_environment) : var};
  std::filesystem::path found = var;
  if (found.empty()) found = !hints.var_here && hints.running.size() == 1 ? hints.running.front() : "var";
  return {(found / port_name).string(), found};
}

std::optional<std::filesystem::path> simulated_var(const std::vector<std::string>& command_line) {
  if (command_line.empty() || std::filesystem::path(command_line.front()).filename() != "hw_sim")
    return std::nullopt;
  const auto option = std::find(command_line.begin(), command_line.end(), "--var");
  if (option == command_line.end() || option + 1 == command_line.end()) return std::nullopt;
  const std::filesystem::path var = *(option + 1);
  return var.is_absolute() ? std::optional(var) : std::nullopt;
}

std::vector<std::filesystem::path> running_simulations() {
  constexpr std::size_t command_line_octets_max = 65536;
  std::vector<std::filesystem::path> found;
  std::error_code error;
  for (const auto& entry : std::filesystem::directory_iterator("/proc", error)) {
    struct stat owner {};
    if (!to_number<int>(entry.path().filename().string())) continue;
    if (::stat(entry.path().c_str(), &owner) != 0 || owner.st_uid != ::geteuid()) continue;
    const auto text = read_file(entry.path() / "cmdline", command_line_octets_max);
    const auto var = text ? simulated_var(words_of(*text)) : std::nullopt;
    if (var && std::find(found.begin(), found.end(), *var) == found.end()) found.push_back(*var);
  }
  return found;
}

}  // namespace srfs::ground
