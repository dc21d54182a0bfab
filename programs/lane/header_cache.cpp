// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
// CACHE/KEY/: node.hpp, node.hpp.gch, and `stamps`: what the header was made of. A folder appears whole, by
// rename.

#include <algorithm>
#include <string_view>

#include <fcntl.h>
#include <fmt/format.h>
#include <fmt/ranges.h>
#include <sys/stat.h>
#include <unistd.h>

#include "base/file.hpp"
#include "base/sha256.hpp"
#include "base/text.hpp"
#include "lane.hpp"

namespace srfs::lane {
namespace {

namespace fs = std::filesystem;
using namespace update;

constexpr std::size_t headers_kept = 1;              // hundreds of MiB each
constexpr std::uint64_t header_octets = 768U << 20;  // in the work folder
constexpr std::uint64_t header_memory = 2ULL << 30;  // with the work folder
constexpr std::size_t stamp_octets = 4U << 20;

/// "SIZE MTIME_NS PATH": another one as soon as the file is another. Empty: there is none.
std::string stamp_of(const std::string& path) {
  struct stat status {};
  if (stat(path.c_str(), &status) != 0) return {};
  return fmt::format("{} {}.{:09} {}\n", status.st_size, status.st_mtim.tv_sec, status.st_mtim.tv_nsec, path);
}

std::string digest_of(const std::string& text) {
  return to_digits(sha256_of(as_octets(text)));
}

std::string stamps_of(const std::vector<std::string>& files) {
  std::string stamps;
  for (const std::string& file : files) stamps += stamp_of(file);
  return stamps;
}

/// Nothing of what it was made of has changed.
bool is_fresh(const fs::path& folder) {
  const auto stamps = read_file(folder / "stamps", stamp_octets);
  if (!stamps || access((folder / "node.hpp.gch").c_str(), R_OK) != 0) return false;
  std::string_view rest = *stamps;
  while (!rest.empty()) {
    const std::string_view line = rest.substr(0, rest.find('\n') + 1);
    const std::size_t path = line.find(' ', line.find(' ') + 1) + 1;
    if (line.empty() || stamp_of(std::string(line.substr(path, line.size() - path - 1))) != line)
      return false;
    rest.remove_prefix(line.size());
  }
  return !stamps->empty();
}

void remove_old(const fs::path& headers, const fs::path& kept) {
  std::vector<std::pair<fs::file_time_type, fs::path>> others;
  std::error_code ec;
  for (const auto& entry : fs::directory_iterator(headers, ec))
    if (entry.path() != kept) others.emplace_back(entry.last_write_time(ec), entry.path());
  std::sort(others.rbegin(), others.rend());
  for (std::size_t i = headers_kept - 1; i < others.size(); ++i) fs::remove_all(others[i].second, ec);
}

}  // namespace

std::optional<fs::path> precompiled_header(const Lane& lane, const std::vector<std::string>& options) {
  // The work folder's path is in the flags, but it means nothing for the header.
  const Command command = plan_header(lane.installation, options, lane.job());
  const std::string identity =
      stamp_of(fs::canonical(compiler)) + header_text() + fmt::format("{}", fmt::join(command.words, "\n"));
  const fs::path headers = lane.work / "headers";
  const fs::path folder = headers / digest_of(identity);
  if (is_fresh(folder)) return folder / "node.hpp";

  Confinement confinement = lane.confinement;
  confinement.limits.file_octets = header_octets;
  confinement.limits.work_octets = header_octets;
  confinement.limits.memory_octets = std::max(confinement.limits.memory_octets, header_memory);
  const auto work = WorkFolder::make(lane.job(), confinement);
  if (!work || work->put("node.hpp", header_text()) || mkdirat(work->fd(), "src", 0755) != 0)
    return std::nullopt;
  say(command.title);
  HeadAndTail log(2048);
  const auto ended = run_confined(
      confinement, *work, [&] { return execute(command.words, work->path()); },
      {.output = {}, .log = [&](std::string_view text) { log.append(text); }, .cancel_fd = lane.cancel_fd});
  if (!ended || ended->exit_code != 0 || ended->stop != Ended::Stop::none) {
    say(fmt::format("precompile failed: {}: {}", ended ? describe(*ended) : ended.error().message,
                    log.text()));
    return std::nullopt;
  }
  const auto compiled = work->take("node.hpp.gch", header_octets);
  const auto rule = work->take("node.d", stamp_octets);
  if (!compiled || !rule) return std::nullopt;

  std::error_code ec;
  const fs::path growing = headers / "new";
  fs::remove_all(growing, ec);
  fs::create_directories(growing, ec);
  if (!store(compiled->get(), growing / "node.hpp.gch", false) ||
      !store(rule->get(), growing / "rule", false))
    return std::nullopt;
  const auto rule_text = read_file(growing / "rule", stamp_octets);
  std::vector<std::string> files = rule_text ? files_of_rule(*rule_text) : std::vector<std::string>();
  // Its own text is part of the folder's name.
  std::erase_if(files, [&](const std::string& file) { return file.starts_with(lane.job().string() + "/"); });
  const std::string stamps = stamps_of(files);
  if (stamps.empty() || !write_file_atomically(growing / "node.hpp", header_text()) ||
      !write_file_atomically(growing / "stamps", stamps))
    return std::nullopt;
  fs::remove(growing / "rule", ec);
  fs::remove_all(folder, ec);
  fs::rename(growing, folder, ec);
  if (ec) return std::nullopt;
  remove_old(headers, folder);
  return folder / "node.hpp";
}

}  // namespace srfs::lane
