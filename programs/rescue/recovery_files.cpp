// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "programs/rescue/recovery_files.hpp"

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstdio>
#include <functional>
#include <memory>
#include <set>

#include <fcntl.h>
#include <fmt/format.h>
#include <fts.h>
#include <sys/stat.h>
#include <sys/statvfs.h>
#include <unistd.h>

#include "base/fd.hpp"
#include "base/file.hpp"
#include "base/log.hpp"
#include "base/sha256.hpp"
#include "base/text.hpp"
#include "base/time.hpp"
#include "cfdp/file_tree.hpp"
#include "nodes/ttc/link/link_state_file.hpp"
#include "programs/rescue/link_store.hpp"
#include "update/build_id.hpp"
#include "update/golden_manifest.hpp"
#include "update/version_store.hpp"

namespace srfs::rescue {
namespace {

namespace fs = std::filesystem;
using mission::RescuePart;
namespace failure = mission::failure;

constexpr std::size_t most_entries = 4096;  // of a folder that is looked through
constexpr std::size_t largest_manifest = 1U << 20;
constexpr const char* reserve = "set_aside/reserve";  // of VAR
constexpr off_t smallest_block = 4096;
constexpr std::size_t synced_part = 4U << 20;  // of a file that is copied
/// Folders of VAR whose files may go down. Keys lie in others, and golden copies of keys.
const std::set<std::string, std::less<>> may_leave{"log",      "state",     "store",  "files",
                                                   "versions", "set_aside", "images", "run"};
constexpr std::array operators_files{"parameters.yaml", "hold", "desired_state"};

/// Folders of VAR into which a file may be restored; in state not in the place of what stays.
const std::set<std::string, std::less<>> may_come{"log", "store", "files", "versions", "images"};
/// Folders of the installation.
const std::set<std::string, std::less<>> of_installation{"bin", "lib", "share"};

/// Links followed as far as there is something.
fs::path real(const fs::path& path) {
  std::error_code ec;
  const fs::path found = fs::weakly_canonical(path, ec);
  return ec ? path.lexically_normal() : found;
}

/// The rest of @p path below a folder; nullopt: it is not below it.
std::optional<fs::path> below(const fs::path& path, const fs::path& folder) {
  const fs::path relative = path.lexically_relative(folder);
  if (relative.empty() || relative == "." || *relative.begin() == "..") return std::nullopt;
  return relative;
}

/// MiB; nullopt: the disk does not tell.
std::optional<std::uint32_t> free_of(const fs::path& folder) {
  struct statvfs info {};
  if (statvfs(folder.c_str(), &info) != 0) return std::nullopt;
  return static_cast<std::uint32_t>(
      std::min<std::uint64_t>(info.f_bavail * info.f_frsize >> 20U, UINT32_MAX));
}

FilesFailure disk_failure(std::string text) {
  return {failure::disk_failed, std::move(text)};
}

/// Names in a folder, in order; none: there is no such folder, or it cannot be read.
std::vector<std::string> names_in(const fs::path& folder) {
  std::vector<std::string> names;
  std::error_code ec;
  for (fs::directory_iterator it(folder, ec), end; !ec && it != end && names.size() < most_entries;
       it.increment(ec))
    names.push_back(it->path().filename().string());
  std::sort(names.begin(), names.end());
  return names;
}

Result<void, std::string> sync_folder(const fs::path& folder) {
  const Fd fd(open(folder.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC));
  if (!fd || fsync(fd.get()) != 0) return Err(folder.string() + ": cannot be synced");
  return {};
}

/// Deletes a file or folder with all that is below it, file by file; what cannot be deleted stays. No link is
/// followed.
Result<void, std::string> remove_tree(const fs::path& root, const std::function<void()>& on_progress) {
  std::string path = root.string();
  std::array<char*, 2> roots{path.data(), nullptr};
  const std::unique_ptr<FTS, int (*)(FTS*)> tree(fts_open(roots.data(), FTS_PHYSICAL | FTS_NOCHDIR, nullptr),
                                                 fts_close);
  if (!tree) return Err(fmt::format("{}: cannot be deleted: {}", path, errno_text(errno)));
  std::string problem;
  while (true) {
    errno = 0;
    const FTSENT* const entry = fts_read(tree.get());
    if (entry == nullptr) break;
    on_progress();
    if (entry->fts_info == FTS_D) continue;  // comes again as FTS_DP, behind what is in it
    if (std::remove(entry->fts_accpath) != 0)
      problem = fmt::format("{}: cannot be deleted: {}", entry->fts_path, errno_text(errno));
  }
  // Not at the end of the tree, but where it could not be read any further.
  if (errno != 0) problem = fmt::format("{}: cannot be read to its end: {}", path, errno_text(errno));
  if (!problem.empty()) return Err(problem);
  return {};
}

/// The state of the nodes that a reset of it never touches: counters, keys, numbers that go up, the silence
/// of the transmitter, the fault ledger.
bool stays(const fs::path& below_state) {
  static const std::set<std::string> of_ttc{"telecommands.0", "telecommands.1", "link_state",
                                            "counters_lost",  "frame_counts",   "command_loss",
                                            "key_selection",  "transmitter"};
  const auto node = below_state.begin()->string();
  const auto name = below_state.filename().string();
  if (node == "boot" || name.starts_with("incarnation")) return true;
  if (node == "ring") return name.starts_with("faults.log");
  if (node != "ttc") return false;
  return of_ttc.contains(name) || name.starts_with("key_selection") || name.starts_with("frame_numbers");
}

struct Replacement {
  std::string sha256;  ///< of the octets that must come out; empty: whatever is there
  mode_t mode = 0644;
};

/// A regular file; nothing else is opened, and no link followed.
Fd open_plain(const fs::path& file) {
  Fd fd(open(file.c_str(), O_RDONLY | O_CLOEXEC | O_NOFOLLOW | O_NONBLOCK));
  struct stat info {};
  if (!fd || fstat(fd.get(), &info) != 0 || !S_ISREG(info.st_mode)) return Fd();
  return fd;
}

/// Puts a copy of what is open in the place of @p to: complete or not at all.
Result<void, std::string> replace_by_copy(const Fd& in, const fs::path& to, const Replacement& wanted,
                                          const std::function<void()>& on_progress) {
  if (!in || lseek(in.get(), 0, SEEK_SET) != 0)
    return Err(std::string("what is to be copied cannot be read"));
  std::error_code ec;
  fs::create_directories(to.parent_path(), ec);
  const fs::path temporary = to.string() + ".rescue";
  unlink(temporary.c_str());
  const Fd out(open(temporary.c_str(), O_WRONLY | O_CREAT | O_EXCL | O_CLOEXEC, 0600));
  if (!out) return Err(temporary.string() + ": cannot be written");
  const auto give_up = [&](const std::string& why) {
    unlink(temporary.c_str());
    return Err(why);
  };
  Sha256 digest;
  std::array<std::uint8_t, 65536> part{};
  for (std::size_t unsynced = 0;;) {
    on_progress();
    const ssize_t got = read(in.get(), part.data(), part.size());
    if (got < 0) return give_up("what is to be copied cannot be read");
    if (got == 0) break;
    const OctetView octets(part.data(), static_cast<std::size_t>(got));
    digest.update(octets);
    unsynced += octets.size();
    bool written = write(out.get(), octets.data(), octets.size()) == got;
    // Not all at the end: that could take longer than the watchdog waits.
    if (unsynced >= synced_part) {
      written = written && fdatasync(out.get()) == 0;
      unsynced = 0;
    }
    if (!written) return give_up(temporary.string() + ": no room");
  }
  if (!wanted.sha256.empty() && to_digits(digest.finish()) != wanted.sha256)
    return give_up("its golden copy is damaged, too");
  if (fchmod(out.get(), wanted.mode) != 0 || fsync(out.get()) != 0 ||
      rename(temporary.c_str(), to.c_str()) != 0)
    return give_up(to.string() + ": cannot be replaced");
  return sync_folder(to.parent_path());
}

std::optional<update::FoundFile> look_at(const fs::path& path) {
  struct stat info {};
  if (stat(path.c_str(), &info) != 0 || !S_ISREG(info.st_mode)) return std::nullopt;
  const auto digest = update::digest_of(path);
  if (!digest) return std::nullopt;
  return update::FoundFile{.sha256 = digest->sha256,
                           .octets = digest->octets,
                           .modified_ns = info.st_mtim.tv_sec * 1'000'000'000 + info.st_mtim.tv_nsec,
                           .build_id = update::build_id_of(path),
                           .settled = true};
}

std::optional<update::GoldenManifest> read_manifest(const fs::path& folder) {
  std::optional<update::GoldenManifest> newest;
  for (const char* name : {"manifest_a", "manifest_b"}) {
    const auto text = read_file(folder / name, largest_manifest);
    auto found = text ? update::decode_golden(*text) : std::nullopt;
    if (found && (!newest || found->revision > newest->revision)) newest = std::move(found);
  }
  return newest;
}

}  // namespace

// ---------------------------------------------------------------- out of the way

FilesResult<bool> RecoveryFiles::move_aside(const fs::path& relative, std::uint32_t number) const {
  const fs::path from = var_ / relative;
  const fs::path to = var_ / "set_aside" / std::to_string(number) / relative;
  struct stat info {};
  if (lstat(from.c_str(), &info) != 0) return false;
  std::error_code ec;
  fs::create_directories(to.parent_path(), ec);
  if (ec)
    return Err(disk_failure(fmt::format("{}: cannot be made: {}", to.parent_path().string(), ec.message())));
  // What was set aside in this folder before a cut keeps its place.
  fs::path free = to;
  for (int copy = 2; lstat(free.c_str(), &info) == 0 && copy < 100; ++copy)
    free = fmt::format("{}.{}", to.string(), copy);
  if (rename(from.c_str(), free.c_str()) != 0)
    return Err(disk_failure(fmt::format("{}: cannot be set aside: {}", from.string(), errno_text(errno))));
  for (const fs::path& folder : {to.parent_path(), from.parent_path()}) {
    if (const auto synced = sync_folder(folder); !synced) return Err(disk_failure(synced.error()));
  }
  return true;
}

FilesResult<std::uint32_t> RecoveryFiles::set_aside(RescuePart part, std::uint32_t number,
                                                    LinkStore& link) const {
  std::vector<fs::path> wanted;
  std::uint32_t moved = 0;
  const auto add_state = [&](const auto& wants) {
    for (const std::string& node : names_in(var_ / "state")) {
      for (const std::string& name : names_in(var_ / "state" / node)) {
        if (wants(fs::path(node) / name)) wanted.push_back(fs::path("state") / node / name);
      }
    }
  };
  switch (part) {
    case RescuePart::versions:
      wanted.emplace_back("versions");
      break;
    case RescuePart::parameters:
      add_state([](const fs::path& path) {
        return std::find(operators_files.begin(), operators_files.end(), path.filename()) !=
               operators_files.end();
      });
      break;
    case RescuePart::stores:
      wanted.emplace_back("store");
      break;
    case RescuePart::state:
      add_state([](const fs::path& path) { return !stays(path); });
      break;
    case RescuePart::schedule: {
      const auto problem = link.set_journal_aside([&](const fs::path& segment) {
        const auto done = move_aside(segment.lexically_relative(var_), number);
        moved += done && *done ? 1 : 0;
        return done ? std::string() : done.error().text;
      });
      if (!problem.empty()) return Err(disk_failure(problem));
      break;
    }
  }
  for (const fs::path& path : wanted) {
    on_progress_();
    const auto done = move_aside(path, number);
    if (!done) return Err(done.error());
    moved += *done ? 1 : 0;
  }
  return moved;
}

std::vector<std::uint32_t> RecoveryFiles::numbers_aside() const {
  std::vector<std::uint32_t> numbers;
  for (const std::string& name : names_in(var_ / "set_aside")) {
    const auto number = to_number<std::uint32_t>(name);
    if (number && *number <= highest_number && std::to_string(*number) == name) numbers.push_back(*number);
  }
  std::sort(numbers.begin(), numbers.end(), std::greater());
  return numbers;
}

std::uint32_t RecoveryFiles::next_number(std::uint32_t recorded) const {
  const auto numbers = numbers_aside();
  return std::max(recorded, numbers.empty() ? 0 : numbers.front()) + 1;
}

std::uint32_t RecoveryFiles::make_room(RoomFor what) const {
  std::vector<std::uint32_t> numbers = numbers_aside();
  std::uint32_t dropped = 0;
  const auto has_less_than = [this](std::uint32_t mib) {
    const auto free = free_of(var_);
    return free && *free < mib;
  };
  if (has_less_than(free_floor_mib)) unlink((var_ / reserve).c_str());
  const auto is_one_too_many = [&] {
    if (numbers.size() > 1) return numbers.size() >= most_set_aside || has_less_than(free_floor_mib);
    return numbers.size() == 1 && what == RoomFor::an_order && has_less_than(last_mib);
  };
  while (is_one_too_many()) {
    const fs::path oldest = var_ / "set_aside" / std::to_string(numbers.back());
    numbers.pop_back();
    if (const auto gone = remove_tree(oldest, on_progress_); !gone) {
      log::error("{}", gone.error());
      continue;
    }
    log::warn("{} was deleted: {} folders are kept, and {} MiB of the disk free", oldest.string(),
              most_set_aside, free_floor_mib);
    ++dropped;
  }
  return dropped;
}

void RecoveryFiles::keep_reserve() const {
  const fs::path file = var_ / reserve;
  std::error_code ec;
  fs::create_directories(file.parent_path(), ec);
  const Fd fd(open(file.c_str(), O_RDWR | O_CREAT | O_CLOEXEC | O_NOFOLLOW | O_NONBLOCK, 0600));
  off_t kept = 0;
  for (off_t part = reserve_octets; fd && kept < reserve_octets && part >= smallest_block; part /= 2) {
    while (kept < reserve_octets && posix_fallocate(fd.get(), kept, part) == 0) kept += part;
  }
}

std::string RecoveryFiles::use_last_good_versions() const {
  std::string problems;
  for (const std::string& node : names_in(var_ / "versions")) {
    update::PosixVersionFiles files(var_ / "versions" / node);
    update::VersionStore store(files, node);
    const auto table = store.read().table;
    if (table.active() == table.last_good()) continue;
    const auto used = store.use(table.last_good(), milliseconds(0), "the suite did not become healthy");
    if (!used) problems += used.error() + "; ";
  }
  return problems;
}

std::string RecoveryFiles::take_measures(suite::BootStep step, std::uint32_t number, LinkStore& link) const {
  if (step == suite::BootStep::last_good) return use_last_good_versions();
  if (step != suite::BootStep::golden) return "";
  std::string problems;
  for (const RescuePart part : {RescuePart::versions, RescuePart::parameters, RescuePart::schedule,
                                RescuePart::stores, RescuePart::state}) {
    if (const auto done = set_aside(part, number, link); !done) problems += done.error().text + "; ";
  }
  const auto mended = mend(Mend::damage);
  if (!mended) return problems + mended.error().text;
  if (mended->mended > 0)
    log::warn("{} damaged files were restored from their golden copies", mended->mended);
  return problems;
}

// ---------------------------------------------------------------- golden copies

FilesResult<MendCount> RecoveryFiles::mend(Mend what) const {
  const fs::path folder = var_ / "golden";
  const auto manifest = read_manifest(folder);
  if (!manifest)
    return Err(
        FilesFailure{failure::file_not_found, "no golden copies: both manifests are missing or damaged"});
  MendCount count{.files = static_cast<std::uint32_t>(manifest->files.size())};
  for (const update::GoldenFile& golden : manifest->files) {
    on_progress_();
    const auto found = look_at(golden.path);
    if (found && found->sha256 == golden.sha256) continue;
    if (what == Mend::damage && judge(golden, found) != update::ScrubVerdict::damaged) continue;
    const auto mended = replace_by_copy(
        open_plain(folder / golden.sha256), golden.path,
        {.sha256 = golden.sha256, .mode = static_cast<mode_t>(golden.mode & 07777U)}, on_progress_);
    ++(mended ? count.mended : count.left);
    if (mended) {
      log::warn("{} was restored from its golden copy", golden.path);
    } else {
      log::error("{} differs and is left: {}", golden.path, mended.error());
    }
  }
  return count;
}

// ---------------------------------------------------------------- files of the ground

bool RecoveryFiles::is_key(const fs::path& path) const {
  const auto is = [&path](const auto& association) {
    const std::string& file = association.key_file;
    std::error_code ec;
    // Key-encryption keys lie beside the others.
    if (path.extension() == ".key" && path.parent_path() == real(file).parent_path()) return true;
    return path == file || path == real(file) || fs::equivalent(path, file, ec);
  };
  return (settings_.seal && is(*settings_.seal)) ||
         std::any_of(settings_.associations.begin(), settings_.associations.end(), is);
}

bool RecoveryFiles::may_be_restored(const fs::path& path) const {
  if (is_key(path)) return false;
  if (const auto relative = below(path, real(var_))) {
    const auto folder = relative->begin()->string();
    if (std::distance(relative->begin(), relative->end()) < 2) return false;
    // Never backwards: a replaced counter would let old telecommands in.
    if (folder == "state") return !stays(relative->lexically_relative("state"));
    return may_come.contains(folder);
  }
  const fs::path beside = real(deployment_).parent_path();
  if (path == real(deployment_) || (path.parent_path() == beside && path.extension() == ".yaml")) return true;
  // A folder that others share (/usr) is not the suite's: there a golden copy must tell.
  static const std::set<fs::path> shared{"/", "/usr", "/usr/local"};
  const fs::path prefix = real(prefix_);
  const auto relative = shared.contains(prefix) ? std::nullopt : below(path, prefix);
  if (relative && of_installation.contains(relative->begin()->string())) return true;
  const auto manifest = read_manifest(var_ / "golden");
  return manifest && manifest->find(path.string()) != nullptr;
}

FilesResult<fs::path> RecoveryFiles::target_path(const std::string& target) const {
  const fs::path path(target);
  const bool plain = std::none_of(path.begin(), path.end(), [](const fs::path& part) {
    return part == ".." || part == "." || part.empty();
  });
  const FilesFailure refused{failure::not_restorable, target + ": not a file of the suite"};
  if (!plain || path.empty() || path.filename().empty()) return Err(refused);
  // Where it really is: no link leads out of the places that a restore is for.
  const fs::path whole = path.is_relative() ? var_ / path : path;
  const fs::path found = real(whole.parent_path()) / whole.filename();
  return may_be_restored(found) ? FilesResult<fs::path>(found) : Err(refused);
}

FilesResult<void> RecoveryFiles::restore(const std::string& file, const std::string& target,
                                         std::uint32_t number) const {
  const auto to = target_path(target);
  if (!to) return Err(to.error());
  const auto tree = cfdp::FileTree::open(var_ / "files");
  if (!tree) return Err(disk_failure(tree.error().message));
  const auto source = tree->open_file(file);
  if (!source) return Err(FilesFailure{failure::file_not_found, file + ": no such file"});
  struct stat old {};
  const bool exists = lstat(to->c_str(), &old) == 0;
  if (exists && !S_ISREG(old.st_mode))
    return Err(FilesFailure{failure::not_a_file, to->string() + ": not a file"});
  if (exists) {
    const fs::path kept =
        var_ / "set_aside" / std::to_string(number) /
        (fs::path(target).is_relative() ? fs::path(target) : fs::path(target).relative_path());
    if (const auto copied =
            replace_by_copy(open_plain(*to), kept, {.sha256 = "", .mode = 0600}, on_progress_);
        !copied)
      return Err(disk_failure(copied.error()));
  }
  // A program stays one; a new file below bin/ or in a version store is one.
  const bool program = exists ? (old.st_mode & 0111U) != 0 : to->parent_path().filename() == "bin";
  const mode_t mode = exists ? old.st_mode & 07777U : program ? 0755 : 0644;
  const auto replaced = replace_by_copy(source->fd, *to, {.sha256 = "", .mode = mode}, on_progress_);
  if (!replaced) return Err(disk_failure(replaced.error()));
  log::warn("{} was replaced by {}", to->string(), file);
  return {};
}

FilesResult<std::string> RecoveryFiles::fetch(const std::string& path) const {
  if (path.empty() || !may_leave.contains(fs::path(path).begin()->string()))
    return Err(FilesFailure{failure::not_restorable, path + ": is not fetched"});
  const auto tree = cfdp::FileTree::open(var_);
  if (!tree) return Err(disk_failure(tree.error().message));
  const auto file = tree->open_file(path);
  if (!file) return Err(FilesFailure{failure::file_not_found, path + ": no such file"});
  struct stat info {};
  if (fstat(file->fd.get(), &info) != 0 || !S_ISREG(info.st_mode))
    return Err(FilesFailure{failure::not_a_file, path + ": not a file"});
  if (static_cast<std::uint64_t>(info.st_size) > largest_fetched)
    return Err(FilesFailure{failure::no_space, path + ": too large"});
  std::string name = path;
  std::replace(name.begin(), name.end(), '/', '_');
  // A file that changes while it is sent is not sent: a copy goes down.
  const auto copied =
      replace_by_copy(file->fd, var_ / "files" / "outbox" / name, {.sha256 = "", .mode = 0600}, on_progress_);
  if (!copied) return Err(disk_failure(copied.error()));
  return name;
}

FilesResult<std::vector<Octets>> RecoveryFiles::list(const std::string& folder) const {
  const auto tree = cfdp::FileTree::open(var_);
  if (!tree) return Err(disk_failure(tree.error().message));
  const auto page = tree->list(folder, "", most_listed);
  if (!page) return Err(FilesFailure{failure::file_not_found, folder + ": no such folder"});
  std::vector<Octets> reports;
  mission::RepositorySummary summary;
  summary.repository = folder;
  summary.total = page->total;
  for (std::size_t i = 0; i < page->entries.size(); ++i) {
    const cfdp::FolderEntry& entry = page->entries[i];
    summary.objects = 1;
    summary.object = entry.kind == cfdp::EntryKind::file     ? mission::FileObject::file
                     : entry.kind == cfdp::EntryKind::folder ? mission::FileObject::folder
                                                             : mission::FileObject::other;
    summary.object_name = entry.name;
    summary.octets = entry.octets;
    summary.left = static_cast<std::uint32_t>(page->entries.size() - i - 1) + page->left;
    reports.push_back(summary.encoded());
  }
  if (reports.empty()) reports.push_back(summary.encoded());
  return reports;
}

std::uint32_t RecoveryFiles::free_mib() const {
  return free_of(var_).value_or(0);
}

}  // namespace srfs::rescue
