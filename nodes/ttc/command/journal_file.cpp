// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "nodes/ttc/command/journal_file.hpp"

#include <cerrno>

#include <fcntl.h>
#include <fmt/format.h>
#include <sys/stat.h>
#include <unistd.h>

namespace srfs {
namespace {

/// @return errno, 0 when all was written
int write_all(int fd, OctetView octets, std::size_t offset) {
  while (!octets.empty()) {
    const ssize_t written = pwrite(fd, octets.data(), octets.size(), static_cast<off_t>(offset));
    if (written < 0 && errno == EINTR) continue;
    if (written <= 0) return written == 0 ? ENOSPC : errno;
    octets = octets.subspan(static_cast<std::size_t>(written));
    offset += static_cast<std::size_t>(written);
  }
  return 0;
}

}  // namespace

std::filesystem::path JournalFile::path_of(unsigned segment) const {
  return path_.string() + (segment == 0 ? ".0" : ".1");
}

FileError JournalFile::fail(unsigned segment, const char* what, int error) {
  files_.at(segment).reset();  // opened anew at the next try
  return FileError{fmt::format("{}: {}: {}", path_of(segment).string(), what, errno_text(error))};
}

Octets JournalFile::read(unsigned segment) {
  const auto content = read_file(path_of(segment), 2 * journal_segment_octets);
  if (!content) return {};
  return {content->begin(), content->end()};
}

Result<void, FileError> JournalFile::open_file(unsigned segment) {
  Fd& file = files_.at(segment);
  if (file) return {};
  std::error_code ec;
  std::filesystem::create_directories(path_.parent_path(), ec);
  file = Fd(open(path_of(segment).c_str(), O_RDWR | O_CREAT | O_CLOEXEC, 0600));
  if (!file) return Err(fail(segment, "cannot be opened", errno));
  struct stat info {};
  if (fstat(file.get(), &info) != 0) return Err(fail(segment, "cannot be examined", errno));
  const auto size = static_cast<std::size_t>(info.st_size);
  if (size >= journal_segment_octets) return {};
  // Real zeros: blocks that are only reserved would cost the sync of each record its metadata.
  if (const int error = write_all(file.get(), Octets(journal_segment_octets - size), size); error != 0)
    return Err(fail(segment, "cannot be created", error));
  const Fd folder(open(path_.parent_path().c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC));
  if (fsync(file.get()) != 0 || !folder || fsync(folder.get()) != 0)
    return Err(fail(segment, "cannot be created", errno));
  return {};
}

Result<void, FileError> JournalFile::write(unsigned segment, std::size_t offset, OctetView octets) {
  if (auto opened = open_file(segment); !opened) return opened;
  if (const int error = write_all(files_.at(segment).get(), octets, offset); error != 0)
    return Err(fail(segment, "cannot be written", error));
  return {};
}

Result<void, FileError> JournalFile::sync(unsigned segment) {
  if (auto opened = open_file(segment); !opened) return opened;
  if (fdatasync(files_.at(segment).get()) != 0) return Err(fail(segment, "cannot be synced", errno));
  return {};
}

}  // namespace srfs
