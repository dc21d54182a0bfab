// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "suite/command_keys.hpp"

#include <algorithm>
#include <cerrno>
#include <cstdio>
#include <optional>
#include <vector>

#include <fcntl.h>
#include <fmt/format.h>
#include <sys/random.h>
#include <unistd.h>

#include "base/log.hpp"
#include "base/octets.hpp"
#include "base/private_file.hpp"
#include "base/sha256.hpp"
#include "base/text.hpp"

namespace srfs::suite {
namespace {

constexpr std::string_view suite_file = "command_key";
constexpr std::string_view seal_folder = "seal";
constexpr std::string_view seal_file = "seal/seal_key";

std::string folder_of(const std::string& node) {
  return "of_" + node;
}

std::string file_of(const std::string& node) {
  return folder_of(node) + "/command_key";
}

/// Where memory takes none: on VAR's disk, among the keys that only ttc may read.
std::array<std::filesystem::path, 2> folders(const VarPaths& var) {
  return {order_keys(var), var.root / "keys" / "orders"};
}

std::optional<CommandKey> read_key(const VarPaths& var, std::string_view name) {
  for (const auto& folder : folders(var)) {
    const auto content = read_private(folder / name, 64, var.owner());
    CommandKey key{};
    if (!content || content->size() != key.size()) continue;
    std::copy(content->begin(), content->end(), key.begin());
    return key;
  }
  return std::nullopt;
}

/// One that was cut short, or is something else.
bool is_no_key(const std::filesystem::path& file, const VarPaths& var) {
  const auto content = read_private(file, 1U << 20, var.owner());
  return content && content->size() != CommandKey{}.size();
}

/// Whole or not at all. @param replace  else one that is there stays, if it is a key
Result<void, std::string> write_key(const VarPaths& var, std::string_view name, const CommandKey& key,
                                    bool replace) {
  std::string why;
  for (const auto& folder : folders(var)) {
    const auto file = folder / name;
    if (const auto usable = open_private_folder(folder, true, var.owner()); !usable) {
      if (why.empty()) why = usable.error().message;
      continue;
    }
    const std::string temporary = fmt::format("{}.{}", file.string(), getpid());
    const auto fd = open_private(temporary, O_WRONLY | O_CREAT | O_TRUNC, var.owner());
    const bool written =
        fd && write(fd->get(), key.data(), key.size()) == static_cast<ssize_t>(key.size()) &&
        (replace || is_no_key(file, var) ? rename(temporary.c_str(), file.c_str()) == 0
                                         : link(temporary.c_str(), file.c_str()) == 0 || errno == EEXIST);
    if (!written && why.empty())
      why = fd ? fmt::format("{}: {}", file.string(), errno_text(errno)) : fd.error().message;
    unlink(temporary.c_str());
    if (written) return {};
  }
  return Err(why);
}

/// By one process of those that ask. @param first  nullopt: a random one
Result<CommandKey, std::string> made_once(const VarPaths& var, std::string_view name,
                                          const std::optional<CommandKey>& first = std::nullopt) {
  if (const auto key = read_key(var, name)) return *key;
  CommandKey made = first.value_or(CommandKey{});
  if (!first && getrandom(made.data(), made.size(), 0) != static_cast<ssize_t>(made.size()))
    return Err("no random numbers: " + errno_text(errno));
  if (const auto written = write_key(var, name, made, false); !written) return Err(written.error());
  if (first) log::warn("{} was missing and is written again", (order_keys(var) / name).string());
  if (const auto key = read_key(var, name)) return *key;  // of another process, if that was first
  return Err(fmt::format("{}: is no key", (order_keys(var) / name).string()));
}

}  // namespace

std::filesystem::path order_keys(const VarPaths& var) {
  const auto memory = var.memory();
  if (memory == var.memory_link()) return var.root / "keys" / "orders";
  return memory.parent_path() / (var.memory_name() + std::string(order_keys_suffix));
}

std::vector<std::filesystem::path> order_keys_for(const VarPaths& var, const std::string& node) {
  std::vector<std::filesystem::path> readable;
  for (const auto& folder : folders(var)) {
    for (const auto& name : {std::string(seal_folder), folder_of(node)}) readable.push_back(folder / name);
  }
  return readable;
}

CommandKey command_key_of(const CommandKey& suite_key, std::string_view node) {
  return hmac_sha256(suite_key, as_octets(fmt::format("srfs command key of {}", node)));
}

Result<CommandKey, std::string> suite_command_key(const VarPaths& var,
                                                  const std::optional<CommandKey>& known) {
  return made_once(var, suite_file, known);
}

Result<ros::SealKey, std::string> suite_seal_key(const VarPaths& var) {
  return made_once(var, seal_file);
}

std::optional<ros::SealKey> find_seal_key(const VarPaths& var) {
  return read_key(var, seal_file);
}

Result<void, std::string> hand_out_command_key(const VarPaths& var, const std::string& node) {
  const auto there = read_key(var, file_of(node));
  if (there && !read_key(var, suite_file)) return {};  // ttc writes the suite's again
  const auto suite_key = suite_command_key(var);
  if (!suite_key) return Err(suite_key.error());
  const CommandKey key = command_key_of(*suite_key, node);
  if (there == key) return {};
  return write_key(var, file_of(node), key, true);
}

Result<CommandKey, std::string> command_key(const VarPaths& var, const std::string& node) {
  const auto made = hand_out_command_key(var, node);
  if (const auto key = read_key(var, file_of(node))) return *key;
  if (!made) return Err(made.error());
  return Err(fmt::format("{}: is no command key", (order_keys(var) / file_of(node)).string()));
}

void forget_command_keys(const VarPaths& var) {
  std::error_code ec;
  for (const auto& folder : folders(var)) std::filesystem::remove_all(folder, ec);
}

}  // namespace srfs::suite
