// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "nodes/maintenance/scrub_list.hpp"

#include <algorithm>

#include <fmt/format.h>

#include "suite/node_versions.hpp"

namespace srfs {
namespace {

using std::filesystem::path;
using update::ScrubFile;
using update::ScrubKind;

constexpr std::size_t longest_path = 80;
constexpr std::size_t longest_build = 40;

/// The ordinary files of a folder that @p is_meant; links to them are not.
template <class Predicate>
void add_files(std::vector<ScrubFile>& files, const path& folder, ScrubKind kind, Predicate is_meant) {
  std::error_code ec;
  for (std::filesystem::directory_iterator it(folder, ec), end; !ec && it != end; it.increment(ec)) {
    std::error_code ignored;
    if (it->is_symlink(ignored) || !it->is_regular_file(ignored) || !is_meant(it->path())) continue;
    files.push_back({it->path(), kind, {}});
  }
}

template <class T>
T limited(std::uint64_t value) {
  return static_cast<T>(std::min<std::uint64_t>(value, std::numeric_limits<T>::max()));
}

}  // namespace

std::vector<ScrubFile> files_to_scrub(const suite::Deployment& deployment, const suite::VarPaths& var,
                                      const Installation& installation) {
  std::vector<ScrubFile> files;
  files.push_back({deployment.file, ScrubKind::text, {}});
  for (const auto& file : deployment.extended) files.push_back({file, ScrubKind::text, {}});
  add_files(files, installation.bin_folder, ScrubKind::program, [](const path& file) {
    const auto name = file.filename();
    return name == "srfs" || name == "srfs-lane" || name == "srfs-starter" || name == "srfs_rescue";
  });
  for (const suite::NodeEntry& node : deployment.nodes) {
    if (!node.executable.empty())  // an added node has its programs in the version store alone
      files.push_back({installation.bin_folder / node.executable, ScrubKind::program, {}});
    const auto versions = suite::read_versions(var, node.name);
    for (const update::Version& version : versions.table.versions()) {
      files.push_back(
          {suite::versions_folder(var, node.name) / fmt::format("{}.{}", node.name, version.number),
           ScrubKind::version, version.sha256});
    }
  }
  add_files(files, installation.library_folder, ScrubKind::program, [](const path& file) {
    const std::string name = file.filename().string();
    return name.starts_with("libsrfs_") && name.find(".so") != std::string::npos;
  });
  for (const path& file : installation.dictionary) files.push_back({file, ScrubKind::text, {}});
  add_files(files, var.root / "keys", ScrubKind::text, [](const path& file) {
    return !file.filename().string().starts_with('.') && file.extension() != ".mend";
  });
  for (ScrubFile& file : files) {
    std::error_code ec;
    const path real = std::filesystem::weakly_canonical(file.path, ec);
    file.path = ec ? std::filesystem::absolute(file.path) : real;
  }
  const auto by_path = [](const ScrubFile& a, const ScrubFile& b) { return a.path < b.path; };
  std::stable_sort(files.begin(), files.end(), by_path);
  const auto same = [](const ScrubFile& a, const ScrubFile& b) { return a.path == b.path; };
  files.erase(std::unique(files.begin(), files.end(), same), files.end());
  return files;
}

mission::ScrubStatusHousekeeping to_mission(const update::ScrubStatus& status) {
  mission::ScrubStatusHousekeeping line;
  line.rounds = status.rounds;
  line.running = status.running;
  line.files = limited<std::uint16_t>(status.files);
  line.checked = limited<std::uint16_t>(status.checked);
  line.octets = status.octets;
  line.damaged = status.damaged;
  line.mended = status.mended;
  line.lost = limited<std::uint16_t>(status.lost);
  line.unmended = limited<std::uint16_t>(status.unmended);
  line.last_round_s =
      static_cast<std::uint64_t>(std::max<std::int64_t>(status.last_round.ns() / 1'000'000'000, 0));
  line.build = status.build.substr(0, longest_build);
  line.last_damaged = end_of(status.last_damaged, longest_path);
  return line;
}

std::string end_of(const std::string& path, std::size_t most) {
  return path.size() <= most ? path : path.substr(path.size() - most);
}

}  // namespace srfs
