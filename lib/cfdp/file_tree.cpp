// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "cfdp/file_tree.hpp"

#include <algorithm>
#include <cerrno>
#include <memory>
#include <queue>

#include <dirent.h>
#include <fcntl.h>
#include <fmt/format.h>
#include <sys/stat.h>
#include <unistd.h>

#include "cfdp/rooted_path.hpp"

namespace srfs::cfdp {
namespace {

constexpr mode_t folder_mode = 0755;

tl::unexpected<FileFault> system_fault() {
  return Err(fault_of(errno));
}

FileStamp to_stamp(const struct stat& s) {
  return {.octets = static_cast<std::uint64_t>(s.st_size),
          .inode = s.st_ino,
          .modified_ns = std::int64_t{s.st_mtim.tv_sec} * 1'000'000'000 + s.st_mtim.tv_nsec};
}

FolderEntry look_at(int folder, const std::string& name) {
  FolderEntry entry{.name = name, .kind = EntryKind::other};
  struct stat s {};
  if (fstatat(folder, name.c_str(), &s, AT_SYMLINK_NOFOLLOW) != 0) return entry;  // gone meanwhile
  if (S_ISDIR(s.st_mode)) entry.kind = EntryKind::folder;
  if (S_ISREG(s.st_mode)) {
    entry.kind = EntryKind::file;
    entry.octets = static_cast<std::uint64_t>(s.st_size);
  }
  return entry;
}

}  // namespace

FileResult<std::size_t> read_at(int fd, std::uint64_t offset, std::span<std::uint8_t> into) {
  std::size_t done = 0;
  while (done < into.size()) {
    const ssize_t n = pread(fd, into.data() + done, into.size() - done, static_cast<off_t>(offset + done));
    if (n < 0 && errno == EINTR) continue;
    if (n < 0) return system_fault();
    if (n == 0) break;
    done += static_cast<std::size_t>(n);
  }
  return done;
}

FileResult<FileStamp> stamp_of(int fd) {
  struct stat s {};
  if (fstat(fd, &s) != 0) return system_fault();
  if (!S_ISREG(s.st_mode)) return Err(S_ISDIR(s.st_mode) ? FileFault::not_a_file : FileFault::bad_name);
  return to_stamp(s);
}

Result<FileTree, FileError> FileTree::open(const std::filesystem::path& root) {
  Fd fd(::open(root.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC));
  if (!fd) {
    return Err(FileError{fmt::format("{}: cannot open the folder: {}", root.string(), errno_text(errno))});
  }
  return FileTree(std::move(fd));
}

FileResult<FolderPage> FileTree::list(std::string_view folder, std::string_view after,
                                      std::size_t most) const {
  auto opened = open_folder(root_.get(), folder);
  if (!opened) return Err(opened.error());
  const int fd = opened->get();
  const std::unique_ptr<DIR, int (*)(DIR*)> entries(fdopendir(fd), closedir);
  if (!entries) return system_fault();
  static_cast<void>(opened->release());  // closed with the stream

  FolderPage page;
  std::uint32_t behind_after = 0;
  std::priority_queue<std::string> first;  // the names that are wanted; the last of them on top
  errno = 0;
  while (const dirent* entry = readdir(entries.get())) {
    const std::string_view name = entry->d_name;
    if (name.front() == '.') continue;
    if (page.total == entries_max) break;
    ++page.total;
    if (name <= after && !after.empty()) continue;
    ++behind_after;
    first.emplace(name);
    if (first.size() > most) first.pop();
    errno = 0;
  }
  if (errno != 0 && page.total < entries_max) return system_fault();
  page.left = behind_after - static_cast<std::uint32_t>(first.size());
  for (; !first.empty(); first.pop()) page.entries.push_back(look_at(fd, first.top()));
  std::reverse(page.entries.begin(), page.entries.end());
  return page;
}

FileResult<OpenFile> FileTree::open_file(std::string_view name) const {
  // What it is, before it is opened: opening a device may already do something.
  if (const auto found = stamp(name); !found) return Err(found.error());
  const auto place = locate(root_.get(), name);
  if (!place) return Err(place.error());
  Fd fd(openat(place->folder.get(), place->name.c_str(),
               O_RDONLY | O_NOFOLLOW | O_CLOEXEC | O_NONBLOCK | O_NOCTTY));
  if (!fd) return system_fault();
  const auto stamp = stamp_of(fd.get());
  if (!stamp) return Err(stamp.error());
  return OpenFile{.fd = std::move(fd), .stamp = *stamp};
}

FileResult<FileStamp> FileTree::stamp(std::string_view name) const {
  const auto place = locate(root_.get(), name);
  if (!place) return Err(place.error());
  struct stat s {};
  if (fstatat(place->folder.get(), place->name.c_str(), &s, AT_SYMLINK_NOFOLLOW) != 0) return system_fault();
  if (S_ISLNK(s.st_mode)) return Err(FileFault::bad_name);
  if (!S_ISREG(s.st_mode)) return Err(FileFault::not_a_file);
  return to_stamp(s);
}

FileResult<void> FileTree::remove_file(std::string_view name) const {
  const auto place = locate(root_.get(), name);
  if (!place) return Err(place.error());
  if (unlinkat(place->folder.get(), place->name.c_str(), 0) != 0) return system_fault();
  if (fsync(place->folder.get()) != 0) return system_fault();
  return {};
}

FileResult<void> FileTree::make_folder(std::string_view name) const {
  const auto place = locate(root_.get(), name);
  if (!place) return Err(place.error());
  if (mkdirat(place->folder.get(), place->name.c_str(), folder_mode) != 0) {
    if (errno != EEXIST) return system_fault();
    const auto there = open_folder(root_.get(), name);
    if (!there) return Err(there.error());
    return {};
  }
  if (fsync(place->folder.get()) != 0) return system_fault();
  return {};
}

FileResult<void> FileTree::remove_folder(std::string_view name) const {
  const auto place = locate(root_.get(), name);
  if (!place) return Err(place.error());
  if (unlinkat(place->folder.get(), place->name.c_str(), AT_REMOVEDIR) != 0) return system_fault();
  if (fsync(place->folder.get()) != 0) return system_fault();
  return {};
}

}  // namespace srfs::cfdp
