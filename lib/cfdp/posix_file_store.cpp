// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "cfdp/posix_file_store.hpp"

#include <algorithm>
#include <cerrno>
#include <utility>

#include <fcntl.h>
#include <fmt/format.h>
#include <sys/stat.h>
#include <sys/statvfs.h>
#include <unistd.h>

#include "base/text.hpp"
#include "cfdp/file_tree.hpp"

namespace srfs::cfdp {
namespace {

constexpr std::size_t open_files_max = 16;
constexpr auto temporaries_name = ".cfdp";

tl::unexpected<FileFault> system_fault() {
  return Err(fault_of(errno));
}

FileStamp stamp_of(const struct stat& s) {
  return {.octets = static_cast<std::uint64_t>(s.st_size),
          .inode = s.st_ino,
          .modified_ns = std::int64_t{s.st_mtim.tv_sec} * 1'000'000'000 + s.st_mtim.tv_nsec};
}

FileResult<void> write_at(int fd, std::uint64_t offset, OctetView data) {
  std::size_t done = 0;
  while (done < data.size()) {
    const ssize_t n = pwrite(fd, data.data() + done, data.size() - done, static_cast<off_t>(offset + done));
    if (n < 0 && errno == EINTR) continue;
    if (n < 0) return system_fault();
    done += static_cast<std::size_t>(n);
  }
  return {};
}

std::string name_of(TransactionId id) {
  return fmt::format("{}-{}.part", id.source, id.sequence);
}

}  // namespace

Result<std::unique_ptr<PosixFileStore>, FileError> PosixFileStore::open(
    const std::filesystem::path& root, const std::filesystem::path& checkpoint,
    std::uint64_t free_floor_octets) {
  std::error_code error;
  std::filesystem::create_directories(root / temporaries_name, error);
  const auto folder = [](const std::filesystem::path& path) {
    return Fd(::open(path.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC));
  };
  Fd root_fd = folder(root);
  Fd temporaries = folder(root / temporaries_name);
  if (!root_fd || !temporaries) {
    return Err(FileError{fmt::format("{}: cannot open the folder: {}", root.string(), errno_text(errno))});
  }
  return std::unique_ptr<PosixFileStore>(new PosixFileStore(std::move(root_fd), root, std::move(temporaries),
                                                            root / temporaries_name, checkpoint,
                                                            free_floor_octets));
}

PosixFileStore::PosixFileStore(Fd root, std::filesystem::path root_path, Fd temporaries,
                               std::filesystem::path temporaries_path, std::filesystem::path checkpoint,
                               std::uint64_t free_floor_octets)
    : root_(std::move(root)),
      root_path_(std::move(root_path)),
      temporaries_(std::move(temporaries)),
      temporaries_path_(std::move(temporaries_path)),
      checkpoint_(std::move(checkpoint)),
      free_floor_octets_(free_floor_octets) {
  open_.reserve(open_files_max);
}

Result<Octets, FileError> PosixFileStore::load_checkpoint() const {
  if (std::error_code error; !std::filesystem::exists(checkpoint_, error) && !error) return Octets{};
  const auto content = read_file(checkpoint_);
  if (!content) return Err(content.error());
  return Octets(content->begin(), content->end());
}

FileResult<Place> PosixFileStore::locate(std::string_view name) const {
  return cfdp::locate(root_.get(), name);
}

FileResult<FileStamp> PosixFileStore::stamp(std::string_view name) {
  const auto place = locate(name);
  if (!place) return Err(place.error());
  struct stat s {};
  if (fstatat(place->folder.get(), place->name.c_str(), &s, AT_SYMLINK_NOFOLLOW) != 0) return system_fault();
  if (S_ISLNK(s.st_mode)) return Err(FileFault::bad_name);
  if (!S_ISREG(s.st_mode)) return Err(FileFault::not_a_file);
  return stamp_of(s);
}

FileResult<std::size_t> PosixFileStore::read(std::string_view name, std::uint64_t offset,
                                             std::span<std::uint8_t> into) {
  const auto now = stamp(name);
  if (!now) return Err(now.error());
  if (!source_ || source_name_ != name || source_stamp_ != *now) {
    const auto place = locate(name);
    if (!place) return Err(place.error());
    // O_NONBLOCK: should a FIFO have taken the name since, this does not wait for its writer.
    source_ = Fd(openat(place->folder.get(), place->name.c_str(),
                        O_RDONLY | O_NOFOLLOW | O_CLOEXEC | O_NONBLOCK | O_NOCTTY));
    if (!source_) return system_fault();
    source_name_ = name;
    source_stamp_ = *now;
  }
  return read_at(source_.get(), offset, into);
}

FileResult<void> PosixFileStore::check_destination(std::string_view name) {
  const auto place = locate(name);
  if (!place) return Err(place.error());
  struct stat s {};
  if (fstatat(place->folder.get(), place->name.c_str(), &s, AT_SYMLINK_NOFOLLOW) == 0) {
    if (S_ISLNK(s.st_mode)) return Err(FileFault::bad_name);
    if (!S_ISREG(s.st_mode)) return Err(FileFault::not_a_file);
  } else if (errno != ENOENT) {
    return system_fault();
  }
  if (faccessat(place->folder.get(), ".", W_OK, AT_EACCESS) != 0) return system_fault();
  return {};
}

FileResult<int> PosixFileStore::temporary(TransactionId id) {
  const auto found = std::find_if(open_.begin(), open_.end(), [&](const auto& t) { return t.id == id; });
  if (found != open_.end()) return found->fd.get();
  Fd fd(openat(temporaries_.get(), name_of(id).c_str(), O_RDWR | O_NOFOLLOW | O_CLOEXEC));
  if (!fd) return system_fault();
  if (open_.size() == open_files_max) open_.erase(open_.begin());
  open_.push_back({.id = id, .fd = std::move(fd)});
  return open_.back().fd.get();
}

void PosixFileStore::close_temporary(TransactionId id) {
  std::erase_if(open_, [&](const auto& t) { return t.id == id; });
}

FileResult<void> PosixFileStore::create_temporary(TransactionId id) {
  close_temporary(id);
  const Fd fd(openat(temporaries_.get(), name_of(id).c_str(),
                     O_RDWR | O_CREAT | O_TRUNC | O_NOFOLLOW | O_CLOEXEC, 0644));
  if (!fd || fsync(temporaries_.get()) != 0) return system_fault();
  return {};
}

FileResult<void> PosixFileStore::check_room(std::uint64_t octets) {
  struct statvfs s {};
  if (fstatvfs(temporaries_.get(), &s) != 0) return system_fault();
  const std::uint64_t free = std::uint64_t{s.f_bavail} * s.f_frsize;
  if (free < free_floor_octets_ || free - free_floor_octets_ < octets) return Err(FileFault::no_space);
  return {};
}

FileResult<void> PosixFileStore::write_temporary(TransactionId id, std::uint64_t offset, OctetView data) {
  if (const auto room = check_room(data.size()); !room) return room;
  const auto fd = temporary(id);
  if (!fd) return Err(fd.error());
  return write_at(*fd, offset, data);
}

FileResult<std::size_t> PosixFileStore::read_temporary(TransactionId id, std::uint64_t offset,
                                                       std::span<std::uint8_t> into) {
  const auto fd = temporary(id);
  if (!fd) return Err(fd.error());
  return read_at(*fd, offset, into);
}

FileResult<void> PosixFileStore::sync_temporary(TransactionId id) {
  const auto fd = temporary(id);
  if (!fd) return Err(fd.error());
  if (fdatasync(*fd) != 0) return system_fault();
  return {};
}

FileResult<void> PosixFileStore::commit(TransactionId id, std::uint64_t octets, std::string_view name) {
  if (const auto fit = check_destination(name); !fit) return fit;
  const auto place = locate(name);
  if (!place) return Err(place.error());
  const auto fd = temporary(id);
  if (!fd) return Err(fd.error());
  if (ftruncate(*fd, static_cast<off_t>(octets)) != 0 || fsync(*fd) != 0) return system_fault();
  if (renameat(temporaries_.get(), name_of(id).c_str(), place->folder.get(), place->name.c_str()) != 0) {
    return system_fault();
  }
  close_temporary(id);
  if (fsync(place->folder.get()) != 0) return system_fault();
  return {};
}

void PosixFileStore::discard_temporary(TransactionId id) {
  close_temporary(id);
  unlinkat(temporaries_.get(), name_of(id).c_str(), 0);
}

void PosixFileStore::discard_temporaries_except(std::span<const TransactionId> kept) {
  std::error_code error;
  for (const auto& entry : std::filesystem::directory_iterator(temporaries_path_, error)) {
    const std::string name = entry.path().filename();
    const bool is_kept =
        std::any_of(kept.begin(), kept.end(), [&](TransactionId id) { return name_of(id) == name; });
    if (!is_kept) unlinkat(temporaries_.get(), name.c_str(), 0);
  }
}

std::vector<std::string> PosixFileStore::list(std::string_view folder, std::size_t names_max) {
  std::vector<std::string> names;
  std::error_code ec;
  for (std::filesystem::directory_iterator it(root_path_ / folder, ec), end; !ec && it != end;
       it.increment(ec)) {
    if (names.size() == names_max) break;
    std::string name = it->path().filename().string();
    if (!name.starts_with('.') && it->symlink_status(ec).type() == std::filesystem::file_type::regular)
      names.push_back(std::move(name));
  }
  return names;
}

void PosixFileStore::remove(std::string_view name) {
  std::error_code ec;
  std::filesystem::remove(root_path_ / name, ec);  // gone already: nothing to do
}

bool PosixFileStore::rename(std::string_view from, std::string_view to) {
  std::error_code ec;
  std::filesystem::rename(root_path_ / from, root_path_ / to, ec);
  return !ec;
}

FileResult<void> PosixFileStore::save_checkpoint(OctetView checkpoint) {
  const auto written = write_file_atomically(checkpoint_, as_text(checkpoint));
  if (!written) return system_fault();
  return {};
}

}  // namespace srfs::cfdp
