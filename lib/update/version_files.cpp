// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "update/version_files.hpp"

#include <algorithm>
#include <array>
#include <cerrno>

#include <fcntl.h>
#include <fmt/format.h>
#include <poll.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <unistd.h>

#include "base/sha256.hpp"

namespace srfs::update {
namespace {

constexpr std::size_t largest_text = 65536;
constexpr mode_t for_all = 0555;

tl::unexpected<FileError> failure(const char* what, const std::filesystem::path& path, int error) {
  return Err(FileError{fmt::format("{}: cannot {}: {}", path.string(), what, errno_text(error))});
}

/// Reads @p from to its end, into @p to as well where that is a descriptor (>= 0).
Result<VersionFiles::Digest, FileError> take(int from, const std::filesystem::path& name, int to,
                                             const std::filesystem::path& copy) {
  Sha256 sha;
  VersionFiles::Digest digest;
  std::array<std::uint8_t, 65536> chunk{};
  while (true) {
    const ssize_t n = ::read(from, chunk.data(), chunk.size());
    if (n < 0 && errno == EINTR) continue;
    if (n < 0) return failure("read", name, errno);
    if (n == 0) break;
    const OctetView data(chunk.data(), static_cast<std::size_t>(n));
    digest.octets += data.size();
    if (digest.octets > VersionFiles::largest_program) return failure("take", name, EFBIG);
    sha.update(data);
    for (std::size_t written = 0; to >= 0 && written < data.size();) {
      const ssize_t done = ::write(to, data.data() + written, data.size() - written);
      if (done < 0 && errno == EINTR) continue;
      if (done < 0) return failure("write", copy, errno);
      written += static_cast<std::size_t>(done);
    }
  }
  digest.sha256 = to_digits(sha.finish());
  return digest;
}

}  // namespace

Result<VersionFiles::Digest, FileError> digest_of(const std::filesystem::path& file) {
  const Fd fd(open(file.c_str(), O_RDONLY | O_CLOEXEC | O_NONBLOCK));
  if (!fd) return failure("open", file, errno);
  return take(fd.get(), file, -1, {});
}

std::vector<std::string> PosixVersionFiles::names() const {
  std::vector<std::string> found;
  std::error_code ec;
  for (std::filesystem::directory_iterator it(folder_, ec), end; !ec && it != end; it.increment(ec))
    found.push_back(it->path().filename().string());
  return found;
}

Result<std::string, FileError> PosixVersionFiles::read(const std::string& name) const {
  return read_file(folder_ / name, largest_text);
}

Result<VersionFiles::Digest, FileError> PosixVersionFiles::digest(const std::string& name) const {
  return digest_of(folder_ / name);
}

Result<void, FileError> PosixVersionFiles::write(const std::string& name, const std::string& text) {
  const auto path = folder_ / name;
  const Fd fd(open(path.c_str(), O_WRONLY | O_CREAT | O_TRUNC | O_CLOEXEC | O_NOFOLLOW, 0644));
  if (!fd) return failure("create", path, errno);
  const ssize_t n = ::write(fd.get(), text.data(), text.size());
  if (n != static_cast<ssize_t>(text.size())) return failure("write", path, n < 0 ? errno : ENOSPC);
  if (fsync(fd.get()) != 0) return failure("sync", path, errno);
  return {};
}

Result<VersionFiles::Digest, FileError> PosixVersionFiles::copy_in(const std::filesystem::path& source,
                                                                   const std::string& name) {
  const Fd from(open(source.c_str(), O_RDONLY | O_CLOEXEC | O_NONBLOCK));
  if (!from) return failure("open", source, errno);
  struct stat status {};
  if (fstat(from.get(), &status) != 0) return failure("read", source, errno);
  if (!S_ISREG(status.st_mode)) return Err(FileError{source.string() + ": not a regular file"});
  const auto path = folder_ / name;
  ::unlink(path.c_str());  // what a power loss left may not be written to
  const Fd to(open(path.c_str(), O_WRONLY | O_CREAT | O_EXCL | O_CLOEXEC | O_NOFOLLOW, 0600));
  if (!to) return failure("create", path, errno);
  auto digest = take(from.get(), source, to.get(), path);
  if (!digest) return digest;
  if (fchmod(to.get(), for_all) != 0 || fsync(to.get()) != 0) return failure("sync", path, errno);
  return digest;
}

Result<void, FileError> PosixVersionFiles::rename(const std::string& from, const std::string& to) {
  if (::rename((folder_ / from).c_str(), (folder_ / to).c_str()) != 0)
    return failure("replace", folder_ / to, errno);
  return {};
}

Result<void, FileError> PosixVersionFiles::remove(const std::string& name) {
  std::error_code ec;
  std::filesystem::remove_all(folder_ / name, ec);
  if (ec) return failure("remove", folder_ / name, ec.value());
  return {};
}

Result<void, FileError> PosixVersionFiles::sync_names() {
  const Fd folder(open(folder_.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC));
  if (!folder || fsync(folder.get()) != 0) return failure("sync", folder_, errno);
  return {};
}

Result<Fd, FileError> PosixVersionFiles::lock(milliseconds patience) {
  std::error_code ec;
  const bool made = std::filesystem::create_directories(folder_, ec);
  Fd folder(open(folder_.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC));
  if (!folder) return failure("open", folder_, errno);
  // The names of the folders themselves; without permission to sync one above, it is none of ours.
  for (const auto& above : {folder_.parent_path(), folder_.parent_path().parent_path()}) {
    if (!made) break;
    const Fd fd(open(above.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC));
    if (fd) (void)fsync(fd.get());
  }
  const MonotonicTime give_up = monotonic_now() + patience;
  while (flock(folder.get(), LOCK_EX | LOCK_NB) != 0) {
    if (monotonic_now() >= give_up) return failure("lock", folder_, errno);
    poll(nullptr, 0, 2);
  }
  return folder;
}

}  // namespace srfs::update
