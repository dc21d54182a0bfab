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
#include <sys/stat.h>
#include <unistd.h>

#include "base/log.hpp"
#include "base/octets.hpp"
#include "base/private_file.hpp"
#include "base/random_octets.hpp"
#include "base/sha256.hpp"
#include "base/text.hpp"

namespace srfs::suite {
namespace {

constexpr std::string_view suite_file = "command_key";
constexpr std::string_view seal_folder = "seal";
constexpr std::string_view seal_file = "seal/seal_key";
constexpr std::size_t largest_file = 1U << 20;  // what is larger is unreadable

constexpr std::string_view node_folder = "of_";

std::string folder_of(const std::string& node) {
  return std::string(node_folder) + node;
}

std::string file_of(const std::string& node) {
  return folder_of(node) + "/command_key";
}

/// Where memory takes none: on VAR's disk, among the keys that only ttc may read.
std::array<std::filesystem::path, 2> folders(const VarPaths& var) {
  return {order_keys(var), var.root / "keys" / "orders"};
}

/// A folder of another user is as good as none.
bool is_of_another(const std::filesystem::path& folder, const VarPaths& var) {
  struct stat status {};
  if (lstat(folder.c_str(), &status) != 0) return false;
  return status.st_uid != geteuid() && !(geteuid() == 0 && status.st_uid == var.owner());
}

/// What a key's file is. Only one that is missing or damaged may be made anew: one that this process cannot
/// read now may be good, and others may have it.
enum class KeyFile : std::uint8_t { good, missing, damaged, unreadable };

template <std::size_t octets>
struct KeyReading {
  KeyFile file = KeyFile::missing;
  std::array<std::uint8_t, octets> key{};
  std::string why = {};  ///< of one that is unreadable
};

template <std::size_t octets>
KeyReading<octets> read_in(const std::filesystem::path& file, const VarPaths& var) {
  struct stat status {};
  if (lstat(file.c_str(), &status) != 0 && (errno == ENOENT || errno == ENOTDIR)) return {};
  const auto content = read_private(file, largest_file, var.owner());
  if (!content) return {KeyFile::unreadable, {}, content.error().message};
  KeyReading<octets> reading{KeyFile::damaged};
  if (content->size() != octets) return reading;
  std::copy(content->begin(), content->end(), reading.key.begin());
  reading.file = KeyFile::good;
  return reading;
}

/// The first good one; without one what speaks most against making another.
template <std::size_t octets = CommandKey{}.size()>
KeyReading<octets> read_key(const VarPaths& var, std::string_view name) {
  KeyReading<octets> found;
  for (const auto& folder : folders(var)) {
    if (is_of_another(folder, var)) continue;
    auto reading = read_in<octets>(folder / name, var);
    if (reading.file == KeyFile::good) return reading;
    if (reading.file > found.file) found = std::move(reading);
  }
  return found;
}

std::optional<CommandKey> find_key(const VarPaths& var, std::string_view name) {
  const auto reading = read_key(var, name);
  return reading.file == KeyFile::good ? std::optional(reading.key) : std::nullopt;
}

/// One that was cut short, or is something else.
bool is_no_key(const std::filesystem::path& file, const VarPaths& var) {
  return read_in<CommandKey{}.size()>(file, var).file == KeyFile::damaged;
}

/// Whole or not at all. @param replace  else one that is there stays, if it is a key
Result<void, std::string> write_key(const VarPaths& var, std::string_view name, OctetView key, bool replace) {
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
  const auto there = read_key(var, name);
  if (there.file == KeyFile::good) return there.key;
  if (there.file == KeyFile::unreadable) return Err(there.why);
  const auto made = first ? Result<CommandKey, std::string>(*first) : random_key();
  if (!made) return Err(made.error());
  if (const auto written = write_key(var, name, *made, false); !written) return Err(written.error());
  if (first) log::warn("{} was missing and is written again", (order_keys(var) / name).string());
  if (const auto key = find_key(var, name)) return *key;  // of another process, if that was first
  return Err(fmt::format("{}: is no key", (order_keys(var) / name).string()));
}

// ---------------------------------------------------------------- of uplinked nodes

std::string seal_file_of(const std::string& node) {
  return folder_of(node) + "/seal_key";
}

/// The node's own, and behind it the one that uplinked nodes share.
using LimitedKeys = std::array<std::uint8_t, 64>;

LimitedKeys limited_keys(const ros::SealKey& suite_key, const std::string& node) {
  LimitedKeys keys{};
  const auto own = ros::limited_seal_key(suite_key, node);
  const auto shared = ros::seal_key_among_limited(suite_key);
  std::copy(shared.begin(), shared.end(), std::copy(own.begin(), own.end(), keys.begin()));
  return keys;
}

Result<void, std::string> write_limited_keys(const VarPaths& var, const ros::SealKey& suite_key,
                                             const std::string& node) {
  const LimitedKeys keys = limited_keys(suite_key, node);
  const auto there = read_key<LimitedKeys{}.size()>(var, seal_file_of(node));
  if (there.file == KeyFile::good && there.key == keys) return {};
  return write_key(var, seal_file_of(node), keys, true);
}

/// The suite's was made anew: who has one of the old key cannot derive another.
void renew_limited_keys(const VarPaths& var, const ros::SealKey& suite_key) {
  for (const auto& folder : folders(var)) {
    std::error_code ec;
    for (const auto& entry : std::filesystem::directory_iterator(folder, ec)) {
      const std::string name = entry.path().filename();
      if (!name.starts_with(node_folder) || !std::filesystem::exists(entry.path() / "seal_key", ec)) continue;
      const std::string node = name.substr(node_folder.size());
      if (const auto written = write_limited_keys(var, suite_key, node); !written)
        log::error("no key for the datagrams of {}: {}", node, written.error());
    }
  }
}

}  // namespace

std::filesystem::path order_keys(const VarPaths& var) {
  const auto memory = var.memory();
  if (memory == var.memory_link()) return var.root / "keys" / "orders";
  return memory.parent_path() / (var.memory_name() + std::string(order_keys_suffix));
}

std::vector<std::filesystem::path> order_keys_for(const VarPaths& var, const std::string& node,
                                                  bool uplinked) {
  std::vector<std::filesystem::path> readable;
  for (const auto& folder : folders(var)) {
    readable.push_back(folder / folder_of(node));
    if (!uplinked) readable.push_back(folder / seal_folder);
  }
  return readable;
}

Result<std::array<std::uint8_t, 32>, std::string> random_key() {
  std::array<std::uint8_t, 32> key{};
  if (!fill_random(key)) return Err("no random numbers: " + errno_text(errno));
  return key;
}

CommandKey command_key_of(const CommandKey& suite_key, std::string_view node) {
  return hmac_sha256(suite_key, as_octets(fmt::format("srfs command key of {}", node)));
}

Result<CommandKey, std::string> suite_command_key(const VarPaths& var,
                                                  const std::optional<CommandKey>& known) {
  return made_once(var, suite_file, known);
}

Result<ros::SealKey, std::string> suite_seal_key(const VarPaths& var,
                                                 const std::optional<ros::SealKey>& known) {
  return made_once(var, seal_file, known);
}

std::optional<ros::SealKey> find_seal_key(const VarPaths& var) {
  return find_key(var, seal_file);
}

Result<void, std::string> hand_out_seal_key(const VarPaths& var, const std::string& node, bool uplinked) {
  const auto suite_key = suite_seal_key(var);
  if (!suite_key) return Err(suite_key.error());
  renew_limited_keys(var, *suite_key);
  if (uplinked) return write_limited_keys(var, *suite_key, node);
  std::error_code ec;
  for (const auto& folder : folders(var)) std::filesystem::remove(folder / seal_file_of(node), ec);
  return {};
}

Result<ros::SealKeys, std::string> seal_keys(const VarPaths& var, const std::string& node) {
  const auto made = suite_seal_key(var);
  if (made) return ros::SealKeys{*made};
  if (const auto found = find_seal_keys(var, node)) return *found;
  return Err(made.error());
}

std::optional<ros::SealKeys> find_seal_keys(const VarPaths& var, const std::string& node) {
  if (const auto suite_key = find_seal_key(var)) return ros::SealKeys{*suite_key};
  const auto own = read_key<LimitedKeys{}.size()>(var, seal_file_of(node));
  if (own.file != KeyFile::good) return std::nullopt;
  ros::SealKeys keys{{}, node, {}};
  const auto* shared = own.key.begin() + keys.key.size();
  std::copy(own.key.begin(), shared, keys.key.begin());
  std::copy(shared, own.key.end(), keys.among_limited.begin());
  return keys;
}

Result<void, std::string> hand_out_command_key(const VarPaths& var, const std::string& node) {
  const auto there = find_key(var, file_of(node));
  if (there && !find_key(var, suite_file)) return {};  // ttc writes the suite's again
  const auto suite_key = suite_command_key(var);
  if (!suite_key) return Err(suite_key.error());
  const CommandKey key = command_key_of(*suite_key, node);
  if (there == key) return {};
  return write_key(var, file_of(node), key, true);
}

Result<CommandKey, std::string> command_key(const VarPaths& var, const std::string& node) {
  const auto made = hand_out_command_key(var, node);
  if (const auto key = find_key(var, file_of(node))) return *key;
  if (!made) return Err(made.error());
  return Err(fmt::format("{}: is no command key", (order_keys(var) / file_of(node)).string()));
}

void forget_command_keys(const VarPaths& var) {
  std::error_code ec;
  for (const auto& folder : folders(var)) std::filesystem::remove_all(folder, ec);
}

}  // namespace srfs::suite
