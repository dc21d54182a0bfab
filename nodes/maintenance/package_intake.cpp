// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "nodes/maintenance/package_intake.hpp"

#include <algorithm>
#include <cerrno>

#include <fcntl.h>
#include <fmt/format.h>
#include <sys/stat.h>
#include <unistd.h>

#include <mission/structures.hpp>

#include "base/sha256.hpp"
#include "cfdp/rooted_path.hpp"
#include "suite/node_versions.hpp"
#include "update/package_keys.hpp"

namespace srfs {
namespace {

Result<Octets, IntakeFailure> read_package(const std::filesystem::path& root, const std::string& name) {
  const auto missing = [&](std::string_view why) {
    return Err(IntakeFailure{mission::failure::package_not_found, fmt::format("{}: {}", name, why)});
  };
  const Fd folder(open(root.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC));
  if (!folder) return missing(errno_text(errno));
  const auto place = cfdp::locate(folder.get(), name);
  if (!place) return missing(cfdp::to_string(place.error()));
  const Fd file(
      openat(place->folder.get(), place->name.c_str(), O_RDONLY | O_NOFOLLOW | O_NONBLOCK | O_CLOEXEC));
  if (!file) return missing(errno_text(errno));
  struct stat status {};
  if (fstat(file.get(), &status) != 0) return missing(errno_text(errno));
  if (!S_ISREG(status.st_mode)) return missing("not a regular file");
  if (static_cast<std::uint64_t>(status.st_size) > update::PackageLimits::package_octets)
    return Err(IntakeFailure{mission::failure::package_refused,
                             fmt::format("{}: {}", to_text(update::PackageRefusal::too_large), name)});
  Octets content(static_cast<std::size_t>(status.st_size));
  std::size_t done = 0;
  while (done < content.size()) {
    const ssize_t n = read(file.get(), content.data() + done, content.size() - done);
    if (n < 0 && errno == EINTR) continue;
    if (n <= 0) return missing(n < 0 ? errno_text(errno) : "it shrank while it was read");
    done += static_cast<std::size_t>(n);
  }
  return content;
}

}  // namespace

Result<Intake, IntakeFailure> take_in_package(const IntakeRules& rules, const std::string& file,
                                              const update::UpdateJournal& journal,
                                              const LaneFolders& folders) {
  const auto refusal = [](std::string reason) {
    return Err(IntakeFailure{mission::failure::package_refused, std::move(reason)});
  };
  const auto key = update::load_public_key(rules.public_key);
  if (!key) return refusal("no verification key: " + key.error().message);
  const auto content = read_package(rules.files, file);
  if (!content) return Err(content.error());
  const std::string sha256 = to_digits(sha256_of(*content));
  const auto package = update::verify_package(
      *content, *key, [&](std::string_view node) { return journal.last_counter(node, sha256); });
  if (!package) return refusal(to_text(package.error()));
  const update::Manifest& manifest = package->manifest;
  const bool is_there = std::find(rules.nodes.begin(), rules.nodes.end(), manifest.node) != rules.nodes.end();
  if (manifest.kind == update::PackageKind::replace && !is_there)
    return refusal(fmt::format("there is no node '{}' to replace", manifest.node));
  if (manifest.kind == update::PackageKind::add && is_there)
    return refusal(fmt::format("there is already a node '{}'", manifest.node));

  std::error_code ec;
  std::filesystem::remove_all(folders.work, ec);
  std::filesystem::create_directories(folders.work, ec);
  if (!ec) std::filesystem::create_directories(folders.lane, ec);
  if (ec) return refusal(fmt::format("{}: {}", folders.work.string(), ec.message()));
  if (const auto unpacked = update::unpack(*package, folders.sources()); !unpacked)
    return refusal(unpacked.error().message);

  Intake intake;
  intake.manifest = manifest;
  for (std::size_t i = 0; i < manifest.files.size(); ++i) {
    if (manifest.files[i].path != manifest.dictionary) continue;
    const auto& text = package->contents[i];
    intake.dictionary.assign(text.begin(), text.end());
  }
  intake.update.file = file;
  intake.update.sha256 = sha256;
  intake.update.node = manifest.node;
  intake.update.kind = manifest.kind;
  intake.update.counter = manifest.counter;
  intake.update.probation = manifest.probation;
  // Of a node that the operator has to confirm the package cannot shorten the time for it.
  if (suite::needs_confirmation(rules.ring, manifest.node)) {
    intake.update.probation = std::max(
        manifest.probation, std::chrono::ceil<seconds>(suite::default_probation(rules.ring, manifest.node)));
  }
  intake.update.octets = content->size();
  return intake;
}

}  // namespace srfs
