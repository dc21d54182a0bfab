// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "base/file.hpp"

#include <cerrno>

#include <fcntl.h>
#include <fmt/format.h>
#include <sys/stat.h>
#include <unistd.h>

#include "base/fd.hpp"

namespace srfs {
namespace {

tl::unexpected<FileError> failure(const char* what, const std::filesystem::path& path, int error) {
  return Err(FileError{fmt::format("{}: cannot {}: {}", path.string(), what, errno_text(error))});
}

bool write_all(int fd, std::string_view content) {
  while (!content.empty()) {
    const ssize_t n = write(fd, content.data(), content.size());
    if (n < 0 && errno == EINTR) continue;
    if (n < 0) return false;
    content.remove_prefix(static_cast<std::size_t>(n));
  }
  return true;
}

std::filesystem::path folder_of(const std::filesystem::path& path) {
  return path.has_parent_path() ? path.parent_path() : std::filesystem::path(".");
}

Result<void, FileError> sync_folder_of(const std::filesystem::path& path) {
  const Fd folder(open(folder_of(path).c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC));
  if (!folder || fsync(folder.get()) != 0) return failure("sync the folder of", path, errno);
  return {};
}

}  // namespace

Result<std::string, FileError> read_file(const std::filesystem::path& path, std::size_t limit) {
  const Fd fd(open(path.c_str(), O_RDONLY | O_CLOEXEC));
  if (!fd) return failure("open", path, errno);
  return read_open_file(fd.get(), path, limit);
}

Result<std::string, FileError> read_open_file(int fd, const std::filesystem::path& path, std::size_t limit) {
  std::string content;
  char chunk[16384];
  while (true) {
    const ssize_t n = read(fd, chunk, sizeof chunk);
    if (n < 0 && errno == EINTR) continue;
    if (n < 0) return failure("read", path, errno);
    if (n == 0) return content;
    content.append(chunk, static_cast<std::size_t>(n));
    if (content.size() > limit) return failure("read", path, EFBIG);
  }
}

Result<void, FileError> write_file_atomically(const std::filesystem::path& path, std::string_view content,
                                              Access access) {
  std::error_code ec;
  std::filesystem::create_directories(folder_of(path), ec);
  // The pid keeps two writers from sharing a temporary file; the last rename wins whole.
  const std::filesystem::path temporary = fmt::format("{}.{}.tmp", path.string(), getpid());
  {
    unlink(temporary.c_str());  // of a predecessor with this pid
    const Fd fd(open(temporary.c_str(), O_WRONLY | O_CREAT | O_EXCL | O_NOFOLLOW | O_CLOEXEC,
                     access == Access::owner ? 0600 : 0644));
    if (!fd) return failure("create", temporary, errno);
    if (!write_all(fd.get(), content) || fsync(fd.get()) != 0) {
      const int error = errno;
      unlink(temporary.c_str());
      return failure("write", temporary, error);
    }
  }
  if (rename(temporary.c_str(), path.c_str()) != 0) {
    const int error = errno;
    unlink(temporary.c_str());
    return failure("replace", path, error);
  }
  return sync_folder_of(path);
}

Result<void, FileError> remove_durably(const std::filesystem::path& path) {
  if (unlink(path.c_str()) != 0 && errno != ENOENT) return failure("remove", path, errno);
  return sync_folder_of(path);
}

}  // namespace srfs
