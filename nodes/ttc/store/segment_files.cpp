// SPDX-FileCopyrightText: 2026 SRFS contributors
// SPDX-License-Identifier: Apache-2.0
#include "nodes/ttc/store/segment_files.hpp"

#include <algorithm>
#include <cerrno>

#include <fcntl.h>
#include <fmt/format.h>
#include <sys/stat.h>
#include <unistd.h>

#include "base/file.hpp"
#include "base/text.hpp"

namespace srfs {
namespace {

std::optional<std::uint32_t> segment_number(const std::filesystem::path& path) {
  const std::string stem = path.stem().string();
  return path.extension() == ".seg" && stem.size() == 8 ? to_number<std::uint32_t>(stem, 16) : std::nullopt;
}

void sync_folder(const std::filesystem::path& folder) {
  const Fd fd(::open(folder.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC));
  if (fd) (void)fsync(fd.get());
}

SegmentError failure(const char* what, const std::filesystem::path& path, int error) {
  return {fmt::format("{}: cannot {}: {}", path.string(), what, errno_text(error)), error == ENOENT};
}

}  // namespace

std::filesystem::path PosixSegmentFiles::path_of(std::uint32_t number) const {
  return folder_ / fmt::format("{:08x}.seg", number);
}

Result<std::vector<std::uint32_t>, SegmentError> PosixSegmentFiles::list() {
  std::error_code ec;
  std::filesystem::create_directories(folder_, ec);
  std::vector<std::uint32_t> numbers;
  for (auto it = std::filesystem::directory_iterator(folder_, ec);
       !ec && it != std::filesystem::directory_iterator(); it.increment(ec)) {
    if (const auto number = segment_number(it->path())) numbers.push_back(*number);
  }
  if (ec) return Err(failure("list", folder_, ec.value()));
  std::sort(numbers.begin(), numbers.end());
  return numbers;
}

Result<Octets, SegmentError> PosixSegmentFiles::read(std::uint32_t number, std::size_t octets_max) {
  const auto content = read_file(path_of(number), octets_max);
  if (!content) return Err(SegmentError{content.error().message, !exists(number)});
  const OctetView octets = as_octets(*content);
  return Octets(octets.begin(), octets.end());
}

bool PosixSegmentFiles::exists(std::uint32_t number) {
  std::error_code ec;
  return std::filesystem::exists(path_of(number), ec);
}

Result<void, SegmentError> PosixSegmentFiles::cut(std::uint32_t number, std::size_t octets) {
  if (truncate(path_of(number).c_str(), static_cast<off_t>(octets)) != 0)
    return Err(failure("cut the tail of", path_of(number), errno));
  return {};
}

Result<void, SegmentError> PosixSegmentFiles::remove(std::uint32_t number) {
  if (unlink(path_of(number).c_str()) != 0) return Err(failure("delete", path_of(number), errno));
  return {};
}

Result<void, SegmentError> PosixSegmentFiles::create(std::uint32_t number, OctetView header) {
  file_ = Fd(::open(path_of(number).c_str(), O_WRONLY | O_CREAT | O_TRUNC | O_CLOEXEC, 0644));
  if (!file_) return Err(failure("create", path_of(number), errno));
  open_number_ = number;
  if (pwrite(file_.get(), header.data(), header.size(), 0) != static_cast<ssize_t>(header.size())) {
    const int error = errno;
    file_.reset();
    (void)remove(number);
    SegmentError failed = failure("write", path_of(number), error);
    failed.is_missing = false;
    return Err(std::move(failed));
  }
  sync_folder(folder_);
  return {};
}

Result<void, SegmentError> PosixSegmentFiles::open(std::uint32_t number) {
  file_ = Fd(::open(path_of(number).c_str(), O_WRONLY | O_CLOEXEC));
  if (!file_) return Err(failure("open", path_of(number), errno));
  open_number_ = number;
  return {};
}

Result<void, SegmentError> PosixSegmentFiles::check_open() {
  struct stat info {};
  const bool removed = file_ && fstat(file_.get(), &info) == 0 && info.st_nlink == 0;
  if (removed) return Err(failure("write", path_of(open_number_), ENOENT));
  return {};
}

Result<void, SegmentError> PosixSegmentFiles::write(std::size_t offset, OctetView octets) {
  std::size_t done = 0;
  while (done < octets.size()) {
    const ssize_t n =
        pwrite(file_.get(), octets.data() + done, octets.size() - done, static_cast<off_t>(offset + done));
    if (n < 0 && errno == EINTR) continue;
    if (n <= 0) {
      const int error = n == 0 ? ENOSPC : errno;
      [[maybe_unused]] const int ignored = ftruncate(file_.get(), static_cast<off_t>(offset));
      return Err(failure("write", path_of(open_number_), error));
    }
    done += static_cast<std::size_t>(n);
  }
  return {};
}

Result<void, SegmentError> PosixSegmentFiles::sync() {
  if (fdatasync(file_.get()) != 0) return Err(failure("sync", path_of(open_number_), errno));
  return {};
}

}  // namespace srfs
