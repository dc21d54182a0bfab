// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "suite/state_files.hpp"

#include <fmt/format.h>

#include "base/file.hpp"
#include "base/log.hpp"
#include "suite/node_versions.hpp"

namespace srfs::suite {
namespace {

constexpr std::string_view unreadable = ".unreadable";
constexpr std::string_view unfinished = ".new";

}  // namespace

std::filesystem::path snapshot_folder(const VarPaths& var, const std::string& node,
                                      update::VersionNumber version) {
  return versions_folder(var, node) / update::VersionStore::state_of(version);
}

Result<void, std::string> snapshot_state(const VarPaths& var, const std::string& node,
                                         update::VersionNumber version) {
  const std::filesystem::path folder = snapshot_folder(var, node, version);
  const std::filesystem::path copy = folder.string() + std::string(unfinished);
  std::error_code ec;
  std::filesystem::remove_all(copy, ec);
  std::filesystem::create_directories(copy, ec);
  if (ec) return Err(fmt::format("{}: {}", copy.string(), ec.message()));
  std::uint64_t octets = 0;
  std::size_t files = 0;
  for (std::filesystem::directory_iterator it(var.state(node), ec), end; !ec && it != end; it.increment(ec)) {
    std::error_code ignored;
    const std::string name = it->path().filename().string();
    if (it->is_symlink(ignored) || !it->is_regular_file(ignored) || name.ends_with(unreadable)) continue;
    const auto content = read_file(it->path(), largest_snapshot - octets);
    if (!content || files == most_snapshot_files) {
      log::warn("{} is left out of the state snapshot", it->path().string());
      continue;
    }
    if (const auto written = write_file_atomically(copy / name, *content); !written)
      return Err(written.error().message);
    octets += content->size();
    ++files;
  }
  // A power loss in between leaves no snapshot, which costs a default value, not a node.
  std::filesystem::remove_all(folder, ec);
  std::filesystem::rename(copy, folder, ec);
  if (ec) return Err(fmt::format("{}: {}", folder.string(), ec.message()));
  return {};
}

void set_aside_unreadable(const std::filesystem::path& file) {
  std::error_code ec;
  std::filesystem::rename(file, file.string() + std::string(unreadable), ec);
  if (ec) {
    log::error("{} is unusable and cannot be set aside: {}", file.string(), ec.message());
  } else {
    log::error("{} is unusable for this version; set aside as {}{}", file.string(), file.filename().string(),
               unreadable);
  }
}

std::optional<std::string> read_state_file(const VarPaths& var, const std::string& node,
                                           const std::string& name, std::size_t limit, TakenBack taken_back,
                                           const std::function<bool(const std::string&)>& usable) {
  const std::filesystem::path file = var.state(node) / name;
  std::error_code ec;
  if (!std::filesystem::exists(file, ec)) return std::nullopt;
  if (auto content = read_file(file, limit); content && usable(*content)) return std::move(*content);
  set_aside_unreadable(file);
  if (taken_back == TakenBack::never) return std::nullopt;
  const auto version = read_versions(var, node).table.active();
  auto copy = read_file(snapshot_folder(var, node, version) / name, limit);
  if (!copy || !usable(*copy)) return std::nullopt;
  log::warn("{}: restored as version {} left it", file.string(), version);
  if (const auto written = write_file_atomically(file, *copy); !written)
    log::error("{}", written.error().message);
  return std::move(*copy);
}

}  // namespace srfs::suite
