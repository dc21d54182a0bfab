// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "base/private_file.hpp"

#include <cerrno>

#include <fcntl.h>
#include <fmt/format.h>
#include <sys/stat.h>
#include <unistd.h>

namespace srfs {
namespace {

constexpr mode_t of_others = S_IRWXG | S_IRWXO;
constexpr mode_t writable_by_others = S_IWGRP | S_IWOTH;

tl::unexpected<FileError> failure(const std::filesystem::path& path, const char* what, int error) {
  // With O_NOFOLLOW a link is ELOOP, and ENOTDIR where a folder is asked for.
  struct stat status {};
  if ((error == ELOOP || error == ENOTDIR) && lstat(path.c_str(), &status) == 0 && S_ISLNK(status.st_mode))
    return Err(FileError{fmt::format("{}: is a symbolic link, so it is not used", path.string())});
  return Err(FileError{fmt::format("{}: cannot {}: {}", path.string(), what, errno_text(error))});
}

tl::unexpected<FileError> refusal(const std::filesystem::path& path, const std::string& why) {
  return Err(FileError{fmt::format("{}: {}, so it is not used", path.string(), why)});
}

bool is_trusted(uid_t owner, std::optional<uid_t> also) {
  return owner == geteuid() || (geteuid() == 0 && owner == also);
}

/// What root makes for a user is that user's.
int make_folder(const std::filesystem::path& folder, std::optional<uid_t> also) {
  if (mkdir(folder.c_str(), S_IRWXU) != 0) return errno;
  if (geteuid() == 0 && also && *also != 0 && lchown(folder.c_str(), *also, static_cast<gid_t>(-1)) != 0)
    return errno;
  return 0;
}

}  // namespace

Result<Fd, FileError> open_private_folder(const std::filesystem::path& folder, bool make,
                                          std::optional<uid_t> also) {
  if (make) {
    int error = make_folder(folder, also);
    if (error == ENOENT && make_folder(folder.parent_path(), also) == 0) error = make_folder(folder, also);
    if (error != 0 && error != EEXIST) return failure(folder, "make", error);
  }
  Fd fd(open(folder.c_str(), O_RDONLY | O_DIRECTORY | O_NOFOLLOW | O_CLOEXEC));
  struct stat status {};
  if (!fd || fstat(fd.get(), &status) != 0) return failure(folder, "open", errno);
  if (!is_trusted(status.st_uid, also))
    return refusal(folder, fmt::format("belongs to user {}", status.st_uid));
  if ((status.st_mode & writable_by_others) != 0)
    return refusal(folder, fmt::format("others may write to it (mode {:04o})", status.st_mode & 07777U));
  if ((status.st_mode & of_others) != 0 && fchmod(fd.get(), S_IRWXU) != 0)
    return failure(folder, "restrict access", errno);
  return fd;
}

Result<Fd, FileError> open_private(const std::filesystem::path& file, int flags, std::optional<uid_t> also) {
  const auto folder = open_private_folder(file.parent_path(), (flags & O_CREAT) != 0, also);
  if (!folder) return Err(folder.error());
  // O_NONBLOCK: opening a FIFO must not wait.
  Fd fd(openat(folder->get(), file.filename().c_str(), flags | O_NOFOLLOW | O_CLOEXEC | O_NONBLOCK,
               S_IRUSR | S_IWUSR));
  struct stat status {};
  struct stat of_folder {};
  if (!fd || fstat(fd.get(), &status) != 0 || fstat(folder->get(), &of_folder) != 0)
    return failure(file, "open", errno);
  if (!S_ISREG(status.st_mode)) return refusal(file, "is not a regular file");
  if (!is_trusted(status.st_uid, also))
    return refusal(file, fmt::format("belongs to user {}", status.st_uid));
  // What root makes in a user's folder is the user's.
  if (status.st_uid != of_folder.st_uid && fchown(fd.get(), of_folder.st_uid, of_folder.st_gid) != 0)
    return failure(file, "assign to its folder's owner", errno);
  return fd;
}

Result<std::string, FileError> read_private(const std::filesystem::path& file, std::size_t limit,
                                            std::optional<uid_t> also) {
  const auto fd = open_private(file, O_RDONLY, also);
  if (!fd) return Err(fd.error());
  return read_open_file(fd->get(), file, limit);
}

Fd open_lock_file(const std::filesystem::path& file) {
  Fd fd(open(file.c_str(), O_RDWR | O_CREAT | O_NOFOLLOW | O_NONBLOCK | O_CLOEXEC, S_IRUSR | S_IWUSR));
  struct stat status {};
  struct stat of_folder {};
  if (!fd || fstat(fd.get(), &status) != 0 || status.st_uid != geteuid()) return fd;
  if ((status.st_mode & of_others) != 0) fchmod(fd.get(), S_IRUSR | S_IWUSR);
  // What root makes in a user's folder is the user's, whose processes take the lock, too.
  if (geteuid() == 0 && stat(file.parent_path().c_str(), &of_folder) == 0 && of_folder.st_uid != 0) {
    [[maybe_unused]] const int ignored = fchown(fd.get(), of_folder.st_uid, of_folder.st_gid);
  }
  return fd;
}

}  // namespace srfs
